"""What the site's build adds to MkDocs: formulas as MathML, and the examples as pages' files.

MathML is drawn by browsers themselves: no script, no font and no network.
"""

import html
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

# What pymdownx.arithmatex makes of $...$ and $$...$$.
_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)

_BOLD = re.compile(r'<mi mathvariant="bold">([A-Za-z])</mi>')
# A bar is a bracket, without the room of an operator.
_ANY_BAR = re.compile(r'<mo(?: stretchy="false")?>&#x0007C;</mo>')
_BAR = '<mo stretchy="false" lspace="0" rspace="0">|</mo>'


def on_files(files, config):
    """Put the examples, which pages name by their place in the repository, into the site."""
    examples = Path(config.config_file_path).parent / "examples"
    for path in sorted([*examples.glob("*.toml"), *examples.glob("*.csv")]):
        uri = f"examples/{path.name}"
        files.append(File.generated(config, uri, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Lead links to the examples to their copies in the site."""
    return markdown.replace("](../examples/", "](examples/")


def on_page_content(content, page, config, files):
    """Turn formulas into MathML; a formula that cannot be read ends the build."""
    content = _INLINE.sub(lambda found: mathml(found[1], "inline"), content)
    return _BLOCK.sub(lambda found: mathml(found[1], "block"), content)


def mathml(formula: str, display: str) -> str:
    """Return a formula of TeX as MathML; PluginError where it cannot be read."""
    formula = html.unescape(formula).strip()
    made = convert(formula, display=display)
    # The converter shows what it does not know, and closes what is left open.
    if "\\" in made or formula.count("{") != formula.count("}"):
        raise PluginError(f"This formula cannot be read: {formula}")
    # Browsers draw bold letters of their own, and no longer letters made bold.
    made = _BOLD.sub(lambda found: f"<mi>{_bold(found[1])}</mi>", made)
    return _ANY_BAR.sub(_BAR, made)


def _bold(letter: str) -> str:
    """The mathematical bold letter, upright."""
    first, place = ("A", 0x1D400) if letter.isupper() else ("a", 0x1D41A)
    return chr(place + ord(letter) - ord(first))
