"""Films of a figure: its pictures as PNG, and files of them: GIF, MP4, a page with a player."""

import base64
import io
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import jinja2
import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from jaxcrusher.basics.checks import require, require_choice, require_whole
from jaxcrusher.files.durable import writing

SUFFIXES = (".gif", ".html", ".mp4")
PAGE = Path(__file__).with_name("film.html")
# Colours of a film: drawings have few, and each further one makes files larger. They are those of
# some of its pictures.
COLOURS, SOME = 64, 8


def require_film(path: Path, frames_per_second: int) -> None:
    """Check that a film can be written: before its pictures are drawn, which takes longest.

    Raises ValueError for another suffix than `SUFFIXES`, and for .mp4 without ffmpeg.
    """
    require_whole("frames_per_second", frames_per_second, 1)
    require_choice("path", path.suffix, SUFFIXES)
    good = path.suffix != ".mp4" or FFMpegWriter.isAvailable()
    require(good, "path", "end in .gif or .html where ffmpeg is not installed", path.suffix)


def pictures_of(
    figure: Figure, show: Callable[[int], None], instants: Sequence[int], dpi: float
) -> Iterator[bytes]:
    """Yield the figure as PNG after `show` has moved it to each of `instants`."""
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    show(instants[0])
    # Laid out once: the pictures must not wobble.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")

    def drawn(instant: int) -> np.ndarray:
        show(instant)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    # One palette for all, from some of them: an arrow or a dot is not in every picture.
    some = np.concatenate([drawn(i) for i in instants[:: max(1, len(instants) // SOME)]])
    palette = Image.fromarray(some).quantize(COLOURS, Image.Quantize.FASTOCTREE)
    for instant in instants:
        picture, kept = Image.fromarray(drawn(instant)), io.BytesIO()
        picture.quantize(palette=palette, dither=Image.Dither.NONE).save(kept, "png")
        yield kept.getvalue()


def write_film(
    path: Path, pictures: Sequence[bytes], frames_per_second: int, title: str, caption: str = ""
) -> None:
    """Write pictures (PNG) as a film of the kind that the suffix of `path` says.

    A page has the title and the caption. Raises ValueError as `require_film` does.
    """
    require_film(path, frames_per_second)
    with writing(path) as partial:
        if path.suffix == ".html":
            partial.write_text(_page(pictures, frames_per_second, title, caption), "utf-8")
        elif path.suffix == ".gif":
            first, *others = (Image.open(io.BytesIO(picture)) for picture in pictures)
            each = round(1000 / frames_per_second)  # ms
            first.save(partial, save_all=True, append_images=others, duration=each, loop=0)
        else:
            _encode(partial, pictures, frames_per_second)


def _page(pictures: Sequence[bytes], frames_per_second: int, title: str, caption: str) -> str:
    """Return a page with its pictures in it, and a player that needs nothing else."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(PAGE.read_text(encoding="utf-8")).render(
        title=title,
        caption=caption,
        pictures=[base64.b64encode(picture).decode() for picture in pictures],
        milliseconds=1000 / frames_per_second,
    )


def _encode(path: Path, pictures: Sequence[bytes], frames_per_second: int) -> None:
    """Write a film by ffmpeg; H.264 in even sizes is what every player knows."""
    taken = ["-f", "image2pipe", "-c:v", "png", "-framerate", str(frames_per_second), "-i", "-"]
    made = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p"]
    line = [FFMpegWriter.bin_path(), "-loglevel", "error", *taken, *made, "-y", str(path)]
    done = subprocess.run(line, input=b"".join(pictures), capture_output=True, check=False)
    if done.returncode:
        raise RuntimeError(f"ffmpeg failed: {done.stderr.decode(errors='replace').strip()}")
