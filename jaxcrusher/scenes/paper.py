"""The scenes of Wang, Cui, Wang, Appl. Sci. 2023, 13, 238: the PE250x400 of Tables 1 and 2."""

from typing import Any, Literal

from jaxtyping import Scalar

from jaxcrusher.basics.checks import require_choice
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.scenes.parameters import CHOICES, build_machine, build_scene

LoadName = Literal["along_jaw", "normal_to_jaw", "closing_stroke"] | None


def paper_scene(
    speed: float | Scalar,
    clearance: float | Scalar,
    *,
    start: Literal["centred", "contact"] = "centred",
    slip: Literal["centre", "surface"] = "centre",
    friction: float | Scalar | None = 0.1,
    load: LoadName = "along_jaw",
    impact_velocity: float | Scalar | Literal["tracked"] = 0.5,
    formulation: Literal["eccentricity", "multiplier"] = "eccentricity",
) -> Scene:
    """The paper's crusher with clearance in its main bearing.

    **Arguments:**

    - `speed`: of the shaft, rad/s, constant.
    - `clearance`: radial, R_i - R_j, m, in (0, 0.13).
    - `start`: `"centred"`, e = e' = 0 (the paper's); `"contact"`, resting in the bore.
    - `slip`: the reading of the slip speed, of the centres or of the surfaces.
    - `friction`: coefficient c_f, or None for no friction.
    - `load`: 8.8 kN `"along_jaw"` (18), `"normal_to_jaw"`, only on the `"closing_stroke"`, or None.
    - `impact_velocity`: of the Lankarani-Nikravesh law, m/s, or `"tracked"` per impact.
    - `formulation`: `"eccentricity"` (two degrees of freedom) or `"multiplier"` (the paper's).

    Numbers may be traced. Raises ValueError for a number outside its limits or an unknown name.
    `jaxcrusher.build_scene` has every number of the machine by name.
    """
    values: dict[str, Any] = {
        "speed": speed,
        "clearance": clearance,
        "start": start,
        "slip": slip,
        "friction": 0.0 if friction is None else friction,
        "load_law": _load_law(load),
        "formulation": formulation,
    }
    if isinstance(impact_velocity, str):
        require_choice("impact_velocity", impact_velocity, ("tracked", "a speed in m/s"))
        values["impact_law"] = "tracked"
    else:
        values["impact_velocity"] = impact_velocity
    return build_scene(values)


def ideal_scene(speed: float | Scalar, *, load: LoadName = "along_jaw") -> Scene:
    """The paper's crusher without clearance: the floor that a clearance adds to.

    `speed` in rad/s, constant; `load` as in `paper_scene`, which also tells what is raised.
    """
    return build_scene({"speed": speed, "joint": "ideal", "load_law": _load_law(load)})


def pe250x400() -> Machine:
    """The PE250x400 of Tables 1 and 2."""
    return build_machine({})


def _load_law(name: LoadName) -> str:
    laws = tuple(law for law in CHOICES["load_law"] if law != "none")
    require_choice("load", name, (*laws, None))
    return "none" if name is None else name
