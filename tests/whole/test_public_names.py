"""`import jaxcrusher` is light; its names come when they are asked for."""

from importlib.metadata import version

import pytest

import jaxcrusher as jc
from tests.processes import ended


def test_import_brings_no_jax():
    done = ended("-c", "import jaxcrusher, sys; assert 'jax' not in sys.modules")
    assert done.returncode == 0, done.stderr


def test_a_scene_by_numbers_brings_no_units_tables_and_pictures():
    """They take long to import, and no orbit needs them."""
    heavy = "{'pint', 'dask', 'xarray', 'matplotlib', 'scipy.integrate', 'zarr', 'numba'}"
    program = (
        "import jaxcrusher as jc, sys; jc.set_up(); jc.paper_scene(30.0, 6e-5); jc.periodic_orbit; "
        f"assert not {heavy} & set(sys.modules), {heavy} & set(sys.modules)"
    )
    done = ended("-c", program)
    assert done.returncode == 0, done.stderr


def test_every_name_of_the_package_is_there():
    names = dir(jc)
    assert len(names) > 20 and {"simulate", "Scene", "STATISTICS"} < set(names)
    for name in names:
        assert getattr(jc, name) is not None
    # What a type checker reads is what is there.
    from jaxcrusher.motion.simulation import simulate

    assert jc.simulate is simulate
    # No function hides a module of its name.
    import jaxcrusher.motion.statistics as module

    assert module.statistics is jc.statistics and not callable(module)


def test_the_version_is_that_of_the_installed_package():
    assert jc.__version__ == version("jaxcrusher")


def test_other_names_are_refused():
    with pytest.raises(AttributeError, match="simulat"):
        _ = jc.simulat
    with pytest.raises(ImportError, match="cannot import name 'simulat'"):
        from jaxcrusher import simulat  # noqa: F401
