"""Whether a motion stayed where its contact model holds."""

import functools
import operator
from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Scalar

from jaxcrusher.basics.record import Printed
from jaxcrusher.joint.clearance import AbstractGap

# At this half-width over the radius the parabola that Hertz puts for the bore's circle is 7 %
# off at the edge of the contact.
WIDEST_CONTACT = 0.5
# 1e-5 sqrt(E / rho) of steel, m/s: faster impacts are not elastic (Johnson; Lankarani and
# Nikravesh 1990).
ELASTIC_IMPACT_SPEED = 0.051
# A restitution this far from the one asked for is another material.
RESTITUTION_ERROR = 0.05
# Radial clearance over bore radius: ten times the 0.001 of bearings (Hamrock, Schmid and Jacobson,
# Fundamentals of Fluid Film Lubrication, 2004). Chosen here, not measured: beyond, a pin hammers
# and rolls in a hole rather than runs in a bearing.
WIDEST_CLEARANCE = 0.01


class Tautness(Printed):
    """A tension rod against the limit of its law: it holds nothing where it is slack."""

    least_tension: Scalar  # N; what a rod would pull that can push

    @property
    def inside(self) -> Bool[Array, "*batch"]:
        """Taut at every instant."""
        return self.least_tension >= 0

    def remarks(self) -> list[str]:
        """Say that the rod is slack (concrete values only)."""
        slack = -float(self.least_tension)
        return [] if bool(self.inside) else [f"slack, short of tension by {slack:.3g} N"]


class Turning(Printed):
    """A free shaft against the limit of friction laws: regularised laws hold nothing at rest."""

    least_speed: Scalar  # rad/s

    @property
    def inside(self) -> Bool[Array, "*batch"]:
        """Never at rest, where dry friction might keep it."""
        return self.least_speed > 0

    def remarks(self) -> list[str]:
        """Say that the shaft has come to rest (concrete values only)."""
        if bool(self.inside):
            return []
        return ["comes to rest, where friction without stiction does not hold it"]


class Jamming(Printed):
    """Friction of a guide against the limit of its equations: friction that sustains itself."""

    feedback: Scalar  # largest share of the friction that friction itself brings forth

    @property
    def inside(self) -> Bool[Array, "*batch"]:
        """Friction follows from the other forces, at every instant."""
        return self.feedback < 1

    def remarks(self) -> list[str]:
        """Say that the slider jams (concrete values only)."""
        share = f"{float(self.feedback):.2f} of its friction by friction itself"
        return [] if bool(self.inside) else [f"may jam, and brings forth {share}"]


class RollerLoad(Printed):
    """A roller bearing against its static rating: beyond it the raceways keep dents (ISO 76)."""

    pressure_ratio: Scalar  # largest pressure over the 4 GPa that define the rating
    load_ratio: Scalar  # largest load over the rating

    @property
    def inside(self) -> Bool[Array, "*batch"]:
        """Neither pressure nor load beyond the rating."""
        return (self.pressure_ratio <= 1) & (self.load_ratio <= 1)

    def remarks(self) -> list[str]:
        """Say what is beyond the rating (concrete values only)."""
        if bool(self.inside):
            return []
        pressure, load = float(self.pressure_ratio), float(self.load_ratio)
        return [f"{load:.2f} of the static rating, {pressure:.2f} of its pressure"]


class FilmThickness(Printed):
    """A lubricating film against its limit: thinner than roughness, its surfaces touch."""

    ratio: Scalar  # least thickness over that at which roughness takes over

    @property
    def inside(self) -> Bool[Array, "*batch"]:
        """Thicker than the roughness at every instant."""
        return self.ratio >= 1

    def remarks(self) -> list[str]:
        """Say that the film does not separate the surfaces (concrete values only)."""
        if bool(self.inside):
            return []
        return [f"of {float(self.ratio):.2f} least thicknesses: its surfaces touch"]


def _within(ratio: Scalar | None, most: float) -> Bool[Array, "*batch"]:
    """Whether a ratio is small enough; one that is not known is not."""
    return jnp.asarray(False) if ratio is None else ratio <= most


class Validity(Printed):
    """A motion against the limits of its contact model; all without unit, None if not known."""

    # Hertz's half-width over the bore's or a roller's radius, largest
    half_width_ratio: Scalar | None = None
    impact_speed_ratio: Scalar | None = None  # fastest approach over that of an elastic impact
    delivered_restitution: Scalar | None = None  # of the fastest impact, by the law's closed form
    asked_restitution: Scalar | None = None
    clearance_ratio: Scalar | None = None  # radial clearance over the bore radius
    # Of further joints, by name, of a tension rod, of a free shaft, of rollers and of films.
    others: "Mapping[str, Validity | Tautness | Turning | Jamming | RollerLoad | FilmThickness]" = (
        eqx.field(default_factory=dict)
    )
    # What would be needed to know the rest: names of statistics that were not asked for.
    missing: tuple[str, ...] = eqx.field(static=True, default=())

    @property
    def hertzian(self) -> Bool[Array, "*batch"]:
        """Narrow enough a contact for Hertz's theory."""
        return _within(self.half_width_ratio, WIDEST_CONTACT)

    @property
    def elastic(self) -> Bool[Array, "*batch"]:
        """No impact beyond the elastic limit."""
        return _within(self.impact_speed_ratio, 1)

    @property
    def restitution_kept(self) -> Bool[Array, "*batch"]:
        """Fastest impact rebounds as asked, as far as that is known."""
        if self.delivered_restitution is None or self.asked_restitution is None:
            speeds = self.impact_speed_ratio
            return jnp.asarray(True) if speeds is None else jnp.ones(speeds.shape, bool)
        error = jnp.abs(self.delivered_restitution - self.asked_restitution)
        return jnp.isnan(error) | (error <= RESTITUTION_ERROR)

    @property
    def fitting(self) -> Bool[Array, "*batch"]:
        """A pin that nearly fills its bore."""
        return _within(self.clearance_ratio, WIDEST_CLEARANCE)

    @property
    def inside(self) -> Bool[Array, "*batch"]:
        """Fitting, Hertzian and elastic at each joint.

        The restitution is told beside impacts that are too fast, and is not judged by itself. A
        motion with `missing` statistics is not known to be inside.
        """
        own = self.fitting & self.hertzian & self.elastic & (not self.missing)
        return functools.reduce(operator.and_, [part.inside for part in self.others.values()], own)

    def verdict(self) -> str:
        """Say whether the motion is inside the model, and else why not (concrete values only)."""
        why = "; ".join(self.remarks())
        word = "NOT KNOWN to be inside" if self.missing else "OUTSIDE"
        return f"{word} the contact model: {why}" if why else "inside the contact model"

    def remarks(self) -> list[str]:
        """Say what is outside the model, or not known to be inside (concrete values only)."""
        lines = []
        if self.clearance_ratio is not None and not bool(self.fitting):
            lines.append(f"clearance {float(self.clearance_ratio):.2g} of the bore radius")
        if self.half_width_ratio is not None and not bool(self.hertzian):
            lines.append(
                f"contact of half-width {float(self.half_width_ratio):.2f} radii: not Hertzian"
            )
        if self.impact_speed_ratio is not None and not bool(self.elastic):
            ratio = float(self.impact_speed_ratio)
            lines.append(f"approaches at {ratio:.1f} times the elastic limit")
            if not bool(self.restitution_kept):
                lines.append(
                    f"restitution {self.delivered_restitution:.3f} for {self.asked_restitution:.3g}"
                )
        for name, limits in self.others.items():
            lines += [f"{name}: {remark}" for remark in limits.remarks()]
        return lines + [f"not known without {name}" for name in self.missing]


def validity(
    joint: AbstractGap | None, penetration_ratio: Scalar, impact_speed: Scalar
) -> Validity:
    """The `Validity` of a motion by its largest penetration/clearance and approach (m/s).

    An ideal joint has neither contact nor impacts, and so no restitution.
    """
    if joint is None:
        return Validity(penetration_ratio, impact_speed, None, None, jnp.zeros_like(impact_speed))
    return Validity(
        joint.half_width_ratio(joint.clearance * penetration_ratio),
        impact_speed / ELASTIC_IMPACT_SPEED,
        joint.normal.delivered_restitution(impact_speed),
        joint.normal.asked_restitution(),
        jnp.broadcast_to(joint.clearance / joint.bore_radius, jnp.shape(impact_speed)),
    )
