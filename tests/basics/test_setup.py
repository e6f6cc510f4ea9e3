"""The call that sets a process up: each case in a process of its own, which has not yet started."""

import os
import subprocess
import sys

LOOP = (
    "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1000000000"
    ",xla_cpu_disable_new_fusion_emitters"
)
OURS = ("XLA_FLAGS", "EQX_ON_ERROR", "JAX_COMPILATION_CACHE_DIR", "JAX_ENABLE_X64")

# Counts the programs that JAX compiles and does not find in its folder.
COUNTED = """
import warnings
import jaxcrusher as jc
jc.set_up()
import jax
missed = []
def listen(event, **_):
    if event.endswith("cache_misses"):
        missed.append(event)
jax.monitoring.register_event_listener(listen)
scene = jc.paper_scene(30.0, 6e-5, start="contact")
rms = jc.statistics(scene, 0, 1, outputs=("foundation_rms",), rtol=1e-6).foundation_rms
print(len(missed), float(rms).hex())
"""


def python(program: str, **environment: str) -> subprocess.CompletedProcess:
    """Run a program in a fresh process, which this one's settings do not reach."""
    inherited = {name: value for name, value in os.environ.items() if name not in OURS}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=inherited | environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done


def test_second_process_compiles_nothing_and_finds_the_same_bits(tmp_path):
    first, second = (python(COUNTED, XDG_CACHE_HOME=str(tmp_path)).stdout.split() for _ in "12")
    assert int(first[0]) > 0 and int(second[0]) == 0
    assert first[1] == second[1]


def test_folder_that_cannot_be_made_is_no_error(tmp_path):
    (tmp_path / "file").touch()
    program = "import jaxcrusher as jc; jc.set_up(); import jax; print(jax.numpy.ones(1).dtype)"
    done = python(f"{program}", XDG_CACHE_HOME=str(tmp_path / "file"))
    assert done.stdout.strip() == "float64" and done.stderr == ""


def test_flags_of_the_user_stay():
    mine = "--xla_backend_extra_options=a=1 --xla_force_host_platform_device_count=3"
    program = "import jaxcrusher as jc; jc.set_up(); import os; print(os.environ['XLA_FLAGS'])"
    assert python(program, XLA_FLAGS=mine).stdout.strip() == f"{mine} {LOOP}"


def test_garbage_is_looked_for_less_often_and_where_the_user_says_so():
    program = "import gc\nimport jaxcrusher as jc\njc.set_up()\nprint(gc.get_threshold()[0])"
    assert python(program).stdout == "50000\n"
    assert python(f"import gc\ngc.set_threshold(90_000)\n{program}").stdout == "90000\n"
    assert python(f"import gc\ngc.disable()\ngc.set_threshold(0)\n{program}").stdout == "0\n"


def test_one_device_a_core():
    program = "import jaxcrusher as jc; jc.set_up(); import jax; print(jax.device_count())"
    assert int(python(program).stdout) == len(os.sched_getaffinity(0))


def test_late_call_says_what_to_do():
    program = "import jax; jax.numpy.ones(1); import jaxcrusher as jc; jc.set_up(); jc.set_up()"
    said = python(program).stderr
    cores = len(os.sched_getaffinity(0))
    flags = f"{LOOP} --xla_force_host_platform_device_count={cores}"
    assert f"start Python with XLA_FLAGS='{flags}'" in said


def test_batch_without_it_says_so_once():
    program = """
import jax
jax.config.update("jax_enable_x64", True)
import jaxcrusher as jc
for _ in range(2):
    list(jc.map_chunks(abs, jax.numpy.ones(3)))
"""
    assert python(program).stderr.count("after jaxcrusher.set_up()") == 1
    late = program.replace("import jax\n", "import jaxcrusher as jc\njc.set_up()\nimport jax\n", 1)
    assert python(late).stderr == ""
