"""Each machine's periodic orbit, or averages over motions from several starts."""

import itertools
import math
from dataclasses import dataclass, field
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from benchmarks.batch import map_scenes
from benchmarks.joints.cases import SPEED, Case
from benchmarks.joints.signature import mean_and_error, signature
from benchmarks.peers.free_bodies import PREFIXES
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.joints import before
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.motion.statistics import limits_of

# Statistics have these before a joint's name.
BEFORE = {"A": before("main"), "B": before("elbow"), "C": before("pivot")}
OF_A_JOINT = ("joint_peak", "impact_speed", "sliding_power", "penetration_ratio")
# Starts in contact, each pin off by some hundredths of its clearance (a standard deviation).
STARTS, OFFSET = 6, 0.01
SETTLE, TURNS, RTOL = 30, 30, 1e-8
# Further turns over which forces at the frame are sampled, and the samples of each.
SAMPLED, SAMPLES = 8, 4096
REACTIONS = ("bearing_reaction", "toggle_reaction")
# Twice as many nodes as usual follow the contacts' resonances too.
NODES = 192


@dataclass
class Row:
    """A machine under a load; errors are standard errors over the starts."""

    load: str
    case: Case
    how: str  # "settled" or "average"
    inside: bool  # the contact model, at every start
    values: dict[str, float]
    errors: dict[str, float] = field(default_factory=dict)
    whirls: int = 0  # of the starts


def settled(case: Case, load: str) -> tuple[Row, jc.PeriodicOrbit]:
    """Solve the orbit that keeps contact; its numbers are NaN where no stable one is found."""
    orbit = jc.periodic_orbit(jc.build_scene(case.description(load)), nodes=NODES)
    values = {name: float(orbit[name]) for name in _outputs(case)}
    values["settling_turns"] = float(orbit.settling_turns)
    if not bool(orbit.stable):
        values = dict.fromkeys(values, math.nan)
    return Row(load, case, "settled", bool(orbit.validity.inside), values), orbit


def settled_with_slopes(case: Case, load: str) -> Row:
    """Add the slopes of the RMS by each clearance (N/m), and the forces' signature."""
    row, orbit = settled(case, load)
    seen = orbit.motion(2 * np.pi * np.arange(SAMPLES) / SAMPLES, REACTIONS)
    row.values |= signature(*(np.asarray(seen[name]) for name in REACTIONS), turns=1)
    numbers = {PREFIXES[j] + "clearance": jnp.asarray(c) for j, c in case.clearances.items()}
    found = _slopes(numbers, tuple(case.description(load).items()))
    for joint in case.clearances:
        slope = float(found[PREFIXES[joint] + "clearance"])
        row.values[f"slope_{joint}"] = slope if bool(orbit.stable) else math.nan
    return row


@eqx.filter_jit
@jax.grad
def _slopes(clearances: dict[str, Any], rest: tuple[tuple[str, Any], ...]) -> Any:
    """Differentiate the steady-state RMS, N/m."""
    scene = jc.build_scene(dict(rest) | clearances)
    return jc.periodic_orbit(scene, nodes=NODES).foundation_rms


def averages(cases: list[Case], load: str, slip: str) -> list[Row]:
    """Average machines with the same joints loose over starts that soon are independent."""
    random = np.random.default_rng(0)
    scenes = [jc.build_scene(case.description(load, slip)) for case in cases]
    starts = [_nudged(scene, random) for scene in scenes for _ in range(STARTS)]
    look = eqx.Partial(_look, outputs=_outputs(cases[0]))
    results, rows = iter(map_scenes(look, starts)), []
    for case, scene in zip(cases, scenes, strict=True):
        samples, whirls = [], 0
        for values, reactions, whirl in itertools.islice(results, STARTS):
            seen = signature(*(reactions[name] for name in REACTIONS), turns=SAMPLED)
            samples.append(values | seen)
            whirls += bool(whirl)
        both = {name: mean_and_error(np.array([s[name] for s in samples])) for name in samples[0]}
        limits = [limits_of(scene, jax.tree.map(jnp.asarray, sample)) for sample in samples]
        rows.append(
            Row(
                load,
                case,
                "average",
                all(bool(one.inside) for one in limits),
                {name: mean for name, (mean, _) in both.items()},
                {name: error for name, (_, error) in both.items()},
                whirls,
            )
        )
    return rows


def _outputs(case: Case) -> tuple[str, ...]:
    of_joints = [BEFORE[joint] + name for joint in case.clearances for name in OF_A_JOINT]
    limits = ("penetration_ratio", "impact_speed")
    return tuple(dict.fromkeys(("foundation_rms", "foundation_peak", *limits, *of_joints)))


def _look(scene: jc.Scene, outputs: tuple[str, ...]) -> tuple[Any, Any, Any]:
    """Return statistics after settling, forces at the frame in further turns, whether A whirls."""
    further = ("contact_fraction", "winding")
    seen = jc.statistics(scene, SETTLE, TURNS, outputs=(*outputs, *further), rtol=RTOL)
    times = 2 * np.pi / SPEED * np.arange(SAMPLED * SAMPLES) / SAMPLES
    motion = jc.simulate(scene, times, outputs=REACTIONS, state=seen.state, rtol=RTOL)
    values = {name: seen[name] for name in outputs}
    return values, {name: motion[name] for name in REACTIONS}, seen.whirl


def _nudged(scene: jc.Scene, random: np.random.Generator) -> jc.Scene:
    """Return the scene with a start a little off its own."""
    assert scene.start is not None
    e, rates = scene.start.eccentricities(scene)

    def off(joint: Any, at: Vector) -> Vector:
        return at / joint.clearance + Vector(*OFFSET * random.standard_normal(2))

    start = Given(scene.joints.map(off, e), rates)
    return eqx.tree_at(lambda scene: scene.start, scene, start)
