"""Which reading comes nearest to the peaks of 1.1e6 and 1.7e6 N at 0.09 and 0.12 mm?"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import diffrax
import equinox as eqx
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.batch import map_scenes, stacked
from benchmarks.reproduction.variants import LiteralContact, PlainUnits, WeightedSlip, largest
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.joint.friction import AmbrosioFriction
from jaxcrusher.joint.normal import AbstractNormalLaw
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.scene import AbstractFormulation
from jaxcrusher.mechanism.starts import shifted_start
from jaxcrusher.motion.statistics import WHIRL_WINDING

SPEED = 30.0  # rad/s
MOST_STEPS = 300_000  # of a turn
# Peaks at 30 rad/s by clearance (mm), Fig. 12, N.
TARGETS = {0.03: 6e4, 0.06: 7.4e4, 0.09: 1.1e6, 0.12: 1.7e6}
OFFSETS = (0.0, 1e-3)  # of the centred start, in clearances
SETTLE, TURNS = 20, 4  # the centred start's transient is over by then


@dataclass(frozen=True)
class Way:
    """A formulation's maker and an integration: each compiles to one program.

    It is made late: importing this module must not start JAX.
    """

    formulation: Callable[..., AbstractFormulation]
    method: jc.Method = jc.Method(max_steps=MOST_STEPS)


def _tolerances(rtol: float, atol: float) -> Way:
    controller = diffrax.PIDController(
        rtol=rtol, atol=atol, norm=largest, dtmin=1e-12, force_dtmin=False
    )
    return Way(PlainUnits, jc.Method(diffrax.Dopri5(), controller, MOST_STEPS))


def _steps(seconds: float) -> Way:
    method = jc.Method(
        diffrax.Dopri5(), diffrax.ConstantStepSize(), MOST_STEPS, dt0=SPEED * seconds
    )
    return Way(EccentricityFormulation, method)


ACCURATE = Way(LiteralContact)


@dataclass(frozen=True)
class Variant:
    """One thing (or two) changed in the decided reading."""

    name: str
    surface: bool = False
    way: Way = ACCURATE
    contact: dict[str, Any] = field(default_factory=dict)  # of the formulation
    friction: dict[str, float] = field(default_factory=dict)  # fields of AmbrosioFriction
    options: dict = field(default_factory=dict)  # of jaxcrusher.paper_scene
    restitution: float = 0.9
    stiffness: float = 1.0  # times that of (9)
    start_offsets: tuple[float, ...] = OFFSETS
    clearance: float = 1.0  # times that of the paper

    def scene(self, clearance: float, offset: float) -> Scene:
        """Return the scene at this clearance (mm)."""
        scene = jc.paper_scene(SPEED, 1e-3 * clearance * self.clearance, **self.options)
        scene = shifted_start(scene, Vector(offset, 0.0))
        law = AmbrosioFriction(WeightedSlip(float(self.surface)), **self.friction)
        formulation = self.way.formulation(**self.contact)
        assert scene.joint is not None
        normal = scene.joint.normal
        assert isinstance(normal, AbstractNormalLaw)
        normal = eqx.tree_at(
            lambda n: (n.stiffness, n.restitution),
            normal,
            (self.stiffness * normal.stiffness, jax.numpy.asarray(self.restitution)),
        )
        return eqx.tree_at(
            lambda s: (s.joint.friction, s.joint.normal, s.formulation),
            scene,
            (law, normal, formulation),
            is_leaf=lambda leaf: isinstance(leaf, AbstractFormulation),
        )


# (6)'s v_n is minus the penetration rate: D changes sign, as for a restitution of 1.09.
NEGATIVE_DAMPING = math.sqrt(2 - 0.9**2)
NO_MOMENTS = {"at_joint": 0.0, "torque": 0.0}
AS_PRINTED = NO_MOMENTS | {"x_sign": -1.0, "folded": 1.0}


def variants() -> list[Variant]:
    """Return the list searched; each with both slips where friction matters."""
    both: list[tuple[str, dict]] = [
        ("as decided", {}),
        ("start in contact", dict(options={"start": "contact"}, start_offsets=(0.0,))),
        ("(19) as printed", dict(contact=AS_PRINTED)),
        ("(19) as printed, F added", dict(contact=AS_PRINTED | {"x_sign": 1.0, "y_sign": -1.0})),
        ("(19), signs corrected, phi as (3)", dict(contact=NO_MOMENTS | {"folded": 1.0})),
        ("(19), signs and phi corrected, no moments", dict(contact=NO_MOMENTS)),
        ("(19) corrected, phi as (3)", dict(contact={"folded": 1.0})),
        ("no friction torque", dict(contact={"torque": 0.0})),
        ("friction reversed", dict(friction={"coefficient": -0.1})),
        ("friction reversed, no moments", dict(friction={"coefficient": -0.1}, contact=NO_MOMENTS)),
        ("v_n of (6): damping reversed", dict(restitution=NEGATIVE_DAMPING)),
        ("impact velocity tracked", dict(options={"impact_law": "tracked"})),
        ("impact velocity 0.05 m/s", dict(options={"impact_velocity": 0.05})),
        ("load normal to jaw", dict(options={"load_law": "normal_to_jaw"})),
        ("r a diametral clearance", dict(clearance=0.5)),
        ("r ten times as large", dict(clearance=10.0)),
        ("no Baumgarte", dict(way=Way(functools.partial(MultiplierFormulation, 0.0, 0.0)))),
        ("ode45 at its default tolerances", dict(way=_tolerances(1e-3, 1e-6))),
        ("ode45 at a tenth of them", dict(way=_tolerances(1e-4, 1e-7))),
        ("steps of 0.5 ms", dict(way=_steps(5e-4))),
        ("steps of 0.2 ms", dict(way=_steps(2e-4))),
    ]
    surface: list[tuple[str, dict]] = [
        *((f"friction {c:g}", dict(friction={"coefficient": c})) for c in (0.02, 0.03, 0.05)),
        *((f"full friction at {v:g} m/s", dict(friction={"full_speed": v})) for v in (5.0, 10.0)),
        *((f"stiffness times {k:g}", dict(stiffness=k)) for k in (0.3, 0.1, 0.05)),
        ("stiffness with c in mm", dict(stiffness=10**-1.5)),
    ]
    found = [
        Variant(f"{name}, {slip} slip", slip == "surface", **changes)
        for name, changes in both
        for slip in ("centre", "surface")
    ]
    return found + [Variant(f"{name}, surface slip", True, **changes) for name, changes in surface]


@dataclass(frozen=True)
class Found:
    """A variant's statistics by clearance (mm), each of shape (runs,)."""

    variant: Variant
    statistics: dict[float, dict[str, np.ndarray]]

    def nearest(self, clearance: float) -> int:
        """Return the run whose peak is nearest to the paper's: two attractors have no median.

        A run that stopped only where all did.
        """
        distances = np.abs(
            np.log(self.statistics[clearance]["foundation_peak"] / TARGETS[clearance])
        )
        return int(np.argmin(np.where(np.isnan(distances), np.inf, distances)))

    def value(self, clearance: float, name: str = "foundation_peak") -> float:
        """Return a statistic of the nearest run; the peak, N."""
        return float(self.statistics[clearance][name][self.nearest(clearance)])

    def distance(self, clearances: tuple[float, ...]) -> float:
        """Return the RMS of ln(peak / target), a factor of two is 0.69; infinite if none ran."""
        logs = [math.log(self.value(c) / TARGETS[c]) for c in clearances]
        size = math.sqrt(sum(value**2 for value in logs) / len(logs))
        return size if math.isfinite(size) else math.inf

    def whirling(self, clearance: float) -> int:
        """Count the runs that whirl, backwards (driven by friction) or forwards."""
        return int(np.sum(np.abs(self.statistics[clearance]["winding"]) > WHIRL_WINDING))


def _row(scene: Scene, method: jc.Method) -> dict[str, jax.Array | None]:
    result = jc.statistics(
        scene,
        SETTLE,
        TURNS,
        rtol=1e-6,
        method=method,
        outputs=("foundation_mean", "foundation_peak", "winding"),
    )
    return {
        "foundation_mean": result.foundation_mean,
        "foundation_peak": result.foundation_peak,
        "winding": result.winding,
        "turns": result.outcome.reached / (2 * np.pi),
    }


def search(listed: list[Variant], done: Callable[[str], None] = lambda what: None) -> list[Found]:
    """Run them all, nearest to the two large peaks first."""
    programs: dict[int, list[Variant]] = {}
    for variant in listed:
        programs.setdefault(id(variant.way), []).append(variant)
    found = []
    for group in programs.values():
        runs = [(v, c, offset) for v in group for c in TARGETS for offset in v.start_offsets]
        function = eqx.Partial(_row, method=group[0].way.method)
        results = map_scenes(function, [variant.scene(c, offset) for variant, c, offset in runs])
        pairs = list(zip(runs, results, strict=True))
        for variant in group:
            by_clearance = {
                at: stacked(one for (v, c, _), one in pairs if v is variant and c == at)
                for at in TARGETS
            }
            found.append(Found(variant, by_clearance))
            done(variant.name)
    return sorted(found, key=lambda f: f.distance((0.09, 0.12)))
