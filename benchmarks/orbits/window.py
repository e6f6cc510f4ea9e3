"""The branch of the loud orbit beside the quiet one, and the branch that it was born from."""

from collections.abc import Callable

import jaxcrusher as jc

# Where the motion of two turns is found, beside the quiet one; and that of one turn it doubled.
SPEED, CLEARANCE = 40.0, 0.12e-3
PARENT = {"speed": 40.15, "clearance": 0.1212e-3}
# Of a motion that keeps contact, with impacts on a thin film of depth.
NODES = 384
# Name -> unit, its size in SI units, and what a change is small against.
UNITS = {"speed": ("rad/s", 1.0, 1.0), "clearance": ("mm", 1e-3, 3e-6)}
BOUNDS = {"speed": (39.0, 41.0), "clearance": (0.116e-3, 0.125e-3)}


def run() -> None:
    """Compute and print."""
    loud = loudest(jc.paper_scene(SPEED, CLEARANCE), 2)
    for name in UNITS:
        at = {"speed": SPEED, "clearance": CLEARANCE}

        def scene(value, name=name, at=at):
            return jc.build_scene({**at, name: value})

        for upwards in (False, True):
            # Downwards it is unstable and long.
            show(name, follow(scene, name, at[name], loud, upwards, 16 if upwards else 80))
        parent = loudest(scene(PARENT[name]), 1)
        show(name, follow(scene, name, PARENT[name], parent, True, 40))


def loudest(scene: jc.Scene, period: int) -> jc.PeriodicOrbit:
    """Return the loudest of the stable orbits of so many turns."""
    found = jc.coexisting_orbits(scene, starts=16, turns=400).orbits
    return max((one for one in found if one.period == period), key=lambda o: o.foundation_rms)


def follow(
    scene: Callable, name: str, start: float, orbit: jc.PeriodicOrbit, upwards: bool, points: int
) -> jc.OrbitBranch:
    """Follow a branch from an orbit, by shooting if that loses contact, else by collocation."""
    return jc.orbit_branch(
        scene,
        start,
        BOUNDS[name],
        upwards=upwards,
        scale=UNITS[name][2],
        period=orbit.period,
        points=points,
        nodes=NODES,
        guess=orbit,
    )


def show(name: str, branch: jc.OrbitBranch) -> None:
    """Print its points, and where it changes."""
    unit, size, _ = UNITS[name]
    print(
        f"{name}, {branch.table.period} turns: {unit}, RMS N, least penetration, largest multiplier"
    )
    for i in range(len(branch.orbits)):
        at = branch.table.isel(point=i)
        print(f"  {float(at.parameter) / size:.6f} {float(at.foundation_rms):.2f}", end=" ")
        print(f"{float(at.least_penetration):.4f} {float(at.largest_multiplier):.4f}")
    for event in branch.events:
        print(f"  {event.kind} at {event.parameter / size:.7f} {unit}")
    print(f"  {branch.ended}", flush=True)
