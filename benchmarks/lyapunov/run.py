"""`python -m benchmarks.lyapunov`: exponents from tangents against those from a series alone.

The series' estimators are nolds' Rosenstein (`lyap_r`) and Eckmann (`lyap_e`) with their default
settings. Writes docs/lyapunov.md. (nolds 0.6.3 cannot be
imported under Python 3.11; 0.6.2 can.)
"""

import warnings
from collections.abc import Callable
from pathlib import Path

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import nolds
import numpy as np
from rich.progress import track

import jaxcrusher as jc
from jaxcrusher.dynamics.indicators import Lyapunov, lyapunov_spectrum, zero_one_test

POINTS = 2000
TANGENT_TURNS = 150
SLICES = 8


def iterate(
    step: Callable, start: list[float], count: int, settle: int
) -> tuple[np.ndarray, np.ndarray]:
    """Points of a map and its Jacobians along them."""

    @eqx.filter_jit
    def run(x):
        def one(x, _):
            return step(x), (x, jax.jacfwd(step)(x))

        x, _ = jax.lax.scan(lambda x, _: (step(x), None), x, length=settle)
        return jax.lax.scan(one, x, length=count)[1]

    points, jacobians = run(jnp.asarray(start))
    return np.asarray(points), np.asarray(jacobians)


def flow(field: Callable, interval: float) -> Callable:
    """The map of a flow over `interval`, by Dopri8 at 1e-10."""

    def step(x):
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Dopri8(),
            0.0,
            interval,
            None,
            x,
            stepsize_controller=diffrax.PIDController(rtol=1e-10, atol=1e-10),
            adjoint=diffrax.ForwardMode(),
        )
        assert solution.ys is not None
        return solution.ys[0]

    return step


def lorenz(t, x, args):
    """Sigma = 10, rho = 28, beta = 8 / 3."""
    return jnp.stack([10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]])


def duffing(t, x, args):
    """Omega = 1, f = 0.3, d = 0.2, beta = -1."""
    return jnp.stack([x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + 0.3 * jnp.cos(t)])


def henon(x):
    """With a = 1.4, b = 0.3."""
    return jnp.stack([1 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]])


# Name -> step, start, interval of the samples, samples between two points of the 0-1 test (a flow
# sampled too finely misleads it), unit of the exponent, and the published one.
SYSTEMS = {
    "logistic map, r = 4": (lambda x: 4 * x * (1 - x), [0.3], 1.0, 1, "step", np.log(2)),
    "Hénon map": (henon, [0.1, 0.1], 1.0, 1, "step", 0.419),
    "Lorenz": (flow(lorenz, 0.05), [1.0, 1.0, 20.0], 0.05, 10, "time", 0.9056),
    "Duffing": (flow(duffing, 2 * np.pi), [0.5, 0.0], 2 * np.pi, 1, "time", 0.1589),
}


def row(
    name: str,
    found: Lyapunov,
    interval: float,
    series: np.ndarray,
    strobe: np.ndarray,
    unit: str,
    reference: float | None,
) -> str:
    """A line of the table; `series` for nolds, `strobe` for the 0-1 test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nolds': too few neighbours, a poor fit
        rosenstein = float(np.asarray(nolds.lyap_r(series))) / interval
        eckmann = float(np.max(nolds.lyap_e(series))) / interval
    own, error = found.exponents[0] / interval, found.errors[0] / interval
    published = "" if reference is None else f"{reference:.4g}"
    return (
        f"| {name} | {unit} | {own:.4g} ± {error:.2g} | {published} | {rosenstein:.3g} | "
        f"{eckmann:.3g} | {zero_one_test(strobe):.2f} |"
    )


def crusher() -> str:
    """The chaotic crusher: 30 rad/s, 0.06 mm, the load on the closing stroke."""
    scene = jc.paper_scene(30.0, 0.06e-3, load_law="closing_stroke")
    section = jc.poincare_section(scene, 100, POINTS, rtol=1e-10)
    further = jc.poincare_section(
        scene, 0, TANGENT_TURNS, slices=SLICES, state=section.states[-1], rtol=1e-10
    )
    if not (bool(section.outcome.success) and bool(further.outcome.success)):
        raise RuntimeError("The crusher's motion failed.")
    found = lyapunov_spectrum(np.asarray(further.jacobians), slices=SLICES)
    series = np.asarray(section.states)[:, 0]
    return row("crusher, closing stroke", found, 1.0, series, series, "turn", None)


def main() -> None:
    """Measure and write the table."""
    rows = []
    for name, (step, start, interval, stride, unit, reference) in track(SYSTEMS.items()):
        points, jacobians = iterate(step, start, stride * POINTS, 200)
        found = lyapunov_spectrum(jacobians)
        series = points[:POINTS, 0]
        rows.append(row(name, found, interval, series, points[::stride, 0], unit, reference))
    rows.append(crusher())
    path = Path(__file__).parents[2] / "docs" / "lyapunov.md"
    path.write_text(_table(rows))
    print(path)


def _table(rows: list[str]) -> str:
    lines = [
        "# Lyapunov exponents",
        "",
        "Made by `python -m benchmarks.lyapunov`; not edited by hand. Largest exponents, from the",
        f"tangents along {POINTS} points (Lorenz: {10 * POINTS} samples of 0.05; crusher: "
        f"{TANGENT_TURNS} turns)",
        "with standard errors by batch means, against the published ones and against two",
        f"estimators that see one coordinate of {POINTS} samples only: nolds' `lyap_r`",
        "(Rosenstein) and `lyap_e` (Eckmann), default settings. K is the 0-1 test, near 1 for",
        "chaos. The crusher: 30 rad/s, 0.06 mm, load on the closing stroke, e_x once a turn.",
        "",
        "| system | per | from tangents | published | nolds lyap_r | nolds lyap_e | K |",
        "|---|---|---|---|---|---|---|",
        *rows,
        "",
        "An estimator that has only a series cannot see a growth of e^7 a turn: two points that",
        "are near at one turn are anywhere at the next.",
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    jc.set_up()
    main()
