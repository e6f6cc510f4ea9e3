"""A tracked impact velocity against a program that stops at each touch-down and reads it there."""

import tomllib
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from scipy.integrate import solve_ivp

import jaxcrusher as jc
from jaxcrusher.joint.normal import ConstantImpactVelocity, TrackedImpactVelocity
from tests.pairs import slow

EXAMPLES = Path(__file__).parents[2] / "examples"
FLOOR = 0.01


def with_law(scene, law):
    """The scene whose loose joints all have this impact velocity."""

    def laws(scene):
        return [joint.normal.impact_velocity for joint in scene.joints.values]

    return eqx.tree_at(laws, scene, [law] * len(scene.joints))


def located(scene, times):
    """Penetrations and normal forces of all joints at `times`, by DOP853 from touch to touch.

    Each joint has a constant impact velocity: the approach at which its pin last touched its bore.
    """
    scene = with_law(scene, ConstantImpactVelocity(1.0))
    start, unravel = ravel_pytree(scene.formulation.initial(scene))

    @jax.jit
    def look(time, y, speeds):
        def held(scene):
            return [joint.normal.impact_velocity.speed for joint in scene.joints.values]

        with_speeds = eqx.tree_at(held, scene, list(speeds))
        snapshot = scene.formulation.snapshot(time, unravel(y), with_speeds)
        rate = scene.formulation.rate(snapshot, unravel(y), with_speeds)
        contacts = snapshot.contacts.values
        parts = (
            [one.penetration for one in contacts],
            [one.penetration_rate for one in contacts],
            [one.normal_force for one in contacts],
        )
        return ravel_pytree(rate)[0], *map(jnp.stack, parts)

    count = len(scene.joints)
    # At the depth at which the law's corner ends nothing has been changed by the memory yet.
    corner = -1e-8
    touches = [lambda t, y, s, i=i: float(look(t, y, s)[1][i]) - corner for i in range(count)]
    for touch in touches:
        touch.terminal, touch.direction = True, 1
    now, y, speeds, rows = 0.0, np.asarray(start), np.full(count, FLOOR), []
    while len(rows) < len(times):
        known = jnp.asarray(speeds)
        found = solve_ivp(
            lambda t, y, s: np.asarray(look(t, y, s)[0]),
            (now, times[-1]),
            y,
            "DOP853",
            dense_output=True,
            events=touches,
            args=(known,),
            rtol=1e-10,
            atol=1e-12,
            max_step=2e-5,
        )
        last = int(np.searchsorted(times, found.t[-1], side="right"))
        for time in times[len(rows) : last]:
            _, depth, _, force = look(time, found.sol(time), known)
            rows.append(np.concatenate([depth, force]))
        now, y = found.t[-1], found.y[:, -1]
        for i, events in enumerate(found.t_events):
            if len(events):
                speeds[i] = max(float(look(now, y, known)[2][i]), FLOOR)
        # Past the event, which would be found again.
        y = y + 1e-12 * np.asarray(look(now, y, known)[0])
        now += 1e-12
    depth, force = np.split(np.array(rows), 2, axis=1)
    return depth, force


def peaks(depth, force):
    """When each impact of a joint begins that is over, in instants, and its largest force."""
    touching = np.diff((depth > 0).astype(int), prepend=0)
    begins, ends = np.flatnonzero(touching > 0), np.flatnonzero(touching < 0)
    return [(begin, force[begin:end].max()) for begin, end in zip(begins, ends, strict=False)]


def example(name, *loose):
    """An example from the centre of its bores; further joints get the bore and the law of B."""
    drawn = tomllib.loads((EXAMPLES / f"{name}.toml").read_text())
    joints = drawn["joints"]
    of_bore = {key: joints["B"][key] for key in joints["B"].keys() - {"bore", "pin"}}
    for joint in loose:
        joints[joint] |= of_bore
    return jc.linkage(**{k: v for k, v in drawn.items() if k != "kind"} | {"start": "centred"})


# A scene, and how long it is looked at, s.
CASES = {
    "slider-crank": (lambda: example("slider_crank"), 3e-3),
    "slider-crank, A too": (lambda: example("slider_crank", "A"), 1.5e-3),
    "four-bar": (lambda: example("four_bar"), 0.03),
    "four-bar, A too": (lambda: example("four_bar", "A"), 0.02),
    "crusher, B too": (
        lambda: jc.build_scene({"elbow.clearance": 6e-5, "restitution": 0.7}),
        0.02,
    ),
}
QUICK = "slider-crank, A too"


@pytest.mark.parametrize("name", [QUICK, *slow(*(name for name in CASES if name != QUICK))])
def test_peaks_of_impacts_are_those_of_located_touch_downs(name):
    make, end = CASES[name]
    scene, times = make(), np.linspace(0, end, 6001)
    depths, forces = located(scene, times)
    scene = with_law(scene, TrackedImpactVelocity(FLOOR))
    expected, seen = [], []
    for joint, depth, force in zip(scene.joints.names, depths.T, forces.T, strict=True):
        names = tuple(scene.prefix(joint) + of for of in ("penetration_ratio", "normal_force"))
        found = jc.simulate(scene, times, outputs=names, rtol=1e-10)
        assert bool(found.success), found.failure
        expected += peaks(depth, force)
        seen += peaks(*(np.asarray(found[name]) for name in names))
    # In the order of time; errors grow three times and more from one impact to the next.
    first = sorted(expected)[:8]
    assert len(first) == 8
    # A slow one has the error of faster ones before it: 1e-3 of the largest force so far.
    largest = 0.0
    for (time, peak), (when, size) in zip(first, sorted(seen), strict=False):
        largest = max(largest, peak)
        close = pytest.approx(peak, rel=5e-3, abs=1e-3 * largest)
        assert abs(when - time) <= 10 and size == close
