# SPDX-License-Identifier: Apache-2.0
"""One-line faults of a Python file, by its syntax tree: what could be mistyped in each line, as text to put in its place."""

import ast
from dataclasses import dataclass

COMPARISONS = {
    ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"), ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
}  # fmt: skip
OPERATORS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"), ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"), ast.Pow: ("**", "*"), ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"),
}  # fmt: skip
PARTNERS = (
    ("min", "max"), ("minimum", "maximum"), ("fmin", "fmax"), ("nanmin", "nanmax"), ("argmin", "argmax"),
    ("floor", "ceil"), ("any", "all"),
)  # fmt: skip
RENAMES = {**dict(PARTNERS), **{b: a for a, b in PARTNERS}}
# The order of their arguments does not matter.
SYMMETRIC = {
    "dot", "add", "mul", "hypot", "isclose", "allclose", "array_equal", "gcd", "array_equiv", "logical_and", "logical_or",
    "equal", "not_equal", "vdot", *RENAMES,
}  # fmt: skip
# Their arguments are texts, or say what type something has.
WORDS = {"add", "warn", "isinstance", "issubclass", "cast", "getattr", "hasattr", "add_argument", "print", "TypeVar"}


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Args:
        line: where it is, from 1.
        kind: what was done.
        start, end: the characters replaced.
        text: what is put there.
    """

    line: int
    kind: str
    start: int
    end: int
    text: str

    def applied(self, source):
        """The source with this fault."""
        return source[: self.start] + self.text + source[self.end :]

    def shown(self, source):
        """The line before and after, without blanks around them."""
        first = source.rfind("\n", 0, self.start) + 1
        last = source.find("\n", self.end)
        last = len(source) if last < 0 else last
        before, after = source[first:last], source[first : self.start] + self.text + source[self.end : last]
        return " ".join(before.split()), " ".join(after.split())


class Finder(ast.NodeVisitor):
    """Collects the faults of one file.

    Args:
        source: its text.
        device: whether Warp compiles its functions, which return no None.
    """

    def __init__(self, source, device=False):
        self.source, self.device, self.found, self.assigned = source, device, [], [set()]
        self.lines, offset = [], 0
        for line in source.splitlines(keepends=True):
            self.lines.append((offset, line))
            offset += len(line)

    def offset(self, row, column):
        """Place in the text; the tree counts columns in bytes."""
        start, line = self.lines[row - 1]
        return start + len(line.encode()[:column].decode())

    def span(self, node):
        """First and last place of a node."""
        return self.offset(node.lineno, node.col_offset), self.offset(node.end_lineno, node.end_col_offset)

    def text(self, node):
        """Its source."""
        start, end = self.span(node)
        return self.source[start:end]

    def add(self, node, kind, text, span=None):
        """Note a fault: `text` in place of a node."""
        start, end = span or self.span(node)
        if self.source[start:end] != text:
            line = self.source.count("\n", 0, start) + 1
            self.found.append(Mutant(line, kind, start, end, text))

    def between(self, remaining, right, old, new, kind):
        """Note a fault of the operator between two nodes."""
        start, end = self.span(remaining)[1], self.span(right)[0]
        gap = self.source[start:end]
        at = gap.find(old)
        if at >= 0 and "#" not in gap:
            self.add(remaining, kind, new, (start + at, start + at + len(old)))

    # What is not touched: imports, annotations, decorators, texts.
    def visit_Import(self, node):
        """Nothing."""

    visit_ImportFrom = visit_JoinedStr = visit_Import  # noqa: N815

    def visit_AnnAssign(self, node):
        """The value alone."""
        if node.value is not None:
            self.visit(node.value)

    def visit_Assign(self, node):
        """Not the lists of names, nor constants that are only texts."""
        if any(isinstance(target, ast.Name) and target.id == "__all__" for target in node.targets):
            return
        names = {target.id for target in node.targets if isinstance(target, ast.Name)}
        stored = any(isinstance(target, ast.Attribute | ast.Subscript) for target in node.targets)
        if (names and names <= self.assigned[-1]) or stored:
            self.deleted(node)
        self.assigned[-1] |= names
        self.generic_visit(node)

    def visit_ClassDef(self, node):
        """Its body."""
        self.assigned.append(set())
        for child in node.body:
            self.visit(child)
        self.assigned.pop()

    def visit_FunctionDef(self, node):
        """Its defaults and its body."""
        if node.name == "__repr__":
            return
        for default in [*node.args.defaults, *[d for d in node.args.kw_defaults if d is not None]]:
            self.visit(default)
        self.assigned.append({argument.arg for argument in [*node.args.args, *node.args.kwonlyargs]})
        for child in node.body:
            self.visit(child)
        self.assigned.pop()

    visit_AsyncFunctionDef = visit_FunctionDef  # noqa: N815

    def visit_Raise(self, node):
        """Delete it; its message is left."""
        self.deleted(node)

    def visit_Assert(self, node):
        """Nothing: it is for type checkers."""

    def deleted(self, node):
        """A statement left out; the lines after it keep their numbers."""
        self.add(node, "statement deleted", "pass" + "\n" * self.text(node).count("\n"))

    def visit_Expr(self, node):
        """A call for its effect."""
        if isinstance(node.value, ast.Constant):
            return
        if isinstance(node.value, ast.Call):
            self.deleted(node)
        self.generic_visit(node)

    def visit_AugAssign(self, node):
        """`+=`."""
        self.deleted(node)
        old, new = OPERATORS.get(type(node.op), (None, None))
        if old:
            self.between(node.target, node.value, f"{old}=", f"{new}=", "operator")
        self.generic_visit(node)

    def visit_Continue(self, node):
        """Left out."""
        self.deleted(node)

    visit_Break = visit_Delete = visit_Continue  # noqa: N815

    def visit_Return(self, node):
        """Another value."""
        if node.value is None:
            return
        constant = isinstance(node.value, ast.Constant) and node.value.value is None
        if isinstance(node.value, ast.Compare | ast.BoolOp) or (
            isinstance(node.value, ast.UnaryOp) and isinstance(node.value.op, ast.Not)
        ):
            self.add(node.value, "return value", f"not ({self.text(node.value)})")
        elif not self.device and not constant:
            self.add(node.value, "return value", "None")
        self.generic_visit(node)

    def visit_Compare(self, node):
        """The operator next to it."""
        lefts = [node.left, *node.comparators[:-1]]
        for left, operator, right in zip(lefts, node.ops, node.comparators):
            self.between(left, right, *COMPARISONS[type(operator)], "comparison")
        self.generic_visit(node)

    def visit_BinOp(self, node):
        """Another operator, unless it joins texts or types."""
        sides = (node.left, node.right)
        texts = any(isinstance(side, ast.JoinedStr | ast.List | ast.Tuple) for side in sides) or any(
            isinstance(side, ast.Constant) and isinstance(side.value, str | bytes | None) for side in sides
        )
        old, new = OPERATORS.get(type(node.op), (None, None))
        if old and not texts:
            self.between(node.left, node.right, old, new, "operator")
        self.generic_visit(node)

    def visit_BoolOp(self, node):
        """`and` for `or`."""
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:]):
            self.between(left, right, old, new, "and/or")
        self.generic_visit(node)

    def visit_UnaryOp(self, node):
        """Without it."""
        if isinstance(node.op, ast.Not | ast.USub):
            self.add(node, "not or minus dropped", f"({self.text(node.operand)})")
        self.generic_visit(node)

    def visit_Constant(self, node):
        """Another number."""
        value = node.value
        if isinstance(value, bool):
            self.add(node, "constant", str(not value))
        elif isinstance(value, int):
            self.add(node, "constant", str(value + 1))
        elif isinstance(value, float):
            self.add(node, "constant", repr(value * 1.01 if value else 1.0))
            if value:
                self.add(node, "constant", f"(-{self.text(node)})")

    def visit_Subscript(self, node):
        """Another entry."""
        index = node.slice
        if isinstance(index, ast.Constant) and isinstance(index.value, int):
            self.add(index, "index", str(index.value + 1))
        elif isinstance(index, ast.UnaryOp) and isinstance(index.operand, ast.Constant):
            self.add(index.operand, "index", str(index.operand.value + 1))
        else:
            self.visit(index)
        self.visit(node.value)

    def visit_Call(self, node):
        """Arguments in another order; the least for the largest."""
        name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        positional = [argument for argument in node.args if not isinstance(argument, ast.Starred)]
        if name in RENAMES:
            end = self.span(node.func)[1]
            self.add(node.func, "min/max", RENAMES[name], (end - len(name), end))
        elif len(positional) == len(node.args) >= 2 and name not in SYMMETRIC | WORDS:
            for a, b in zip(node.args, node.args[1:]):
                between = self.source[self.span(a)[1] : self.span(b)[0]]
                if "#" not in between:
                    self.add(
                        a, "argument order", self.text(b) + between + self.text(a), (self.span(a)[0], self.span(b)[1])
                    )
        if name in ("add", "warn") and not self.device:  # texts of messages
            return
        self.generic_visit(node)

    def visit_keyword(self, node):
        """Its value; not whether NumPy may keep an array that it need not copy."""
        if node.arg != "copy":
            self.visit(node.value)

    def condition(self, node):
        """A condition that always or never holds."""
        if not isinstance(node.test, ast.Constant | ast.Call) or not self.text(node.test).startswith("wp.static"):
            if not isinstance(node, ast.While):
                self.add(node.test, "condition", "True")
            self.add(node.test, "condition", "False")
        self.generic_visit(node)

    def visit_If(self, node):
        """Its test; nothing in what only type checkers read."""
        if "TYPE_CHECKING" not in self.text(node.test):
            self.condition(node)

    visit_While = visit_IfExp = condition  # noqa: N815

    def visit_comprehension(self, node):
        """Its conditions left out."""
        for test in node.ifs:
            self.add(test, "condition", "True")
        self.generic_visit(node)


def mutants(source, device=False):
    """All faults of a file; few of them are no Python any more.

    Args:
        source: its text.
        device: whether Warp compiles its functions.

    Returns:
        A list of Mutant, by line.
    """
    finder = Finder(source, device)
    finder.visit(ast.parse(source))
    return sorted(finder.found, key=lambda mutant: (mutant.line, mutant.start, mutant.text))


def parses(source):
    """Whether it is Python."""
    try:
        ast.parse(source)
    except SyntaxError:
        return False
    return True
