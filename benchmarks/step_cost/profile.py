"""The costly operations of a step of the compiled program, counted in XLA's own text.

XLA joins operations to fusions, and a value that several fusions need may be computed in each. So
the count of an evaluation of the equations is compared with that of the equations as traced, and
with the count by hand.
"""

import re
from collections import Counter

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.interpreters.partial_eval import dce_jaxpr

import jaxcrusher as jc
from benchmarks.step_cost.programs import Designs, statistics_of
from benchmarks.timing import timed
from jaxcrusher.crusher.observables import foundation_force
from jaxcrusher.motion.flow import Flow
from jaxcrusher.motion.statistic import chosen
from jaxcrusher.motion.statistics import statistics_problem

EVALUATIONS = 100_000
COSTLY = ("sine", "cosine", "power", "sqrt", "divide", "multiply", "add", "subtract", "select")
# JAX's names of the same operations.
_TRACED = {
    "sin": "sine",
    "cos": "cosine",
    "pow": "power",
    "sqrt": "sqrt",
    "div": "divide",
    "mul": "multiply",
    "add": "add",
    "add_any": "add",
    "sub": "subtract",
    "select_n": "select",
}
# One evaluation needs: the crank's sine and cosine; delta^1.5, B's height, |e|, |R_O| and
# |R_C| by square roots; reciprocals of |A|^2, the lever, |e| and the determinant. Divisions by
# numbers of the design are done once, before the loop.
BY_HAND = {"sine": 1, "cosine": 1, "power": 0, "sqrt": 5, "divide": 4}


def counts(d: Designs) -> dict[str, Counter]:
    """Count operations of an evaluation as traced, of a compiled stage, and of a step's rest.

    The loop over stages is told by its sines: it alone evaluates the equations of motion.
    """
    numbers, rest = eqx.partition(d.scenes, eqx.is_array)

    def run(numbers):
        def one(part):
            return statistics_of(eqx.combine(part, rest), d.turns)

        return jax.lax.map(one, numbers)

    text = jax.jit(run).lower(numbers).compile().as_text() or ""
    called = _computations(text)
    owner = {
        inner: name for name, lines in called.items() for _, others in lines for inner in others
    }
    bodies = {
        inner
        for lines in called.values()
        for operation, others in lines
        for inner in others
        if operation == "while"
    }
    stage = max(bodies, key=lambda name: _inside(name, called)["sine"])
    step = owner[stage]
    while step not in bodies:
        step = owner[step]
    return {
        "equations as traced": _traced(jax.tree.map(lambda leaf: leaf[0], numbers), rest),
        "a compiled stage": _inside(stage, called),
        "a step besides its stages": _inside(step, called),
    }


def _computations(text: str) -> dict[str, list[tuple[str, list[str]]]]:
    """Return each computation's operations, with the computations that they call."""
    called: dict[str, list[tuple[str, list[str]]]] = {}
    name = ""
    for line in text.splitlines():
        header = re.match(r"(?:ENTRY )?%?([\w.\-]+) .*\{$", line)
        if header:
            name = header[1]
            called[name] = []
            continue
        operation = re.search(r" = (?:\(.*?\)|\S+) ([a-z][\w\-]*)\(", line)
        if operation:
            inner = re.findall(r"(?:calls|to_apply|body)=%?([\w.\-]+)", line)
            for branches in re.findall(r"branch_computations=\{(.*?)\}", line):
                inner += branches.replace("%", "").split(", ")
            called[name].append((operation[1], inner))
    return called


def _inside(name: str, called: dict[str, list]) -> Counter:
    """Count operations of a computation and of those it calls, without the loops inside."""
    total: Counter = Counter()
    for operation, inner in called[name]:
        if operation == "while":
            continue
        total[operation] += 1
        for other in inner:
            total += _inside(other, called)
    return total


def evaluation(d: Designs) -> float:
    """Return CPU nanoseconds of one evaluation of the equations, in a loop of its own."""
    numbers, rest = eqx.partition(jax.tree.map(lambda leaf: leaf[0], d.scenes), eqx.is_array)
    problem = statistics_problem(chosen(("foundation_rms",)))

    @jax.jit
    def run(numbers):
        flow = Flow(eqx.combine(numbers, rest))

        def body(_, carry):
            angle, y = carry
            rate = problem.field(angle, y, flow)
            return angle + 1e-9, jax.tree.map(lambda leaf, dot: leaf + 1e-12 * dot, y, rate)

        return jax.lax.fori_loop(0, EVALUATIONS, body, (0.0, problem.initial(flow)))

    return 1e9 * timed(lambda: run(numbers)).again.cpu / EVALUATIONS


def _traced(numbers, rest) -> Counter:
    """Count operations of one evaluation as JAX traces it."""
    scene: jc.Scene = eqx.combine(numbers, rest)
    state = scene.formulation.initial(scene)

    def field(numbers, state):
        scene = eqx.combine(numbers, rest)
        snapshot = scene.formulation.snapshot(jnp.array(0.1), state, scene)
        rate = scene.formulation.rate(snapshot, state, scene)
        return rate, foundation_force(snapshot, scene) ** 2

    jaxpr = jax.make_jaxpr(field)(numbers, state).jaxpr
    return _needed(dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars))[0])


def _needed(jaxpr) -> Counter:
    """Count the equations of a traced program and of its inner ones."""
    total: Counter = Counter()
    for equation in jaxpr.eqns:
        inner = equation.params.get("jaxpr")
        if inner is None:
            name = equation.primitive.name
            total[_TRACED.get(name, name)] += 1
        else:
            total += _needed(getattr(inner, "jaxpr", inner))
    return total
