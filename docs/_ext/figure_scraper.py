"""Save the figure of a gallery program: the value of its variable `figure`."""

from __future__ import annotations

from typing import Any

from sphinx_gallery.scrapers import figure_rst


def save_figure(block: tuple[str, str, int], block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:  # noqa: ARG001
    """Save the variable `figure` of a program as a picture, and return the directive that shows it.

    pretouch draws without pyplot, so that Sphinx-Gallery does not find its figures by itself.

    Returns:
        The directive; an empty text for a part of a program without a figure.
    """
    figure = block_vars["example_globals"].pop("figure", None)
    if figure is None:
        return ""
    path = next(block_vars["image_path_iterator"])
    figure.savefig(path, dpi=110)
    return figure_rst([path], gallery_conf["src_dir"])
