"""Random programs of all primitives and types that lanes know, against JAX."""

from math import prod
from random import Random

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.lanes.code import LANES, Code, Module
from jaxcrusher.lanes.equations import Atom, Emitter
from jaxcrusher.lanes.primitives import ALONG_AXES, ELEMENTWISE, type_of
from jaxcrusher.lanes.verify import verified
from tests.lanes.rows import run

pytestmark = pytest.mark.usefixtures("promoting")

# A time, two states, and three numbers of the design.
TYPES = {"t": float, "x": float, "y": float, "p": float, "n": int, "b": bool}
# Programs in a module, and the modules' seeds, which together meet all primitives: a module costs a
# second to compile.
PROGRAMS, SEEDS = 120, (0, 1, 6)
POINTS = 8 * LANES
# Sums and products that fit into a double are exact in any order, so that what is compared or cast
# is the same number in lanes and in JAX. An expression is (text, digits before the point, behind).
DIGITS = 50
LEAVES = {
    "f": [(name, 4, 2) for name in "txyp"] + [("quarter", 0, 2), ("three", 2, 0)],
    "i": [("n", 3, 0), ("two", 2, 0)],
    "k": [("seven", 3, 0)],
    "b": [("b", 1, 0), ("(t > x)", 1, 0)],
}
FUNCTIONS = """
jnp.tanh jnp.exp jnp.expm1 jnp.log jnp.log1p jnp.sqrt lax.rsqrt
jnp.arctan jnp.arcsin jax.nn.sigmoid jax.nn.softplus jnp.reciprocal
""".split()
OF_ANGLES = ["jnp.sin", "jnp.cos", "jnp.tan"]

# What is made of which types; {0} to {2} stand for operands. The digits of the result: "sum",
# "product", those of the "largest", none behind the point ("whole"), or as many as there are
# ("full"). Whole numbers are divided by n, which is 0 and -1 too. Where XLA finds two constants,
# such as a - a, it divides by zero itself and ends the process.
EXACT = {
    "f": [
        ("({0} + {1})", "ff", "sum"),
        ("({0} - {1})", "ff", "sum"),
        ("({0} * {1})", "ff", "product"),
        ("jnp.square({0})", "f", "square"),
        ("({0}) ** 3", "f", "cube"),
        ("(-{0})", "f", "largest"),
        ("jnp.abs({0})", "f", "largest"),
        ("jnp.sign({0})", "f", "whole"),
        ("jnp.floor({0})", "f", "whole"),
        ("jnp.ceil({0})", "f", "whole"),
        ("jnp.round({0})", "f", "whole"),
        ("lax.round({0})", "f", "whole"),
        ("jnp.maximum({0}, {1})", "ff", "largest"),
        ("jnp.minimum({0}, {1})", "ff", "largest"),
        ("lax.clamp({0}, {1}, {2})", "fff", "largest"),
        ("lax.rem({0}, {1})", "ff", "quotient"),
        ("jnp.where({0}, {1}, {2})", "bff", "largest"),
        ("jnp.select([{0}, {1}], [{2}, {3}], 0.5)", "bbff", "largest"),
        ("lax.select_n({0} % 3, {1}, {2}, {3})", "Ifff", "largest"),
        ("jnp.stack([{0}, {1}, {2}]).max(0)", "fff", "largest"),
        ("jnp.stack([{0}, {1}, {2}]).min(0)", "fff", "largest"),
        ("jnp.stack([{0}, {1}]).sum(0)", "ff", "sum"),
        ("jnp.stack([{0}, {1}])[1]", "ff", "largest"),
        ("jnp.concatenate([{0}[None], {1}[None]])[::2][0]", "FF", "largest"),
        ("({0}).astype(float)", "i", "largest"),
        ("({0}).astype(float)", "k", "largest"),
        ("({0}).astype(float)", "b", "whole"),
        ("jax.jit(lambda a: {1})({0})", "fj", "inner"),
        ("jax.checkpoint(lambda a: {1})({0})", "fj", "inner"),
    ],
    "i": [
        ("({0}).astype(int)", "f", "full"),
        ("({0}).astype(int)", "k", "largest"),
        ("({0}).astype(int)", "b", "whole"),
        ("({0} + {1})", "ii", "full"),
        ("({0} - {1})", "ii", "full"),
        ("({0} * {1})", "ii", "full"),
        ("(-{0})", "i", "full"),
        ("jnp.abs({0})", "i", "full"),
        ("jnp.sign({0})", "i", "whole"),
        ("({0} // n)", "i", "full"),
        ("({0} % n)", "i", "full"),
        ("lax.div({0}, n)", "i", "full"),
        ("lax.rem({0}, n)", "i", "full"),
        ("({0}) ** 3", "i", "full"),
        ("({0} & {1})", "ii", "full"),
        ("({0} | {1})", "ii", "full"),
        ("({0} ^ {1})", "ii", "full"),
        ("(~{0})", "i", "full"),
        ("jnp.maximum({0}, {1})", "ii", "largest"),
        ("lax.clamp({0}, {1}, {2})", "iii", "largest"),
        ("jnp.where({0}, {1}, {2})", "bii", "largest"),
        ("jnp.stack([{0}, {1}, {2}]).argmax(0)", "fff", "whole"),
        ("jnp.stack([{0}, {1}]).sum(0)", "ii", "full"),
    ],
    "k": [
        ("({0}).astype(jnp.int32)", "f", "full"),
        ("({0}).astype(jnp.int32)", "i", "full"),
        ("({0}).astype(jnp.int32)", "b", "whole"),
        ("({0} + {1})", "kk", "full"),
        ("({0} * {1})", "kk", "full"),
        ("(-{0})", "k", "full"),
        ("lax.div({0}, n.astype(jnp.int32))", "k", "full"),
        ("({0} % n.astype(jnp.int32))", "k", "full"),
        ("jnp.where({0}, {1}, {2})", "bkk", "largest"),
    ],
    "b": [
        *(
            (f"({{0}} {symbol} {{1}})", kinds, "whole")
            for symbol in ("<", "<=", ">", ">=", "==", "!=")
            for kinds in ("ff", "ii", "kk", "bb")
        ),
        ("({0} & {1})", "bb", "whole"),
        ("({0} | {1})", "bb", "whole"),
        ("({0} ^ {1})", "bb", "whole"),
        ("(~{0})", "b", "whole"),
        ("jnp.isfinite({0})", "f", "whole"),
        ("({0}).astype(bool)", "f", "whole"),
        ("({0}).astype(bool)", "i", "whole"),
        ("jnp.where({0}, {1}, {2})", "bbb", "whole"),
        ("jnp.maximum({0}, {1})", "bb", "whole"),
        ("jnp.stack([{0}, {1}]).any(0)", "bb", "whole"),
        ("jnp.stack([{0}, {1}]).all(0)", "bb", "whole"),
    ],
}


def _digits(rule, operands):
    """Digits before and behind the point of a result, or None if there are too many."""
    before, behind = (max(part) for part in list(zip(*operands, strict=True))[1:])
    if rule == "inner":
        return operands[1][1:]
    if rule == "quotient":
        return (before, behind) if before + behind <= DIGITS else None
    times = {"product": len(operands), "square": 2, "cube": 3}.get(rule)
    if times is not None:
        several = [sum(part) for part in list(zip(*operands, strict=True))[1:]]
        before, behind = several if rule == "product" else (times * before, times * behind)
    before += rule == "sum"
    before, behind = {"full": (64, 0), "whole": (before + 1, 0)}.get(rule, (before, behind))
    fits = rule not in ("sum", "product", "square", "cube") or before + behind <= DIGITS
    return (before, behind) if fits else None


def _exact(random, kind, depth, leaves):
    """An expression of a type."""
    known_leaves = leaves.get(kind.lower(), [])
    if kind == "F":
        return next(leaf for leaf in leaves["f"] if leaf[0] in "xya")
    if kind == "I":
        text, *_ = _exact(random, "i", depth, leaves)
        return f"(({text}) & 63)", 6, 0
    if depth == 0 and known_leaves:
        return random.choice(known_leaves)
    text, kinds, rule = random.choice(EXACT[kind])
    operands = []
    for one in kinds:
        inner = {**LEAVES, "f": [("a", *operands[0][1:])]} if one == "j" else leaves
        one = "f" if one == "j" else one
        operands.append(_exact(random, one, max(depth - 1, 0), inner))
    digits = _digits(rule, operands)
    # From JAX 0.12 on XLA takes n / n for 1, also where n is 0.
    undefined = text.endswith("n)") and operands[0][0] == "n"
    if digits is None or undefined:
        return random.choice(known_leaves)
    return text.format(*(operand[0] for operand in operands)), *digits


def _programs(random):
    """Texts of programs, and whether each is exact."""
    programs = []
    for _ in range(PROGRAMS):
        kind = random.choice("ffiikbss")
        if kind != "s":
            text, *_ = _exact(random, kind, 3, LEAVES)
            programs.append((f"({text}).astype(float)", True))
            continue
        (one, before, _), (other, *_) = (_exact(random, "f", 2, LEAVES) for _ in range(2))
        texts = [f"{name}({one})" for name in FUNCTIONS]
        texts += [f"({one}) / ({other})", f"jnp.arctan2({one}, {other})", f"({one}) ** ({other})"]
        texts += [f"({one}) ** 2.5", f"({one}) ** -2", f"({one}) / p", f"({one}) ** n"]
        texts += [f"{name}({one})" for name in OF_ANGLES] if before < 30 else []
        programs.append((random.choice(texts), False))
    return programs


CONSTANTS = {
    "quarter": np.float64(0.25),
    "three": np.float64(3),
    "two": np.int64(2),
    "seven": np.int32(7),
}


def _function(texts, shape=()):
    """A function of numbers, or of arrays of this shape."""
    constants = {name: jnp.full(shape, value) for name, value in CONSTANTS.items()}
    names = {"jax": jax, "jnp": jnp, "lax": jax.lax, **constants}
    made = [eval(f"lambda {', '.join(TYPES)}: {text}", names) for text in texts]
    return lambda *operands: [function(*operands) for function in made]


def _in_lanes(function, columns):
    """The results in lanes, and the names of the primitives."""
    module = Module()
    prepare, body = Code(module, "prepare"), Code(module, "body")
    program = verified(jax.make_jaxpr(function)(*(jnp.zeros((), kind) for kind in TYPES.values())))
    results, operands = sum(map(prod, program.shapes)), len(columns)
    emitter = Emitter(prepare, operands + results)
    states = [Atom(body.read(i)) for i in range(3)]
    kinds = map(type_of, program.operands[3:])
    numbers = [emitter.given(3 + i, kind) for i, kind in enumerate(kinds)]
    for i, value in enumerate(emitter.body(body, program, [*states, *numbers]), operands):
        body.write(value, i)
    emitter.keep()
    rows = [c.view(float) if c.dtype == int else c.astype(float) for c in columns]
    names = {equation.primitive.name for equation in program.equations}
    return run(module, [prepare, body], results, *rows, spare=2000), names


def _columns():
    random = np.random.default_rng(5)
    columns = list(random.integers(-32, 33, (4, POINTS)) / 4)
    special = [0.0, -0.0, np.nan, np.inf, -np.inf, 1.0, -1.0, 0.5]
    for column in columns[1:]:
        column[: POINTS // 2] = random.choice(special, POINTS // 2)
    return [*columns, random.integers(-5, 6, POINTS), random.random(POINTS) < 0.5]


def _by_jax(function, columns):
    # As it simplifies, XLA makes max(min(a, b), c) wrong, and zero times infinity zero.
    compiled = jax.jit(function, compiler_options={"xla_disable_hlo_passes": "algsimp"})
    return np.array(compiled(*columns))


def _compared(seed):
    """Compare the programs of a seed, and return which primitives lanes met."""
    programs = _programs(Random(seed))
    columns = _columns()
    texts = [text for text, _ in programs]
    found, names = _in_lanes(_function(texts), columns)
    expected = _by_jax(_function(texts, POINTS), columns)
    for (text, exact), ours, theirs in zip(programs, found, expected, strict=True):
        # Lanes are right to 2 ulp; XLA rounds the exponent of 2^x, which is up to 1000.
        rtol, atol = (0, 0) if exact else (2e-13, 1e-307)
        np.testing.assert_allclose(ours, theirs, rtol=rtol, atol=atol, err_msg=text)
    return names


def test_random_programs_agree_with_jax():
    _compared(SEEDS[0])


@pytest.mark.slow
def test_more_random_programs_meet_all_primitives():
    seen = set().union(*map(_compared, SEEDS))
    # `add_any` comes of derivatives only.
    assert {*ELEMENTWISE, *ALONG_AXES} - seen == {"add_any"}
