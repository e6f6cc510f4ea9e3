"""The RMS over the speed, of a motion with a slope and of one without."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import jaxcrusher as jc
from jaxcrusher.pictures.plots import BLUE, ORANGE, STYLE, WIDTH


def plot_slopes() -> Figure:
    """Draw the RMS of ten turns over the speed, in contact and in chaos, with a slope if any."""
    speeds = np.linspace(29.9, 30.1, 81)
    cases = {
        "in contact": (jc.paper_machine(start="contact"), 2),
        "chaotic": (jc.paper_machine(load_law="closing_stroke"), 20),
    }
    with plt.rc_context(STYLE):
        fig, axes = plt.subplots(1, 2, figsize=(WIDTH, 2.8), layout="constrained")
        for ax, (name, (machine, settle)) in zip(axes, cases.items(), strict=True):
            found = jc.sweep(
                machine.replace(clearance=0.06e-3), {"speed": speeds}, settle, 10, rtol=1e-8
            )
            rms = found.foundation_rms.to_numpy() / 1e3
            ax.plot(speeds, rms, ".", color=BLUE, markersize=4, label="a run")
            ax.set(xlabel="driving speed (rad/s)", ylabel="RMS of the foundation force (kN)")
            ax.set_title(name)
            if name == "in contact":
                by_speed = np.polynomial.Polynomial.fit(speeds, rms, 1)
                ax.plot(speeds, by_speed(speeds), color=ORANGE, linewidth=0.8, label="slope")
                ax.legend(loc="upper left", frameon=False)
        fig.draw_without_rendering()
    return fig
