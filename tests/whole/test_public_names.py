"""`import jaxcrusher` is light; its names come when they are asked for."""

import subprocess
import sys
from importlib.metadata import version

import pytest

import jaxcrusher as jc


def test_import_brings_no_jax():
    done = subprocess.run(
        [sys.executable, "-c", "import jaxcrusher, sys; assert 'jax' not in sys.modules"],
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )
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
