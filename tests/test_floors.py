"""Each room imports only rooms on the floors below, so that arrows go one way."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = ("jaxcrusher", "optimize", "benchmarks")
# From the ground up; rooms of one floor do not know each other.
FLOORS = (
    ("jaxcrusher.version",),
    ("jaxcrusher.basics",),
    ("jaxcrusher.files",),
    ("jaxcrusher.joint", "jaxcrusher.lanes", "jaxcrusher.periodic"),
    ("jaxcrusher.mechanism",),
    ("jaxcrusher.crusher",),
    ("jaxcrusher.scenes", "jaxcrusher.motion"),
    ("jaxcrusher.orbits", "jaxcrusher.batch"),
    (
        "jaxcrusher.dynamics",
        "jaxcrusher.identification",
        "jaxcrusher.pictures",
        "jaxcrusher.sheets",
    ),
    ("jaxcrusher",),  # the public names
    ("jaxcrusher.commands", "jaxcrusher.testing", "optimize.ask"),
    ("jaxcrusher.__main__", "optimize.answer"),
    ("optimize.search",),
    ("optimize.tell",),
    ("optimize",),
    ("benchmarks",),
)
LEVEL = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}
# What may stand beside the rooms.
GROUND = {"__init__.py", "__init__.pyi", "__main__.py", "testing.py", "version.py"}


def room(module: str) -> str:
    """The room of a module: the longest name in `LEVEL` that leads to it."""
    parts = module.split(".")
    names = (".".join(parts[:i]) for i in range(len(parts), 0, -1))
    return next(name for name in names if name in LEVEL)


def imported(source: str) -> set[str]:
    """Modules and names of the project that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "a relative import hides its room"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.split(".")[0] in PROJECT}


def upward(module: str, source: str) -> list[str]:
    """The imports of a module that do not lead down."""
    here = room(module)
    rooms = {name: room(name) for name in imported(source)}
    return [
        f"{module} imports {name}"
        for name, there in rooms.items()
        if there != here and LEVEL[there] >= LEVEL[here]
    ]


def test_imports_lead_down():
    found = []
    for top in PROJECT:
        for path in (ROOT / top).rglob("*.py"):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            found += upward(module, path.read_text())
    assert found == []


def test_an_import_that_leads_up_is_found():
    upwards = "def late():\n    from jaxcrusher.motion.statistics import statistics\n"
    assert upward("jaxcrusher.crusher.template", upwards) != []
    assert upward("jaxcrusher.orbits.result", "from jaxcrusher.sheets import severity") != []
    assert upward("jaxcrusher.batch.sweep", "from jaxcrusher.orbits import orbit") != []
    assert upward("jaxcrusher.orbits.orbit", "from jaxcrusher.motion import tangents") == []


def test_rooms_have_one_docstring_and_little_stands_beside_them():
    for name in LEVEL:
        start = ROOT.joinpath(*name.split("."), "__init__.py")
        if name != "jaxcrusher" and start.exists():
            assert len(ast.parse(start.read_text()).body) == 1, start
    assert {path.name for path in (ROOT / "jaxcrusher").glob("*.py*")} == GROUND
