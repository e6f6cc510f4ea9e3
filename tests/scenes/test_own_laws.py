"""Laws of one's own by module and class: in files, sweeps, slopes and stores."""

import sys
import textwrap
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.joint.friction import SurfaceSlip
from jaxcrusher.scenes import parameters
from jaxcrusher.scenes.own_laws import with_digests
from jaxcrusher.scenes.parameters import LAWS
from jaxcrusher.scenes.reader import read_overrides, read_scene_file
from tests.differences import assert_slopes

EXAMPLES = Path(__file__).parents[2] / "examples"
SOURCE = '''
import equinox as eqx
import jax
import jax.numpy as jnp

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import scalar
from jaxcrusher.crusher.loads import AbstractLoad, JawForce
from jaxcrusher.joint.clearance import AbstractBearing, ClearanceJoint
from jaxcrusher.joint.friction import AbstractFriction, AbstractSlip
from jaxcrusher.joint.normal import AbstractImpactVelocity, AbstractNormalForce


class KelvinVoigt(AbstractNormalForce):
    """A spring and a damper that never pull."""

    impact_velocity: AbstractImpactVelocity
    spring: jax.Array = eqx.field(converter=scalar, metadata={"unit": "N/m"})
    damping: jax.Array = eqx.field(converter=scalar, metadata={"unit": "N s/m"})
    width: jax.Array = eqx.field(converter=scalar, default=1e-8)
    hertz: jax.Array = eqx.field(converter=scalar, default=0.0, metadata={"unit": "N/m^1.5"})
    odd: jax.Array = eqx.field(converter=scalar, default=0.0, metadata={"unit": "N/m^3/2"})

    def elastic_force(self, penetration):
        return self.spring * smooth.positive_part(penetration, self.width)

    def force(self, penetration, rate, memory):
        touching = smooth.step(penetration, self.width)
        whole = self.elastic_force(penetration) + self.damping * rate * touching
        return smooth.positive_part(whole - 1e-3, 1e-3)

    def elastic_energy(self, penetration):
        return self.spring * smooth.positive_power_integral(penetration, self.width, 1.0)

    def penetration_under(self, force):
        return force / self.spring


class Bushed(AbstractBearing):
    """A whole bearing: a spring that pulls its centre back, without friction."""

    bore_radius: jax.Array = eqx.field(converter=scalar)
    clearance: jax.Array = eqx.field(converter=scalar)
    impact_velocity: AbstractImpactVelocity
    rubber: jax.Array = eqx.field(converter=scalar, metadata={"unit": "N/m"})
    norm_width: jax.Array = eqx.field(converter=scalar, default=1e-9)
    friction: None = None

    @property
    def normal(self):
        return KelvinVoigt(self.impact_velocity, self.rubber, 1e-5 * self.rubber)

    def contact(self, eccentricity, rate, bearing_spin, journal_spin, memory):
        plain = ClearanceJoint(self.bore_radius, self.clearance, self.normal, None)
        return plain.contact(eccentricity, rate, bearing_spin, journal_spin, memory)

    def half_width_ratio(self, penetration):
        return jnp.zeros_like(penetration)


class Tanh(AbstractFriction):
    """Coulomb's law with a smooth sign."""

    slip: AbstractSlip
    coefficient: jax.Array = eqx.field(converter=scalar)
    speed: jax.Array = eqx.field(converter=scalar, default=0.1, metadata={"unit": "m/s"})

    def force(self, normal_force, slip_speed):
        return -self.coefficient * normal_force * jnp.tanh(slip_speed / self.speed)


class Push(AbstractLoad):
    """A constant push."""

    size: jax.Array = eqx.field(converter=scalar, metadata={"unit": "N"})

    def force(self, jaw):
        return JawForce(self.size * jaw.away, 0.3)
'''
SCENE = """
    start = "contact"
    contact_law = "{0}:KelvinVoigt"
    friction_law = "{0}:Tanh"
    load_law = "{0}:Push"
    [contact]
    spring = "5 GN/m"
    damping = "20 kN s/m"
    hertz = "2 kN/mm^1.5"
    speed = "0.2 m/s"
    [crushing]
    size = "9 kN"
"""


@pytest.fixture
def laws(tmp_path):
    """A module of this test alone, beside a scene file."""
    name, known = f"laws_{tmp_path.name}", list(sys.path)
    (tmp_path / f"{name}.py").write_text(SOURCE)
    (tmp_path / "scene.toml").write_text(textwrap.dedent(SCENE.format(name)))
    yield name
    sys.path[:] = known
    sys.modules.pop(name, None)


def test_a_scene_file_names_laws_and_their_numbers(laws, tmp_path):
    values = read_scene_file(tmp_path / "scene.toml")
    numbers = {"contact.spring": 5e9, "contact.damping": 2e4, "crushing.size": 9e3}
    assert numbers.items() <= values.items()
    assert values["contact.hertz"] == pytest.approx(2e3 * 1000**1.5, rel=1e-15)  # rounding
    scene = jc.build_scene(values)
    assert type(scene.joints.at("main").normal).__name__ == "KelvinVoigt"
    assert (
        float(scene.joints.at("main").normal.spring) == 5e9
        and float(scene.joints.at("main").friction.speed) == 0.2
    )
    # What the joint knows is given: friction's coefficient and the corner's width.
    assert float(scene.joints.at("main").friction.coefficient) == 0.1
    plain = jc.build_scene({"start": "contact"}).joints.at("main").normal
    assert float(scene.joints.at("main").normal.width) == float(plain.width)
    motion = jc.simulate(scene, [0.0], outputs=("crushing_load",))
    assert np.linalg.norm(motion.crushing_load[0]) == pytest.approx(9e3)
    # Without a default a step of one is taken, of what may be zero.
    machine = jc.read_machine(tmp_path / "scene.toml")
    spring = machine.numbers["contact.spring"]
    assert np.isnan(spring.default) and spring.scale == 1.0
    # A command line changes a number, in its unit.
    given = read_overrides([("contact.damping", "30 kN s/m")], machine)
    assert given == {"contact.damping": 3e4}
    for name, text, words in (
        ("spring", "5 kN", r"`contact\.spring` must have a unit of the kind N/m"),
        ("hertz", "5 kN/m", r"`contact\.hertz` must have a unit of the kind N/m\^1\.5"),
        ("odd", "5 N/m^3/2", r"`contact\.odd` must .* known unit, .* is in 'N/m\^3/2'"),
    ):
        with pytest.raises(ValueError, match=words):
            read_overrides([(f"contact.{name}", text)], machine)


def test_a_whole_bearing_is_a_law(laws, tmp_path):
    read_scene_file(tmp_path / "scene.toml")  # which brings the module
    values = {"contact_law": f"{laws}:Bushed", "contact.rubber": 4e9, "start": "contact"}
    orbit = jc.periodic_orbit(jc.build_scene(values))
    assert bool(orbit.success) and float(orbit.bearing_stiffness) == pytest.approx(4e9, rel=1e-9)


@pytest.mark.slow
def test_slopes_sweeps_and_lanes(laws, tmp_path):
    values = read_scene_file(tmp_path / "scene.toml")

    def rms(spring):
        orbit = jc.periodic_orbit(jc.build_scene(values | {"contact.spring": spring}))
        return orbit.foundation_rms

    # Differences over a hundredth of a force that is nearly linear in it.
    assert_slopes(rms, 5e9, 5e7, rtol=1e-3)
    machine, axes = jc.read_machine(tmp_path / "scene.toml"), {"contact.spring": [4e9, 5e9]}
    lanes, loop = (
        jc.sweep(machine, axes, 0, 1, engine=engine).foundation_rms.values
        for engine in ("lanes", "loop")
    )
    # Steps of 1e-9, other roundings.
    np.testing.assert_allclose(lanes, loop, rtol=1e-7)
    assert lanes[0] != lanes[1]


def test_a_store_knows_the_source(laws, tmp_path):
    """A law that changed is refused, before anything is mixed."""
    values = read_scene_file(tmp_path / "scene.toml")
    asked = jc.paper_machine(**values), {"speed": [30.0, 31.0]}, 0, 1
    jc.sweep(*asked, store=tmp_path / "store.zarr", engine="loop")
    before = with_digests(values)
    jc.sweep(*asked, store=tmp_path / "store.zarr", engine="loop")
    source = tmp_path / f"{laws}.py"
    source.write_text(source.read_text().replace("jnp.tanh", "jnp.sin"))
    after = with_digests(values)
    assert before["contact_law"] != after["contact_law"]
    with pytest.raises(ValueError, match="store"):
        jc.sweep(*asked, store=tmp_path / "store.zarr", engine="loop")


def test_files_that_a_law_imports_are_known_too(laws, tmp_path):
    """Directly, by another one, and by a package; not those of other folders."""
    source, values = tmp_path / f"{laws}.py", read_scene_file(tmp_path / "scene.toml")
    further = [tmp_path / "direct.py", tmp_path / "of_direct.py", tmp_path / "pack/part.py"]
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack/__init__.py").write_text("from . import part")
    (tmp_path / "beside.py").write_text("")
    source.write_text(source.read_text() + "\nif False:\n    import direct\n")
    further[0].write_text("from of_direct import size\nimport pack")
    for path in further[1:]:
        path.write_text("size = 1")
    before = with_digests(values)["contact_law"]
    (tmp_path / "beside.py").write_text("size = 2")
    assert with_digests(values)["contact_law"] == before
    for path in further:
        text = path.read_text()
        path.write_text(text + "  # another")
        assert with_digests(values)["contact_law"] != before, path
        path.write_text(text)
    assert with_digests(values)["contact_law"] == before


def test_a_curve_is_kept_by_its_content(tmp_path):
    file = tmp_path / "curve.csv"
    file.write_text("angle_deg, force_kN\n0, 1\n120, 2\n240, 3\n")
    values = {"load_law": "by_angle", "load_curve": str(file)}
    before = with_digests(values)
    file.write_text("angle_deg, force_kN\n0, 1\n120, 2\n240, 4\n")
    assert with_digests(values)["load_curve"] != before["load_curve"]
    assert with_digests({"speed": 30.0}) == {"speed": 30.0}


def test_refusals(laws, tmp_path):
    jc.build_scene(read_scene_file(tmp_path / "scene.toml"))
    (tmp_path / f"{laws}_unfinished.py").write_text("class Law(\n")
    kind = "a class of AbstractNormalForce or AbstractBearing as module:Class"
    for values, words in (
        ({"contact_law": "no_such_module:Law"}, "`contact_law` must name a module"),
        # Modules that Python cannot import, or that stop while it does.
        ({"contact_law": ":Law"}, "`contact_law` must name a module, but :Law: ValueError: Empty"),
        ({"contact_law": "..laws:Law"}, "`contact_law` must name a module, but ..laws:Law: Type"),
        ({"contact_law": f"{laws}_unfinished:Law"}, "must name a module, but .*: SyntaxError: "),
        ({"contact_law": "jaxcrusher.joint.normal:AbstractNormalForce"}, kind),
        ({"contact_law": f"{laws}:Nothing"}, kind),
        ({"contact_law": f"{laws}:Tanh"}, kind),
        ({"contact_law": f"{laws}:KelvinVoigt"}, "`contact.spring` must be given"),
        ({"contact_law": f"{laws}:Bushed"}, r"`contact\.rubber` must be given"),
        ({"load_law": f"{laws}:Push", "crushing.weight": 1.0}, "must be a known name"),
    ):
        with pytest.raises(ValueError, match=words) as error:
            jc.build_scene(values)
        assert "\n" not in str(error.value)


def test_a_law_of_cylinders_has_the_modulus_of_two_alike_bodies():
    """1 / E* is the sum of (1 - nu^2) / E of pin and bore (Hertz)."""
    law = "jaxcrusher.joint.cylinders:Johnson"
    normal = (
        jc.build_scene({"contact_law": law, "young": 200e9, "poisson": 0.3})
        .joints.at("main")
        .normal
    )
    assert 1 / float(normal.modulus) == pytest.approx(2 * 0.91 / 200e9, rel=1e-14)  # rounding


def test_a_number_of_two_laws_is_refused():
    """A width in m/s of friction must not become a corner of the contact, in m."""
    here = "jaxcrusher.joint"
    laws = {
        "contact_law": f"{here}.cylinders:Johnson",
        "friction_law": f"{here}.friction:Stribeck",
    }
    friction = jc.build_scene(laws).joints.at("main").friction
    assert friction is not None and friction.width == 0.01
    for prefix, section in (("", "contact"), ("elbow.", "elbow")):
        both = {f"{prefix}{name}": law for name, law in laws.items()}
        loose = {"elbow.clearance": 1e-4, f"{section}.width": 0.02}
        with pytest.raises(ValueError, match=f"`{section}.width` must be a number of one law"):
            jc.build_scene(loose | both)


def test_an_elbow_has_a_law_of_its_own(laws, tmp_path):
    read_scene_file(tmp_path / "scene.toml")
    values = {"elbow.contact_law": f"{laws}:KelvinVoigt", "elbow.clearance": 1e-4}
    scene = jc.build_scene(values | {"elbow.spring": 1e9, "elbow.damping": 1e3})
    assert float(scene.joints.at("elbow").normal.spring) == 1e9
    assert type(scene.joints.at("main").normal).__name__ == "LankaraniNikravesh"
    # Its slip and its impact velocity are parts there too, no choice and no number.
    values = {"elbow.friction_law": f"{laws}:Tanh", "elbow.slip": "surface", **values}
    values |= {"elbow.spring": 1e9, "elbow.damping": 1e3, "elbow.impact_velocity": 0.3}
    elbow = jc.build_scene(values).joints.at("elbow")
    assert isinstance(elbow.friction.slip, SurfaceSlip)
    assert float(elbow.normal.impact_velocity.value(None)) == 0.3
    whole = {"elbow.contact_law": f"{laws}:Bushed", "elbow.rubber": 1e7, "elbow.clearance": 1e-4}
    assert jc.build_scene(whole).joints.at("elbow").friction is None


LINKAGE = """
    [joints.B]
    contact_law = "{0}:KelvinVoigt"
    spring = "5 GN/m"
    damping = "20 kN s/m"
    friction_law = "{0}:Tanh"
    speed = "0.2 m/s"
    friction = 0.1
"""


def test_a_joint_of_a_linkage_has_a_law_of_its_own(laws, tmp_path):
    """Its numbers are keys of the joint, in their units, and are known to the machine alone."""
    pump, path = (EXAMPLES / "pump.toml").read_text(), tmp_path / "mine.toml"
    kept = [line for line in pump.splitlines() if not line.startswith(("friction =", "impact_v"))]
    own = textwrap.dedent(LINKAGE.format(laws)).replace("[joints.B]\n", "")
    path.write_text("\n".join(kept).replace("[joints.B]", f"[joints.B]\n{own}"))
    machine = jc.read_machine(path, [("joints.B.damping", "30 kN s/m")])
    joint = machine.scene().joints["B"]
    assert type(joint.normal).__name__ == "KelvinVoigt" and float(joint.normal.spring) == 5e9
    assert float(joint.normal.damping) == 3e4 and float(joint.friction.speed) == 0.2
    assert float(joint.friction.coefficient) == 0.1
    assert machine.numbers["joints.B.spring"].unit == "N/m"
    assert machine.units["joints.B.damping"] == "kN s/m"
    softer = machine.scene(**{"joints.B.spring": 1e9}).joints["B"]
    assert float(softer.normal.spring) == 1e9
    slope = jax.grad(lambda k: machine.scene(**{"joints.B.spring": k}).joints["B"].normal.spring)
    assert float(slope(5e9)) == 1.0
    for old, new, words in (
        ('spring = "5 GN/m"', "", "`joints.B.spring` must be given for"),
        ('spring = "5 GN/m"', 'sprig = "5 GN/m"', "`joints.B.sprig` must be .*; did you mean joi"),
        ('spring = "5 GN/m"', "spring = 5e9", "`joints.B.spring` must have a unit"),
        (f'friction_law = "{laws}:Tanh"', "", "`joints.B.speed` must be a known key"),
        (f"{laws}:KelvinVoigt", f"{laws}:Tanh", "a class of AbstractNormalForce or AbstractBear"),
    ):
        path.write_text(path.read_text().replace(old, new))
        with pytest.raises(ValueError, match=words) as error:
            jc.read_machine(path)
        assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)
        path.write_text("\n".join(kept).replace("[joints.B]", f"[joints.B]\n{own}"))


def test_reading_changes_no_table(laws, tmp_path):
    """Two files in either order, or one twice, are the same; a law's numbers go with its file."""
    tables = (parameters.PARAMETERS, parameters.NUMBERS, parameters.CHOICES, parameters.FILES)
    before = [dict(table) for table in (*tables, LAWS)]
    paths = [tmp_path / "scene.toml", EXAMPLES / "four_bar.toml", EXAMPLES / "pe250x400.toml"]
    read = [
        [jc.read_machine(path) for path in (*order, paths[0])] for order in (paths, paths[::-1])
    ]
    for machine in read[0]:
        for other in [one for one in read[1] if one.given == machine.given]:
            assert other.values == machine.values and dict(other.numbers) == dict(machine.numbers)
            assert other.units == machine.units
    assert [one.given for one in read[0][:3]] == [one.given for one in read[1][2::-1]]
    assert [dict(table) for table in (*tables, LAWS)] == before
    for table in (*tables, LAWS, LAWS["slip"]):
        with pytest.raises(TypeError):
            table["new"] = 1
    # The law of another file has left nothing behind.
    path = tmp_path / "plain.toml"
    path.write_text('[contact]\nspring = "5 GN/m"')
    for call, words in (
        (lambda: jc.read_machine(path), "known key, but is not; there"),
        (lambda: read_overrides([("contact.spring", "5 GN/m")]), "known key"),
        (lambda: jc.build_scene({"contact.spring": 5e9}), "known name"),
    ):
        with pytest.raises(ValueError, match=rf"`contact\.spring` must be a {words}"):
            call()


def test_a_law_whose_unit_is_none_of_the_si_is_refused(laws, tmp_path):
    """Numbers of a description are in SI units, so that a field of mm would be a thousand off."""
    source = tmp_path / f"{laws}.py"
    source.write_text(source.read_text().replace('"unit": "N s/m"', '"unit": "kN s/m"'))
    with pytest.raises(ValueError, match=r"`contact\.damping` must be of a law that gives its fie"):
        jc.read_machine(tmp_path / "scene.toml")
