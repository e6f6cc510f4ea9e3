"""Responses by order, the scatter at which contact is lost, and ensembles beside predictions."""

from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.pages import table
from benchmarks.rough_feed.ensemble import compared, feeds
from jaxcrusher.files.results import write_figure
from jaxcrusher.orbits.feed_response import linearised
from jaxcrusher.orbits.trigonometric import resample
from jaxcrusher.pictures.page import STYLE, WIDTH

# The paper's choice and the search's: speed (rad/s) and clearance (m).
CRUSHERS = {"30 rad/s, 0.06 mm": (30.0, 0.06e-3), "25 rad/s, 0.03 mm": (25.0, 0.03e-3)}
ORDERS = np.arange(0.01, 40, 0.02)
BANDWIDTHS = np.arange(1.0, 40.5, 1.0)
# Bandwidths and scatters of the ensembles.
TRIED, SCATTERS = (3.0, 10.0), (0.01, 0.05, 0.1, 0.2, 0.3)
HEADINGS = (
    "bandwidth",
    "scatter",
    "deviation of the force, N",
    "predicted",
    "of a turn's RMS, N",
    "predicted",
    "RMS above the orbit's, N",
    "predicted",
    "turns that lose contact",
    "predicted",
)


def run(out: Path) -> None:
    """Compute, print, draw."""
    jc.set_up()
    with plt.rc_context(STYLE):
        write_figure(out / "rough_feed.png", figure())
    print(out / "rough_feed.png")
    for name, at in CRUSHERS.items():
        rows = []
        for bandwidth in TRIED:
            orbit = orbit_of(*at, bandwidth)
            random = feeds(orbit)
            for scatter in SCATTERS:
                found = compared(orbit, random, scatter)
                rows.append([f"{bandwidth:g}", f"{scatter:.0%}", *found])
        print(f"\n{name}\n\n{table(HEADINGS, rows)}")


def orbit_of(speed: float, clearance: float, bandwidth: float) -> jc.PeriodicOrbit:
    """Return the orbit of a crusher under a rough feed."""
    numbers = {"speed": speed, "clearance": clearance, "load_scatter": 0.1}
    scene = jc.build_scene({**numbers, "load_bandwidth": bandwidth, "start": "contact"})
    return jc.periodic_orbit(scene)


def figure() -> Figure:
    """Draw responses by order, and below them the scatter that the contact bears."""
    fig, (above, below) = plt.subplots(
        2, 1, figsize=(WIDTH, 5.4), layout="constrained", sharex=True
    )
    for name, at in CRUSHERS.items():
        orbit = orbit_of(*at, 10.0)
        above.semilogy(ORDERS, by_order(orbit) / 1e3, linewidth=0.8, label=name)
        borne = np.array([losing(orbit, one) for one in BANDWIDTHS])
        below.semilogy(BANDWIDTHS, borne, marker=".", label=name)
        for bandwidth, scatter in zip(BANDWIDTHS, borne, strict=True):
            print(f"{name}, up to order {bandwidth:g}: contact is lost at {scatter:.2%}")
    above.set_ylabel("force at a load of 100 %\nat one order, kN")
    below.set_ylabel("scatter that loses contact\nonce in 1000 turns")
    below.set_xlabel("order of the shaft; below, the bandwidth of the feed")
    for share in (0.05, 0.1, 0.2):
        below.axhline(share, color="0.6", linewidth=0.6, zorder=0)
        below.text(0.2, share, f"{share:.0%}", fontsize="small", va="bottom")
    above.legend()
    return fig


def by_order(orbit: jc.PeriodicOrbit) -> np.ndarray:
    """Return the RMS over the turn of the force's amplitude, by order."""
    about = linearised(orbit)
    slope = resample(about.force.slope, len(about.modes.excited))

    @eqx.filter_jit
    def size(order):
        seen = jnp.einsum("ia,ia->i", slope, about.modes.responses(order, np.zeros(1))[:, :, 0])
        return jnp.sqrt(jnp.mean(jnp.abs(seen) ** 2))

    return np.array([float(size(jnp.asarray(order))) for order in ORDERS])


def losing(orbit: jc.PeriodicOrbit, bandwidth: float) -> float:
    """Return the scatter that loses contact once in 1000 turns."""
    wide = eqx.tree_at(lambda o: o.scene.load.bandwidth, orbit, jnp.asarray(bandwidth))
    return float(jc.feed_response(wide).losing_scatter)
