"""The faults that can be put into a source file, one at a time: a place, and the text in its place.

Only the text of the place changes: the rest of the file stays as it is, to the last character.
"""

import ast
import copy
import itertools
from collections.abc import Iterator
from dataclasses import dataclass

# By 2 %: a number that is wrong as a slip of a digit makes it.
SLIP = 1.02
ARITHMETIC = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Add,
    ast.MatMult: ast.Mult,
}
COMPARISONS = {
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


@dataclass(frozen=True)
class Fault:
    """A fault of a file, as offsets into its bytes."""

    path: str
    line: int
    kind: str
    begin: int
    end: int
    before: str
    after: str

    @property
    def name(self) -> str:
        """What tells it from every other one."""
        short = (" ".join(text.split()) for text in (self.before, self.after))
        return f"{self.path}:{self.line}: {self.kind}: " + " -> ".join(short)

    def put_into(self, content: bytes) -> bytes:
        """Return a file's content with the fault in it."""
        return content[: self.begin] + self.after.encode() + content[self.end :]


def faults(path: str, content: bytes) -> Iterator[Fault]:
    """Yield every fault of a file; annotations, texts and imports have none."""
    starts = [0]
    for line in content.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for node in _computing(ast.parse(content)):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        before = content[begin:end].decode()
        for kind, changed in _changed(node):
            after = changed if isinstance(changed, str) else ast.unparse(changed)
            if isinstance(changed, ast.expr):
                after = f"({after})"
            if isinstance(changed, ast.If):  # by lines of its own, as far in as it stood
                after = after.replace("\n", "\n" + node.col_offset * " ")
            yield Fault(path, node.lineno, kind, begin, end, before, after)


def _computing(tree: ast.AST) -> Iterator[ast.expr | ast.stmt]:
    """Yield the nodes that compute: no annotation, no text put together, no import."""
    for name, value in ast.iter_fields(tree):
        skipped = name in ("annotation", "returns", "type_params", "decorator_list")
        for node in value if isinstance(value, list) else [value]:
            still = isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom | ast.Raise)
            if skipped or still or not isinstance(node, ast.AST):
                continue
            if isinstance(node, ast.expr | ast.stmt):
                yield node
            yield from _computing(node)


def _changed(node: ast.AST) -> Iterator[tuple[str, ast.AST | str]]:
    """Yield what may stand in the place of a node."""

    def with_(**fields: object) -> ast.AST:
        other = copy.deepcopy(node)
        for name, value in fields.items():
            setattr(other, name, value)
        return other

    match node:
        case ast.BinOp(op=op) if type(op) in ARITHMETIC:
            yield "arithmetic", with_(op=ARITHMETIC[type(op)]())
        case ast.AugAssign(op=op) if type(op) in ARITHMETIC:
            yield "arithmetic", with_(op=ARITHMETIC[type(op)]())
            yield "statement", "pass"
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            yield "sign", operand
        case ast.Constant(value=bool() as value):
            yield "boolean", with_(value=not value)
        case ast.Constant(value=int() as value):
            yield "whole number", with_(value=value + 1)
        case ast.Constant(value=float() as value):
            yield "constant", with_(value=SLIP * value if value else 1.0)
        case ast.Compare(ops=[op]):
            for other in COMPARISONS[type(op)]:
                yield "comparison", with_(ops=[other()])
        case ast.BoolOp(op=op):
            yield "boolean", with_(op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.Call(args=[*_, _, _] as args):
            for i, (one, two) in enumerate(itertools.pairwise(args)):
                if ast.dump(one) != ast.dump(two) and not isinstance(two, ast.Starred):
                    yield "arguments", with_(args=[*args[:i], two, one, *args[i + 2 :]])
        case ast.Expr(value=ast.Call()):
            yield "statement", "pass"
        case ast.IfExp(body=body, orelse=orelse):
            yield "branches", with_(body=orelse, orelse=body)
        case ast.If(body=body, orelse=[*orelse]) if orelse:
            yield "branches", with_(body=orelse, orelse=body)
        case ast.If(test=test):
            yield "branches", with_(test=ast.UnaryOp(op=ast.Not(), operand=test))
        case _:
            pass
