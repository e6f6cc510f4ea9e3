"""Instructions of the processor that numba has no name for, and how functions are compiled."""

from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

# Of functions that only compiled ones call: without what Python would need to call them, and
# without counts of references to arrays, which outlive every call. That halves the time to compile.
WITHIN: dict[str, Any] = {
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "no_rewrites": True,
}
# For type checkers: what it makes is called without its first operand.
instruction = cast(Callable[[Callable], Any], intrinsic)


@instruction
def bits(typingctx, x):
    """The 64 bits of a double as an integer."""

    def code(context, builder, signature, args):
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), code


@instruction
def double(typingctx, bits):
    """The double of 64 bits."""

    def code(context, builder, signature, args):
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.int64), code


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
