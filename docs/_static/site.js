// Let the keyboard scroll whatever is wider than the page: code and tables.
function makeScrollable() {
  for (const box of document.querySelectorAll("article pre, article .table-wrapper")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  }
}
window.addEventListener("load", makeScrollable);
window.addEventListener("resize", makeScrollable);
