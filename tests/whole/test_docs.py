"""The site builds without a warning and leaves no name out; Python blocks run as they stand."""

import ast
import re
import zlib
from pathlib import Path

import pytest
import yaml

from tests.processes import ended

ROOT = Path(__file__).parents[2]
# Pages of the API begin with an example, of which these compute.
EXAMPLES = ("capacity", "formulations", "identification", "joint", "periodic", "scenes", "search")
# Not for users: entry points and what they are made of.
PRIVATE = ("__main__", "commands")


def python_blocks(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The site, built as its readers build it."""
    site = tmp_path_factory.mktemp("site")
    done = ended("-m", "mkdocs", "build", "--strict", "--site-dir", str(site), cwd=ROOT)
    assert done.returncode == 0, done.stderr
    formulas = (site / "model.html").read_text()
    assert formulas.count("<math") > 50 and "arithmatex" not in formulas
    # A table that follows a line of text stays text.
    assert [page.name for page in site.rglob("*.html") if "|---" in page.read_text()] == []
    return site


@pytest.fixture(scope="module")
def documented(site) -> set[str]:
    """The names with an entry of their own in the site."""
    # Sphinx's format: four lines of header, then a name and its place a line.
    inventory = zlib.decompress((site / "objects.inv").read_bytes().split(b"\n", 4)[4]).decode()
    return {line.split()[0] for line in inventory.splitlines()}


def linked(page: Path) -> set[Path]:
    """Pages that a page of the site links to."""
    links = re.findall(r'<a [^>]*href="([^":#?]+\.html)', page.read_text())
    return {(page.parent / link).resolve() for link in links}


@pytest.mark.slow
def test_every_page_is_at_most_two_clicks_from_the_first(site):
    site = site.resolve()
    first = {site / "index.html"}
    once = first.union(*map(linked, first))
    pages = {path for path in site.rglob("*.html") if path.name != "404.html"}
    assert len(pages) > 50
    assert pages - once.union(*map(linked, once)) == set()


def test_no_list_of_the_navigation_is_longer_than_fifteen():
    sections = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]
    lists = [pages for section in sections for pages in section.values()]
    assert max(map(len, [sections, *lists])) <= 15
    # What a section holds stands on its first page.
    assert all(pages[0].endswith("index.md") for pages in lists)


@pytest.mark.slow
def test_every_public_name_is_documented(documented):
    exported = ast.parse((ROOT / "jaxcrusher" / "__init__.pyi").read_text()).body
    names = [
        f"jaxcrusher.{line.module}.{line.names[0].name}"
        for line in exported
        if line.names[0].name != "__version__"
    ]
    assert len(names) > 20
    assert sorted(set(names) - documented) == []


@pytest.mark.slow
def test_every_module_is_documented(documented):
    folder = ROOT / "jaxcrusher"
    paths = [path.relative_to(ROOT).with_suffix("") for path in folder.rglob("*.py")]
    modules = {
        ".".join(path.parts)
        for path in paths
        if path.name != "__init__" and not set(path.parts) & set(PRIVATE)
    }
    assert len(modules) > 30
    assert sorted(modules - documented) == []


@pytest.mark.slow
def test_an_override_has_the_text_of_what_it_overrides(site):
    page = (site / "api/joint.html").read_text()
    text = page.partition('id="jaxcrusher.joint.friction.Stribeck.force"')[2]
    assert "whose slip is counted positive" in text.partition("Source code")[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [
        "docs/index.md",
        "docs/model.md",
        "docs/loads.md",
        "docs/linkages.md",
        "docs/mechanism.md",
        "docs/roller_bearing.md",
        # Its steps at a loose tolerance are those of programs compiled as users have them.
        pytest.param("docs/numerics.md", marks=pytest.mark.optimised),
        "docs/gradients.md",
        "docs/lanes.md",
        "docs/orbits.md",
        pytest.param("docs/periodic.md", marks=pytest.mark.optimised),
        "docs/design_search.md",
        "docs/own_parts.md",
        "docs/foundation.md",
        "docs/identification.md",
        "docs/rough_feed.md",
        *(f"docs/api/{name}.md" for name in EXAMPLES),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_blocks_of_a_page_run(page, capsys, tmp_path, monkeypatch):
    """In a folder of their own, where they leave what they write."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    namespace: dict = {"__name__": page}
    blocks = python_blocks(page)
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), namespace)
    assert "nan" not in capsys.readouterr().out


@pytest.mark.slow
def test_processes_of_the_page_on_sweeps_find_what_their_parent_does(tmp_path):
    """Spawned, they import the file that they are of."""
    (block,) = (one for one in python_blocks("docs/large_sweeps.md") if "spawn" in one)
    (tmp_path / "several.py").write_text(block)
    done = ended("several.py", cwd=tmp_path)
    assert done.stdout == "True\n", done.stderr


@pytest.mark.slow
def test_blocks_of_the_readme_run_in_a_fresh_process():
    """The first of them sets JAX up."""
    blocks = python_blocks("README.md")
    assert blocks
    done = ended("-W", "error::UserWarning", "-c", "\n".join(blocks), cwd=ROOT)
    assert done.returncode == 0, done.stderr
    # What it says that they print, up to the dots of what is left out.
    printed = re.findall(r"```text\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[0]
    for said, line in zip(printed.splitlines(), done.stdout.splitlines(), strict=True):
        assert line.startswith(said.split(", ...")[0]), line
