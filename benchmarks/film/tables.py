"""Films of a bearing beside Reynolds' equation in two dimensions, and published numbers."""

from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np

from benchmarks.pages import table
from benchmarks.peers.reynolds import film_force
from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.film import Film, FiniteFilm

# L / 2R -> |e| / c -> Sommerfeld's number and the attitude in degrees, of a steady journal in a
# full bearing (Raimondi and Boyd, ASLE Transactions 1, 1958, part III), as handbooks print them.
# The paper could not be opened; that Reynolds' equation meets each within 2 % is the check.
RAIMONDI_BOYD = {
    1.0: {0.2: (0.631, 74.02), 0.4: (0.264, 63.10), 0.6: (0.121, 50.58), 0.8: (0.0446, 36.24)}
    | {0.9: (0.0188, 26.45)},
    0.5: {0.2: (2.03, 74.94), 0.4: (0.779, 61.45), 0.6: (0.319, 48.14), 0.8: (0.0923, 33.31)}
    | {0.9: (0.0313, 23.66)},
    0.25: {0.2: (7.57, 75.18), 0.4: (2.83, 60.86), 0.6: (1.07, 46.72), 0.8: (0.261, 31.04)}
    | {0.9: (0.0736, 21.85)},
}


def force_of(kind: type[Film], slenderness: float, share: float, turned: float) -> complex:
    """Return the force on the bore in mu L (R / c)^3 u, along and across the eccentricity."""
    film = kind(viscosity=1.0, width=2 * slenderness, least_thickness=1e-9)
    seen = Vector(np.cos(turned), np.sin(turned))
    one = jnp.ones(())
    found = film.resistance(Vector(one, 0 * one), share * one, seen, one, one)
    return complex(found.x, found.y) / (2 * slenderness)


def steady_rows() -> Iterator[list[str]]:
    """Yield Sommerfeld's number and the attitude of each steady journal, by each way."""
    for slenderness, rows in RAIMONDI_BOYD.items():
        for share, (number, attitude) in rows.items():
            ways = [number, attitude]
            size, angle = film_force(share, np.pi / 2, slenderness, ruptures=True)
            forces = [size * np.exp(1j * angle)]
            forces += [force_of(one, slenderness, share, np.pi / 2) for one in (FiniteFilm, Film)]
            for force in forces:
                ways += [2 / (np.pi * abs(force) * share), np.degrees(np.angle(force))]
            cells = (
                f"{value:.3g}" if k % 2 == 0 else f"{value:.1f}" for k, value in enumerate(ways)
            )
            yield [f"{slenderness:g}", f"{share:g}", *cells]


def any_rows() -> Iterator[list[str]]:
    """Yield by how much a film's force is larger than Reynolds', over all ways that a pin moves."""
    for slenderness in RAIMONDI_BOYD:
        for share in (0.2, 0.6, 0.8, 0.9):
            turns = np.linspace(0, np.pi, 13)
            known = [film_force(share, turned, slenderness, ruptures=True) for turned in turns]
            exact = np.array([size * np.exp(1j * angle) for size, angle in known])
            cells = [f"{slenderness:g}", f"{share:g}"]
            for kind in (FiniteFilm, Film):
                ours = np.array([force_of(kind, slenderness, share, one) for one in turns])
                ratios, off = np.abs(ours / exact), np.abs(np.degrees(np.angle(ours / exact)))
                cells += [f"{ratios.min():.2f} to {ratios.max():.2f}", f"{off.max():.0f}"]
            yield cells


def tables() -> Iterator[str]:
    """Yield a table of steady journals, and one of pins that move any way."""
    names = ["published", "Reynolds", "finite", "short"]
    heads = [f"{name}: {of}" for name in names for of in ("S", "deg")]
    yield table(["L / 2R", "E", *heads], steady_rows())
    heads = [f"{name}: {of}" for name in names[2:] for of in ("force / Reynolds", "deg off")]
    yield table(["L / 2R", "E", *heads], any_rows())
