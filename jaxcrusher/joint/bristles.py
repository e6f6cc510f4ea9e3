"""Friction with a state: bristles that bend before surfaces slip (LuGre).

Asperities of one surface are bristles on the other (Canudas de Wit, Olsson, Astrom, Lischinsky,
IEEE Trans. Automatic Control 40, 1995). Let v be the slip and z their mean deflection. They bend
with the slip, and slide back the more, the more they are bent:

    z' = v - s0 |v| z / g(v),        F_t = -F_n (s0 z + s1(v) z' + s2 v),
    g(v) = mu_k + (mu_s - mu_k) exp(-(v / v_s)^2).

In steady sliding z' is zero and F_t = -F_n (g(v) sign v + s2 v), Stribeck's curve. At a standstill
bristles are springs of s0 F_n, and hold up to mu_s F_n. Of the power of friction, the springs of
the bristles store the rate of F_n s0 z^2 / 2; the rest, with y = s0 z, is

    F_n (|v| y^2 / g + s1 z' (z' + |v| y / g) + s2 v^2),

which is never negative where s1(v) |v| <= 4 g(v) (Barabanov and Ortega, IEEE Trans. Automatic
Control 45, 2000). Therefore the damping of the bristles falls as s1 exp(-(v / v_d)^2): it is
enough that s1 v_d <= 9.3 mu_k. The state is y, which is of the size of a coefficient of friction.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar
from typing_extensions import override

from jaxcrusher.basics.plane import scalar
from jaxcrusher.joint.friction import AbstractFriction, AbstractSlip

_SPEED = {"unit": "m/s"}


class LuGre(AbstractFriction):
    """Stiction, presliding and Stribeck's curve, with the bristles' deflection as a state.

    Defaults are estimates: bristles of a bearing bend by some micrometres before it slips. Their
    equation is stiff where surfaces slide fast, with the rate s0 |v| / mu_k a second.
    """

    slip: AbstractSlip
    coefficient: Scalar = eqx.field(converter=scalar, default=0.1)  # mu_k
    static_ratio: Scalar = eqx.field(converter=scalar, default=1.2)  # mu_s / mu_k, >= 1
    stribeck_speed: Scalar = eqx.field(converter=scalar, default=0.1, metadata=_SPEED)  # v_s
    # s0, of the force per newton of the normal force
    bristle_stiffness: Scalar = eqx.field(converter=scalar, default=3e4, metadata={"unit": "1/m"})
    bristle_damping: Scalar = eqx.field(converter=scalar, default=40.0, metadata={"unit": "s/m"})
    damping_speed: Scalar = eqx.field(converter=scalar, default=0.01, metadata=_SPEED)  # v_d
    viscous: Scalar = eqx.field(converter=scalar, default=0.0, metadata={"unit": "s/m"})  # s2
    # In flight nothing bends the bristles; the time after which 1/e is left.
    release: Scalar = eqx.field(converter=scalar, default=1e-4, metadata={"unit": "s"})

    @override
    def initial(self) -> Scalar:
        return jnp.zeros(())

    @override
    def force(
        self, normal_force: Scalar, slip_speed: Scalar, memory: Scalar | None = None
    ) -> Scalar:
        """F_t, N, with the bristles' deflection, or of steady sliding without one."""
        bent = self._steady(slip_speed) if memory is None else memory
        damping = jnp.exp(-((slip_speed / self.damping_speed) ** 2))
        damped = self.bristle_damping * damping * self._bending(bent, slip_speed)
        return -normal_force * (bent + damped + self.viscous * slip_speed)

    @override
    def rate(self, memory: Scalar, in_contact: Scalar, slip_speed: Scalar) -> Scalar:
        bending = self.bristle_stiffness * self._bending(memory, slip_speed)
        return in_contact * bending - (1 - in_contact) * memory / self.release

    def _bending(self, bent: Scalar, slip_speed: Scalar) -> Scalar:
        """Return z' in contact, m/s."""
        return slip_speed - jnp.abs(slip_speed) * bent / self._holding(slip_speed)

    def _holding(self, slip_speed: Scalar) -> Scalar:
        """Return g(v)."""
        fall = jnp.exp(-((slip_speed / self.stribeck_speed) ** 2))
        return self.coefficient * (1 + (self.static_ratio - 1) * fall)

    def _steady(self, slip_speed: Scalar) -> Scalar:
        return self._holding(slip_speed) * jnp.sign(slip_speed)
