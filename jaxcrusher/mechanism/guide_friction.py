"""Friction of slides without a gap, whose normal forces are reactions.

A slider bears on its guide at two ends, L apart, with N_1,2 = N / 2 +- M / L, where N is the force
to the left and M the moment about its origin. A slider without a length bears in the middle, with
N. Its friction along the slide is S = m A with A = sum |N_e| over its ends, where m is the friction
by the law at this speed under 1 N. S acts in the line through the slider's origin; the slider's
height counts only in a guide with a gap. The equations of motion are linear in forces, so that
N_e = N_e0 + sum K_ej S_j over all slides j, and while each end stays at its edge, s_e = sign N_e,

    A_i = a_i + sum B_ij A_j,    a_i = sum s_e N_e0,    B_ij = m_j sum s_e K_ej   (e: ends of i),

which is solved, and solved again for the edges that follow. The sum of |m_j K_ej| over all slides
and both ends is the share of A_i that friction itself causes. Below one the solution is unique;
from one on the slider may jam, as a drawer does, and friction that follows from a speed cannot hold
it.
"""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.linear import solve_dominant
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.mechanism.equations import Accelerations, Forces, pair_at
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named

# Times that the edges are guessed, at first those without friction: at the instants at which an end
# goes over to its other edge they are others with it.
_GUESSES = 3

Ends = list[list[Scalar]]  # of each slide: the forces on its ends, to the left


def rubbing(
    motion: Motion,
    guides: Named[AbstractFriction],
    forces: Forces,
    solve: Callable[[Forces], Accelerations],
) -> Accelerations:
    """Return the accelerations under given forces and the friction of some slides."""
    slides = {name: motion.linkage.slides.at(name) for name in guides.names}
    per_newton = []  # m of each slide, on the frame and ahead
    for name, law in guides.items():
        speed = slides[name].direction.dot(motion.velocity(motion.ends(name).pin))
        per_newton.append(law.force(jnp.ones_like(speed), -speed))

    def under(*frictions: Scalar) -> Accelerations:
        wrenches = list(forces.wrenches)
        for (name, slide), friction in zip(slides.items(), frictions, strict=True):
            ahead = friction * slide.direction
            wrenches += pair_at(motion, motion.ends(name), ahead, forces.frame)
        return solve(forces._replace(wrenches=tuple(wrenches)))

    def ends_of(found: Accelerations) -> Ends:
        pressed = []
        for name, slide in slides.items():
            at = found.slides.at(name)
            if slide.length is None:
                pressed.append([at.force])
                continue
            turning = at.moment / slide.length
            pressed.append([at.force / 2 + turning, at.force / 2 - turning])
        return pressed

    places = range(len(slides))
    none = [jnp.zeros_like(one) for one in per_newton]
    free, change = jax.linearize(under, *none)
    begun = ends_of(free)
    # K_ej m_j: by slide j, of slide i and its end e.
    by_slide = [
        ends_of(change(*(m if i == j else zero for i, zero in enumerate(none))))
        for j, m in enumerate(per_newton)
    ]
    now, sizes = begun, none
    for _ in range(_GUESSES):
        edges = [[jnp.sign(one) for one in ends] for ends in now]
        right = [_dot(edges[i], begun[i]) for i in places]
        rows = [[float(i == j) - _dot(edges[i], by_slide[j][i]) for j in places] for i in places]
        sizes = solve_dominant(rows, right)
        now = [
            [_dot(sizes, [by_slide[j][i][e] for j in places]) + one for e, one in enumerate(ends)]
            for i, ends in enumerate(begun)
        ]
    frictions = [m * size for m, size in zip(per_newton, sizes, strict=True)]
    found = jax.tree.map(jnp.add, free, change(*frictions))
    told = dict(found.slides.items())
    for i, name in enumerate(slides):
        parts = [jnp.abs(one) for j in places for one in by_slide[j][i]]
        feedback = sum(parts[1:], parts[0])
        told[name] = dataclasses.replace(told[name], friction=frictions[i], feedback=feedback)
    return dataclasses.replace(found, slides=Named(told))


def _dot(one: list[Scalar], other: list[Scalar]) -> Scalar:
    first, *others = (a * b for a, b in zip(one, other, strict=True))
    return sum(others, first)
