"""`import jaxcrusher` is light; its names come when they are asked for."""

from importlib.metadata import version

import pytest

import jaxcrusher as jc
from tests.processes import ended


def test_import_brings_no_jax():
    done = ended("-c", "import jaxcrusher, sys; assert 'jax' not in sys.modules")
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
