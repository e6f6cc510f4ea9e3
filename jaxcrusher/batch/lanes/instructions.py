"""Instructions of the processor that numba has no name for."""

from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

# For type checkers: what it makes is called without its first operand.
instruction = cast(Callable[[Callable], Any], intrinsic)


@instruction
def call(typingctx, address, memory, row):
    """Call a function of `kernels` with the lanes' memory, an array, and a row."""

    def code(context, builder, signature, args):
        array = context.make_array(signature.args[1])(context, builder, args[1])
        integer = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [array.data.type, integer])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, [array.data, args[2]])
        return context.get_dummy_value()

    return types.void(types.int64, memory, types.int64), code


@instruction
def take(typingctx, counter):
    """The next number of `counter`, an int64 array of shape (1,); no two threads get the same."""

    def code(context, builder, signature, args):
        array = context.make_array(signature.args[0])(context, builder, args[0])
        place = cgutils.get_item_pointer(
            context, builder, signature.args[0], array, [ir.Constant(ir.IntType(64), 0)]
        )
        return builder.atomic_rmw("add", place, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(counter), code
