"""The scenes of Wang, Cui, Wang, Appl. Sci. 2023, 13, 238: the PE250x400 of Tables 1 and 2."""

from jaxtyping import ArrayLike

from jaxcrusher.crusher.scene import Scene
from jaxcrusher.scenes.build import build_scene
from jaxcrusher.scenes.parameters import Value


def paper_scene(speed: ArrayLike, clearance: ArrayLike, **values: Value) -> Scene:
    """The paper's crusher with clearance in its main bearing.

    **Arguments:**

    - `speed`: of the shaft, rad/s, constant.
    - `clearance`: radial, R_i - R_j, m, in (0, 0.13).
    - `values`: any other names of `jaxcrusher.PE250X400`, as in `jaxcrusher.build_scene`, such as
      `start="contact"`, `slip="surface"`, `friction=0`, `load_law="closing_stroke"`,
      `impact_law="tracked"` or `formulation="multiplier"` (the paper's).

    Numbers may be traced. Raises ValueError as `build_scene` does.
    """
    return build_scene({"speed": speed, "clearance": clearance, **values})


def ideal_scene(speed: ArrayLike, **values: Value) -> Scene:
    """The paper's crusher without clearance: the floor that a clearance adds to.

    `speed` in rad/s, constant; `values` and what is raised as in `paper_scene`. The ideal twin of
    any other scene is `scene.ideal()`.
    """
    return build_scene({"speed": speed, **values, "joint": "ideal"})
