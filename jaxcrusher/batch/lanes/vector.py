"""Functions of lanes: the same instructions for all, so that the bits of each are its own."""

from collections.abc import Callable
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from jaxcrusher.batch.lanes.expression import (
    DOUBLE,
    INTEGER,
    POINTER,
    Expression,
    Function,
    kind_of,
)


class Shape(NamedTuple):
    """How many lanes there are."""

    lanes: int  # in a row of their memory
    width: int  # in an instruction
    own: int  # of a thread


# Of a processor's cores. What one instruction does not hold LLVM splits in two or four, whose
# chains of instructions run side by side: twice what AVX2 holds, and once or twice what others do.
CORES = Shape(16, 16 if llvm.get_host_cpu_features().get("avx512f") else 8, 16)
# Of a GPU's warps: each thread has a lane, and what they read at once stands side by side.
WARPS = Shape(32, 1, 1)
LANES, WIDTH = CORES.lanes, CORES.width


class Module(ir.Module):
    """Functions of lanes of one shape."""

    def __init__(self, shape: Shape = CORES) -> None:
        super().__init__("lanes")
        self.shape = shape


class Code(Function):
    """A function as it is written, for as many lanes at a time as an instruction has.

    Its operands are the memory of the lanes, in which row r stands at [r * lanes], the first lane,
    and as many rows as it has names for.
    """

    def __init__(self, module: Module, name: str, rows: int = 0) -> None:
        super().__init__(module, name, [POINTER, INTEGER, *[INTEGER] * rows])
        self.shape, self.floats = module.shape, ir.VectorType(DOUBLE, module.shape.width)
        self.memory, self.first, *self.rows = self.function.args

    def vector(self, value: Any) -> Expression:
        """A number as a vector of its kind; vectors remain."""
        kind = ir.VectorType(kind_of(value), self.shape.width)
        return Expression(self, ir.Constant(kind, 0)).like(value)

    def _place(self, row: Any, lane: ir.Value | None = None) -> Any:
        lanes = self.builder.mul(self.row(row), ir.Constant(INTEGER, self.shape.lanes))
        index = self.builder.add(lanes, self.first if lane is None else lane)
        return self.builder.gep(self.memory, [index], source_etype=DOUBLE)

    def row(self, row: Any, more: int = 0) -> Any:
        """The number of a row, `more` after another one."""
        if not isinstance(row, ir.Value):
            return ir.Constant(INTEGER, row + more)
        return self.builder.add(row, ir.Constant(INTEGER, more))

    def read(self, row: Any, more: int = 0) -> Expression:
        """A row of the memory."""
        place = self._place(self.row(row, more))
        return Expression(self, self.builder.load(place, align=8, typ=self.floats))

    def write(self, value: Any, row: Any, more: int = 0) -> None:
        """Keep a value in a row of the memory, from the first lane on."""
        self.builder.store(self.vector(value).value, self._place(self.row(row, more)), align=8)

    def write_from(self, value: Any, row: Any, place: int) -> None:
        """Keep a value from a place of a row on, and from the first lane."""
        lane = self.builder.add(self.first, ir.Constant(INTEGER, place))
        self.builder.store(self.vector(value).value, self._place(row, lane), align=8)

    def write_number(self, value: Any, row: Any, place: int) -> None:
        """Keep what is the same in all lanes, as one number at a place of a row."""
        at = self._place(row, ir.Constant(INTEGER, place))
        self.builder.store(self.lane(value), at, align=8)

    def scalar(self, row: Any, place: Any = 0) -> Expression:
        """The number at a place of a row, and of those that follow it, in all lanes.

        A place is a whole number, or the same one in all lanes.
        """
        place = self._place(row, self.lane(np.int64(place) if isinstance(place, int) else place))
        return self.alike(self.builder.load(place, align=8, typ=DOUBLE))

    def alike(self, number: Any) -> Expression:
        """A number in all lanes."""
        first, kind = ir.Constant(ir.IntType(32), 0), ir.VectorType(number.type, self.shape.width)
        one = self.builder.insert_element(ir.Constant(kind, ir.Undefined), number, first)
        everywhere = ir.Constant(
            ir.VectorType(ir.IntType(32), self.shape.width), [0] * self.shape.width
        )
        return Expression(self, self.builder.shuffle_vector(one, one, everywhere))

    def lane(self, value: Any, lane: int = 0) -> Any:
        """The number of one lane."""
        place = ir.Constant(ir.IntType(32), lane)
        return self.builder.extract_element(self.vector(value).value, place)

    def positions(self) -> Expression:
        """The first lane and those that follow it, as doubles."""
        first = self.alike(self.builder.sitofp(self.first, DOUBLE))
        return first + Expression(
            self, ir.Constant(self.floats, [float(i) for i in range(self.shape.width)])
        )

    def loop(
        self, count: int, start: list, body: Callable[[list[Expression]], list[Expression]]
    ) -> list:
        """Run `body` for the first of `count` lanes, and every a vector more.

        It is given what it gave back the last time, at first `start`; the last is the result.
        """
        builder, outside, before = self.builder, self.first, self.builder.block
        inside, after = (self.function.append_basic_block() for _ in range(2))
        builder.branch(inside)
        builder.position_at_end(inside)
        self.first = builder.phi(INTEGER)
        self.first.add_incoming(ir.Constant(INTEGER, 0), before)
        given = [self.vector(value).value for value in start]
        carried = [builder.phi(value.type) for value in given]
        for phi, value in zip(carried, given, strict=True):
            phi.add_incoming(value, before)
        results = body([Expression(self, phi) for phi in carried])
        following = builder.add(self.first, ir.Constant(INTEGER, self.shape.width))
        self.first.add_incoming(following, builder.block)
        for phi, result in zip(carried, results, strict=True):
            phi.add_incoming(result.value, builder.block)
        more = builder.icmp_signed("<", following, ir.Constant(INTEGER, count))
        builder.cbranch(more, inside, after)
        builder.position_at_end(after)
        self.first = outside
        return results

    def run(self, other: "Code", *rows: Any) -> None:
        """Call another function for the same lanes."""
        numbers = map(self.row, rows)
        self.builder.call(other.function, [self.memory, self.first, *numbers])
