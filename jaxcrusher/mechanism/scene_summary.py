"""What a scene says of itself, and how a notebook shows it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from jaxcrusher.files import svg
from jaxcrusher.files.summary import Row, Summary, value_text
from jaxcrusher.mechanism.motion import ideal_at_rest
from jaxcrusher.mechanism.topology import FRAME

if TYPE_CHECKING:
    from jaxcrusher.mechanism.scene import Scene
else:
    Scene = Any  # which calls these functions

# Radius of a joint as it is drawn, as a share of the linkage; one with clearance has twice as much.
DRAWN = 0.02


def summary_of(scene: Scene) -> Summary:
    """Return drive, joints, masses and loads of a scene, and what can be asked of it."""
    linkage, gaps = scene.linkage, scene.joints
    ideal = [name for name in (*linkage.joints.names, *linkage.slides.names) if name not in gaps]
    masses = [f"{name} {value_text(body.mass, 'kg')}" for name, body in linkage.bodies.items()]
    loads = [f"{type(push).__name__} at the {push.body}" for push in scene.pushes]
    loads += [f"{len(scene.springs)} springs"] if scene.springs else []
    foundation, count = scene.foundation, len(gaps)
    rows = [Row("drive", value_text(scene.drive.speed, "rad/s"), type(scene.drive).__name__)]
    for name, gap in gaps.items():
        rows.append(Row(name, f"clearance {value_text(gap.clearance, 'm')}", type(gap).__name__))
    rows += [
        Row("ideal joints", ", ".join(ideal) or "none"),
        Row("masses", ", ".join(masses)),
        Row("loads", ", ".join(loads) or "none"),
        Row("frame", "clamped" if foundation is None else type(foundation).__name__),
        Row("observables", f"{len(scene.observables)} in scene.observables, with units"),
        Row("statistics", f"{len(scene.statistics)} in scene.statistics, with units"),
    ]
    loose = f"{count} with clearance" if count else "all ideal"
    bodies, joints = len(linkage.bodies), len(linkage.joints) + len(linkage.slides)
    return Summary(f"Scene of {bodies} bodies and {joints} joints, {loose}", rows)


def sketch_of(scene: Scene) -> str:
    """Return the joints of a linkage at angle zero, and lines between those of each body."""
    motion, lines, rings = ideal_at_rest(scene.linkage, 0.0), {}, []
    for name, joint in scene.linkage.joints.items():
        for point in (joint.bore, joint.pin):
            lines.setdefault(point.body, []).append(motion.position(point).array())
        rings.append((*motion.position(joint.pin).array(), 2 if name in scene.joints else 1))
    lines.pop(FRAME, None)
    size = DRAWN * float(np.ptp([place for line in lines.values() for place in line], axis=0).max())
    return svg.path_in_circles(
        [np.array([*line, line[0]]) for line in lines.values()],
        "crank at angle zero; a joint with clearance is wide",
        [(x, y, width * size) for x, y, width in rings],
    )
