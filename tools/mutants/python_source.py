"""How a Python source can be changed: the syntax tree says where, the text is changed in that one place."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from mutants.edits import Edit, other_number

OPERATORS = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}
COMPARISONS = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
OPPOSITES = {
    name: other
    for one, two in (("min", "max"), ("any", "all"), ("minimum", "maximum"), ("argmin", "argmax"), ("floor", "ceil"))
    for name, other in ((one, two), (two, one))
}
STYLES = frozenset(
    {
        "alpha",
        "ax",
        "bbox_to_anchor",
        "borderpad",
        "brief",
        "color",
        "colors",
        "dpi",
        "edgecolor",
        "figsize",
        "fontsize",
        "frameon",
        "frozen",
        "gap",
        "height_ratios",
        "hspace",
        "indent",
        "kw_only",
        "linestyle",
        "linewidth",
        "linewidths",
        "marker",
        "markersize",
        "nbins",
        "pad",
        "parse_math",
        "repr",
        "rotation",
        "size",
        "slots",
        "steps",
        "strict",
        "weight",
        "which",
        "wraps",
        "wspace",
        "xytext",
        "zorder",
    }
)
"""Arguments that say how a drawing or a page looks, or how a class is made."""


class Finder(ast.NodeVisitor):
    """Collects the changes of a source."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.found: list[Edit] = []
        self.begins = [0]
        for line in text.splitlines(keepends=True):
            self.begins.append(self.begins[-1] + len(line))
        self.bytes = [line.encode() for line in text.splitlines(keepends=True)]

    def place(self, line: int, column: int) -> int:
        """Return the place in the text of a column, which Python counts in bytes."""
        return self.begins[line - 1] + len(self.bytes[line - 1][:column].decode())

    def span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        """Return where a node begins and ends."""
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self.place(node.lineno, node.col_offset), self.place(node.end_lineno, node.end_col_offset)

    def replace(self, node: ast.expr | ast.stmt, new: str) -> None:
        """Note a change of a whole node, of one line."""
        start, end = self.span(node)
        if "\n" not in self.text[start:end]:
            self.found.append(Edit(start, end, new))

    def between(self, left: ast.expr, right: ast.expr, old: str, new: str) -> None:
        """Note a change of the operator between two nodes."""
        start, end = self.span(left)[1], self.span(right)[0]
        gap = self.text[start:end]
        if gap.count(old) == 1 and "#" not in gap:
            at = start + gap.index(old)
            self.found.append(Edit(at, at + len(old), new))

    # what decides nothing

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for default in [*node.args.defaults, *filter(None, node.args.kw_defaults)]:
            self.visit(default)
        for statement in node.body:
            self.visit(statement)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for statement in node.body:
            self.visit(statement)

    def visit_Raise(self, node: ast.Raise) -> None:
        """Leave out words; a raise that is dropped is a change of its own."""
        self.replace(node, "pass")

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Take the numbers that a message computes; how they are written is no matter."""
        for part in node.values:
            if isinstance(part, ast.FormattedValue) and node.lineno == node.end_lineno and self._places_known(part):
                self.visit(part.value)

    def _places_known(self, part: ast.FormattedValue) -> bool:
        """Before Python 3.12 an expression in a message has wrong places: then its text is not what it should be."""
        start, end = self.span(part.value)
        return ast.unparse(part.value) == self.text[start:end]

    def visit_Import(self, node: ast.Import) -> None: ...

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None: ...

    def visit_Subscript(self, node: ast.Subscript) -> None:
        text = ast.unparse(node.value)
        if text not in {"Literal", "tuple", "dict", "list", "Callable", "ClassVar", "Final", "Sequence", "Mapping"}:
            self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in {"TypeVar", "cast", "NewType", "field", "lru_cache"}:
            return
        if name in OPPOSITES:
            end = self.span(node.func)[1]
            self.found.append(Edit(end - len(name), end, OPPOSITES[name]))
        self.visit(node.func)
        for argument in node.args:
            self.visit(argument)
        for keyword in node.keywords:
            if keyword.arg not in STYLES:
                self.visit(keyword.value)

    def visit_If(self, node: ast.If) -> None:
        if "TYPE_CHECKING" not in ast.unparse(node.test):
            self.negate(node.test)
            self.generic_visit(node)

    # what does

    def negate(self, test: ast.expr) -> None:
        """Note that a condition is turned round."""
        start, end = self.span(test)
        if "\n" not in self.text[start:end] and not isinstance(test, ast.Compare | ast.BoolOp):
            old = self.text[start:end]
            new = old[4:] if old.startswith("not ") else f"not ({old})"
            self.found.append(Edit(start, end, new))

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self.negate(node.test)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        words = (ast.JoinedStr, ast.List, ast.Tuple)
        text = isinstance(node.left, words) or isinstance(node.right, words)
        text = text or any(isinstance(n, ast.Constant) and isinstance(n.value, str) for n in (node.left, node.right))
        if type(node.op) in OPERATORS and not text:
            self.between(node.left, node.right, *OPERATORS[type(node.op)])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.between(left, right, old, new)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        parts = [node.left, *node.comparators]
        for left, operator, right in zip(parts, node.ops, parts[1:], strict=False):
            old, others = COMPARISONS[type(operator)]
            for new in others:
                self.between(left, right, old, new)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not):
            start, _ = self.span(node)
            inner, _ = self.span(node.operand)
            if "\n" not in self.text[start:inner] and "(" not in self.text[start:inner]:
                self.found.append(Edit(start, inner, ""))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool):
            self.replace(node, str(not node.value))
        elif isinstance(node.value, int | float):
            start, end = self.span(node)
            for new in other_number(self.text[start:end].replace("_", "")):
                self.replace(node, new)

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is not None:
            if not isinstance(node.value, ast.Constant):
                self.replace(node.value, "None")
            self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return  # a docstring, or an ellipsis
        if isinstance(node.value, ast.Call | ast.Yield | ast.YieldFrom):
            self.replace(node, "pass")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.replace(node, "pass")
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        target = node.targets[0]
        if isinstance(target, ast.Name) and target.id in {"__all__", "__slots__"}:
            return
        if isinstance(target, ast.Subscript | ast.Attribute):
            self.replace(node, "pass")
        self.generic_visit(node)

    def visit_Continue(self, node: ast.Continue) -> None:
        self.replace(node, "pass")

    def visit_Break(self, node: ast.Break) -> None:
        self.replace(node, "pass")


def edits(text: str) -> Iterator[Edit]:
    """Yield every change of a Python source."""
    finder = Finder(text)
    finder.visit(ast.parse(text))
    yield from finder.found
