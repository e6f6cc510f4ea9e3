"""Evidence on chosen designs: long runs, histories of a turn, and what their force is made of."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from jaxcrusher.batch.engines import run_all, stack
from jaxcrusher.joint.validity import Validity
from optimize.design import Design
from optimize.evaluate import STARTS, started
from optimize.forces import FORCES

AS_IT_IS, STANDING = "as it is", "at 1 rad/s: weight and load alone"
CONFIRM_RTOL = 1e-9
# Instants of a turn in a history: a mean over a period is then right to rounding.
POINTS = 720
HISTORIES = (
    "foundation_force",
    "net_foundation_force",
    "shaking_force",
    "bearing_reaction",
    "toggle_reaction",
    "drive_power",
    "jaw_position",
)


def confirm(design: Design, points: Mapping[str, np.ndarray], settle: int) -> dict[str, dict]:
    """Statistics of long runs of each design, `settle` turns after as many, from both starts."""
    scenes = [
        started(design.description(point), start) for point in points.values() for start in STARTS
    ]
    function = eqx.Partial(_long_run, turns=settle)
    rows = run_all(function, stack(scenes), len(scenes))
    found: dict[str, dict] = {name: {} for name in points}
    for i, (name, start) in enumerate((name, start) for name in points for start in STARTS):
        found[name][start] = jax.tree.map(lambda values, i=i: values[i].item(), rows)
    return found


def _long_run(scene: jc.Scene, turns: int) -> dict[str, Any]:
    result = jc.statistics(scene, turns, turns, rtol=CONFIRM_RTOL)
    names = (*jc.STATISTICS, "foundation_rms_error", "whirl", "success")
    limits = {field.name: getattr(result.validity, field.name) for field in fields(Validity)}
    return {name: getattr(result, name) for name in names} | {"validity": limits}


def histories(design: Design, points: Mapping[str, np.ndarray], settle: int) -> dict[str, dict]:
    """One turn of each design in quiet motion after `settle` turns; arrays over (POINTS, ...)."""
    scenes = stack([design.scene(point) for point in points.values()])
    function = eqx.Partial(_one_turn, settle=settle)
    rows = run_all(function, scenes, len(points))
    return {name: {key: values[i] for key, values in rows.items()} for i, name in enumerate(points)}


def _one_turn(scene: jc.Scene, settle: int) -> dict[str, Any]:
    times = 2 * jnp.pi / scene.drive.speed * (settle + jnp.arange(1, POINTS + 1) / POINTS)
    motion = jc.simulate(scene, times, outputs=HISTORIES, rtol=CONFIRM_RTOL)
    return {name: getattr(motion, name) for name in HISTORIES}


def figures(history: Mapping[str, np.ndarray]) -> dict[str, float]:
    """RMS of forces (N) and of power (W), and the travel of B (m), over a turn."""

    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum(values.reshape(POINTS, -1) ** 2, axis=1))))

    forces = history["foundation_force"]
    bearing, toggle = history["bearing_reaction"], history["toggle_reaction"]
    sum_of_forces = bearing + toggle
    travel = np.ptp(history["jaw_position"], axis=0)
    return {
        "foundation_rms": rms(forces),
        "foundation_mean": float(forces.mean()),
        "foundation_peak": float(forces.max()),
        "foundation_variation": float(forces.std()),
        "bearing_rms": rms(bearing),
        "toggle_rms": rms(toggle),
        "net_rms": rms(history["net_foundation_force"]),
        "net_variation": rms(sum_of_forces - sum_of_forces.mean(axis=0)),
        "shaking_rms": rms(history["shaking_force"]),
        "drive_power_rms": rms(history["drive_power"]),
        "drive_power_peak": float(np.abs(history["drive_power"]).max()),
        "stroke": float(travel[0]),
        "vertical_travel": float(travel[1]),
    }


def variants(description: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The same machine with one thing changed, to see what its force comes from."""
    jaw, toggle = (
        {
            part: float(description.get(f"{name}.{part}", jc.PARAMETERS[f"{name}.{part}"].default))
            for part in ("mass", "length")
        }
        for name in ("jaw", "toggle")
    )
    slender = {
        f"{name}.inertia": body["mass"] * body["length"] ** 2 / 12
        for name, body in (("jaw", jaw), ("toggle", toggle))
    }
    return {
        AS_IT_IS: {},
        "without load": {"load": 0.0},
        "without weight": {"gravity": 0.0},
        STANDING: {"speed": 1.0},
        "J2 of a slender rod": {"jaw.inertia": slender["jaw.inertia"]},
        "J3 of a slender rod": {"toggle.inertia": slender["toggle.inertia"]},
        "without counterweight": {"counterweight.mass": 0.0},
    }


def origins(design: Design, points: Mapping[str, np.ndarray]) -> dict[str, dict[str, dict]]:
    """Return the RMS of both forces with the ideal joint, N, by design and by force.

    `variants` holds them for the `variants` of each design, `one_by_one` what is added when one
    parameter alone goes back to that of the first design.
    """
    reference = next(iter(points.values()))
    rows, names = [], []
    for name, point in points.items():
        described = design.description(point)
        for variant, change in variants(described).items():
            rows.append({**described, **change})
            names.append((name, "variants", variant))
        for i, parameter in enumerate(design.names):
            back = point.copy()
            back[i] = reference[i]
            rows.append(design.description(back))
            names.append((name, "one_by_one", parameter))
    # No integration: the joint's force follows from the shaft's motion.
    scenes = stack([jc.build_scene(row).ideal() for row in rows])
    forces = run_all(_ideal_forces, scenes, len(rows))
    found: dict[str, dict[str, dict]] = {name: {} for name in points}
    for force, rms in forces.items():
        for (name, kind, entry), value in zip(names, rms.tolist(), strict=True):
            found[name].setdefault(kind, {}).setdefault(force, {})[entry] = value
        for kinds in found.values():
            whole, back = kinds["variants"][force][AS_IT_IS], kinds["one_by_one"][force]
            kinds["one_by_one"][force] = {key: v - whole for key, v in back.items()}
    return found


def _ideal_forces(scene: jc.Scene) -> dict[str, Any]:
    result = jc.statistics(scene, 0, 1, outputs=FORCES)
    return {name: result[name] for name in FORCES}
