"""Every small fault that is put into a source file: what is changed, where, and how it is called.

A mutant has a name of words, not a line number, so that what is said of it stays true while the file around it is
edited. Left alone is what no run can show: annotations, docstrings, `assert` (a word to the type checker), imports,
`__slots__`, and prose: a string with a space in it is a sentence for people, and a test that repeats it proves nothing.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

WIDEST = 72
"""Characters of source that a name shows at most."""
NAMELESS = re.compile(r"\S*")
TYPING = {
    "TypeVar",
    "ParamSpec",
    "NewType",
    "TypeAlias",
    "TYPE_CHECKING",
    "__slots__",
    "__all__",
    "__match_args__",
}
LEFT_ALONE = (
    "annotation",
    "returns",
    "decorator_list",
    "bases",
    "format_spec",
    "type_params",
)

Swapped = dict[type[ast.AST], tuple[type[ast.AST], ...]]
COMPARISONS: Swapped = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
OPERATORS: Swapped = {
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.FloorDiv: (ast.Mult,),
    ast.Mod: (ast.Mult,),
    ast.LShift: (ast.RShift,),
    ast.RShift: (ast.LShift,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.BitXor: (ast.BitAnd,),
    ast.Pow: (ast.Mult,),
}
FUNCTIONS = {"min": "max", "max": "min", "any": "all", "all": "any"}


class Mutant(NamedTuple):
    """One fault: its name in its file, the lines it stands on, and where in the tree what is put.

    `lines` are those of its statement; `swapped` says that the body of a function of the module or of a class of it
    is all that it changes, so that it can be put into a module that is imported already.
    """

    name: str
    lines: range
    swapped: bool
    parent: ast.AST
    field: str
    at: int | None
    new: object

    def put(self) -> object:
        """Change the tree, and give what was there before."""
        return _put(self.parent, self.field, self.at, self.new)

    def code(self, tree: ast.Module, path: str) -> Any:
        """The module with this fault, compiled; the tree is left as it was."""
        before = self.put()
        try:
            return compile(ast.fix_missing_locations(tree), path, "exec")
        finally:
            _put(self.parent, self.field, self.at, before)


def mutants(tree: ast.Module) -> list[Mutant]:
    """Every fault for this file, in the order of its lines, each with a name of its own."""
    seen: Counter[str] = Counter()
    found = []
    for one in _Walk().through(tree):
        seen[one.name] += 1
        again = seen[one.name]
        found.append(one._replace(name=f"{one.name} ({again})") if again > 1 else one)
    return found


def _put(parent: ast.AST, field: str, index: int | None, new: object) -> object:
    if index is None:
        before = getattr(parent, field)
        setattr(parent, field, new)
        return before
    entries = getattr(parent, field)
    before, entries[index] = entries[index], new
    return before


class _Walk:
    """Goes through a file and knows where it is: under which names, in which statement, below which expressions."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.above: list[ast.AST] = []
        self.inside = 0  # so many functions

    def through(self, node: ast.AST) -> Iterator[Mutant]:
        """What can be changed below this node."""
        self.above.append(node)
        for field, value in ast.iter_fields(node):
            if field in LEFT_ALONE or (field == "keywords" and isinstance(node, ast.ClassDef)):
                continue
            entries = value if isinstance(value, list) else [value]
            for index, child in enumerate(entries):
                if isinstance(child, ast.AST) and not _left_alone(child):
                    yield from self._child(child, node, field, index if isinstance(value, list) else None)
        self.above.pop()

    def _child(self, child: ast.AST, node: ast.AST, field: str, index: int | None) -> Iterator[Mutant]:
        body = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and field == "body"
        self.inside += body
        for new in changes(child, node, field):
            yield self._mutant(child, node, field, index, new)
        named = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        if named:
            self.names.append(child.name)  # type: ignore[attr-defined]
        yield from self.through(child)
        if named:
            self.names.pop()
        self.inside -= body

    def _mutant(self, child: ast.AST, node: ast.AST, field: str, index: int | None, new: object) -> Mutant:
        shown = self._shown(child)
        before = _text(shown)
        old = _put(node, field, index, new)
        after = "nothing" if isinstance(new, ast.Pass) else _text(new if shown is child else shown)
        _put(node, field, index, old)
        before, after = _cut(before, after)
        where = ".".join(self.names)
        name = f"{where}: {before} → {after}" if where else f"{before} → {after}"
        return Mutant(name, self._lines(child), self.inside > 0, node, field, index, new)

    def _shown(self, child: ast.AST) -> ast.AST:
        """The widest piece around it that still fits into a name."""
        shown = child
        for above in reversed(self.above):
            compound = hasattr(above, "body") and not isinstance(above, ast.IfExp | ast.Lambda)
            if isinstance(above, ast.Module) or compound or isinstance(shown, ast.stmt):
                break
            if isinstance(above, ast.expr | ast.stmt | ast.keyword) and len(ast.unparse(above)) > WIDEST:
                break
            shown = above
        return shown

    def _lines(self, child: ast.AST) -> range:
        """Lines of the statement it is in; of a statement with a body only what is before the body."""
        for one in [child, *reversed(self.above)]:
            if isinstance(one, ast.stmt):
                parts = [part for part in ast.iter_child_nodes(one) if isinstance(part, ast.expr)]
                ends = [part.end_lineno or one.lineno for part in parts]
                last = max(ends, default=one.lineno) if hasattr(one, "body") else one.end_lineno or one.lineno
                return range(one.lineno, last + 1)
            if isinstance(one, ast.ExceptHandler):
                return range(one.lineno, one.body[0].lineno + 1)
        return range(0)


def _text(node: object) -> str:
    return " ".join(ast.unparse(node).split()) if isinstance(node, ast.AST) else str(node)


def _cut(before: str, after: str) -> tuple[str, str]:
    """Both as long as a name may show, around the place where they begin to differ."""
    alike = next((at for at, (one, two) in enumerate(zip(before, after, strict=False)) if one != two), 0)
    start = max(0, alike - WIDEST // 2) if max(len(before), len(after)) > WIDEST else 0
    return _window(before, start), _window(after, start)


def _window(text: str, start: int) -> str:
    end = start + WIDEST
    return f"{'...' if start else ''}{text[start:end]}{'...' if len(text) > end else ''}"


def _left_alone(node: ast.AST) -> bool:
    match node:
        case ast.Assert() | ast.Import() | ast.ImportFrom() | ast.Expr(value=ast.Constant()):
            return True
        case ast.AnnAssign(annotation=ast.Name(id="TypeAlias")):
            return True
        case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)) if (
            name in TYPING
        ):
            return True
        case ast.Assign(value=ast.Call(func=ast.Name(id=name))) if name in TYPING:
            return True
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
    return False


# --- what becomes of a node ------------------------------------------------------------------------------------------


def changes(node: ast.AST, parent: ast.AST, field: str) -> Iterator[ast.AST]:
    """What is put in place of this node, one after the other."""
    for kind, rule in RULES.items():
        if isinstance(node, kind):
            yield from rule(node, parent)
    condition = field == "ifs" or (field == "test" and isinstance(parent, ast.If | ast.While | ast.IfExp))
    if condition and not isinstance(node, ast.Compare | ast.BoolOp | ast.Constant) and not _negated(node):
        yield ast.UnaryOp(ast.Not(), node)  # type: ignore[arg-type]
    if field == "iter" and isinstance(parent, ast.For | ast.AsyncFor):
        yield ast.Tuple([], ast.Load())
    if isinstance(node, ast.stmt) and _can_go(node):
        yield ast.Pass()


def _negated(node: ast.AST) -> bool:
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)


def _can_go(node: ast.stmt) -> bool:
    """Statements without which a function can still run; without the binding of a name it plainly cannot."""
    match node:
        case ast.Expr() | ast.Raise() | ast.Continue() | ast.Break() | ast.Delete() | ast.Return(value=None):
            return True
        case ast.AugAssign():
            return True
        case ast.Assign(targets=targets):
            return all(isinstance(target, ast.Attribute | ast.Subscript) for target in targets)
        case ast.AnnAssign(target=ast.Attribute(), value=ast.expr()):
            return True
    return False


def _constant(node: ast.Constant, parent: ast.AST) -> Iterator[ast.AST]:
    if isinstance(parent, ast.JoinedStr | ast.Expr):
        return
    match node.value:
        case bool(value):
            yield ast.Constant(not value)
        case int(value):
            yield ast.Constant(value + 1)
            yield ast.Constant(value - 1) if value else ast.UnaryOp(ast.USub(), ast.Constant(1))
        case float(value):
            yield from map(ast.Constant, (value * 2, value / 2) if value else (1.0,))
        case str(value) if NAMELESS.fullmatch(value):
            yield ast.Constant(f"{value}_")
        case bytes(value):
            yield ast.Constant(value[:-1] + bytes([value[-1] ^ 1]) if value else b"\0")


def _compare(node: ast.Compare, _: ast.AST) -> Iterator[ast.AST]:
    for index, old in enumerate(node.ops):
        for new in COMPARISONS[type(old)]:
            ops = [*node.ops[:index], new(), *node.ops[index + 1 :]]
            yield ast.Compare(node.left, ops, node.comparators)  # type: ignore[arg-type]


def _boolean(node: ast.BoolOp, _: ast.AST) -> Iterator[ast.AST]:
    yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    for index in range(len(node.values)):
        rest = [*node.values[:index], *node.values[index + 1 :]]
        yield ast.BoolOp(node.op, rest) if len(rest) > 1 else rest[0]


def _arithmetic(node: ast.BinOp, _: ast.AST) -> Iterator[ast.AST]:
    text = (ast.JoinedStr, ast.Constant)
    if any(isinstance(side, text) and _is_text(side) for side in (node.left, node.right)):
        return  # two sentences
    for new in OPERATORS.get(type(node.op), ()):
        yield ast.BinOp(node.left, new(), node.right)  # type: ignore[arg-type]


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _augmented(node: ast.AugAssign, _: ast.AST) -> Iterator[ast.AST]:
    for new in OPERATORS.get(type(node.op), ()):
        yield ast.copy_location(ast.AugAssign(node.target, new(), node.value), node)  # type: ignore[arg-type]


def _unary(node: ast.UnaryOp, _: ast.AST) -> Iterator[ast.AST]:
    if not isinstance(node.op, ast.UAdd):
        yield node.operand


def _call(node: ast.Call, _: ast.AST) -> Iterator[ast.AST]:
    match node.func:
        case ast.Name(id=name) if name in FUNCTIONS:
            yield ast.Call(ast.Name(FUNCTIONS[name], ast.Load()), node.args, node.keywords)
        case ast.Attribute(attr="suppress") | ast.Name(id="suppress"):
            for index in range(len(node.args)):
                yield ast.Call(node.func, [*node.args[:index], *node.args[index + 1 :]], node.keywords)


def _slice(node: ast.Slice, _: ast.AST) -> Iterator[ast.AST]:
    if node.lower is not None:
        yield ast.Slice(None, node.upper, node.step)
    if node.upper is not None:
        yield ast.Slice(node.lower, None, node.step)
    if node.step is not None:
        yield ast.Slice(node.lower, node.upper, None)


def _return(node: ast.Return, _: ast.AST) -> Iterator[ast.AST]:
    if node.value is not None and not isinstance(node.value, ast.Constant):
        yield ast.copy_location(ast.Return(ast.Constant(None)), node)


def _handler(node: ast.ExceptHandler, _: ast.AST) -> Iterator[ast.AST]:
    kinds = node.type.elts if isinstance(node.type, ast.Tuple) else [node.type]
    for index in range(len(kinds)):
        rest = [kind for kind in [*kinds[:index], *kinds[index + 1 :]] if kind is not None]
        yield ast.copy_location(ast.ExceptHandler(ast.Tuple(rest, ast.Load()), node.name, node.body), node)


Rule = Callable[[Any, ast.AST], Iterator[ast.AST]]
RULES: dict[type[ast.AST], Rule] = {
    ast.Constant: _constant,
    ast.Compare: _compare,
    ast.BoolOp: _boolean,
    ast.BinOp: _arithmetic,
    ast.AugAssign: _augmented,
    ast.UnaryOp: _unary,
    ast.Call: _call,
    ast.Slice: _slice,
    ast.Return: _return,
    ast.ExceptHandler: _handler,
}
