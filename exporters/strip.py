"""Several outlines side by side in one SVG drawing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.exporters.names import printable
from d4cad.exporters.svg import FILL, STROKE, face_path
from d4cad.files import replacing
from d4cad.sketch import Sketch

FOOT = 0.12
"""Height of the captions as a share of an outline's own height."""


def strip_svg(outlines: Sequence[tuple[str, Sketch]], canvas: Canvas) -> str:
    """Outlines in world units, each on the whole ``canvas``, from left to right with a caption below each.

    Raises InputError for none.
    """
    if not outlines:
        raise InputError("expected at least one outline")
    half_width, half_height = canvas.extent
    width, height = 2 * half_width, 2 * half_height
    foot, line = FOOT * height, 0.004 * max(width, height)
    groups = []
    for k, (caption, sketch) in enumerate(outlines):
        paths = "\n".join(f'    <path d="{face_path(face)}"/>' for face in sketch.faces)
        text = escape(printable(caption))
        groups.append(
            f'<g transform="translate({k * width!r} 0)">\n'
            f'  <g fill="{FILL}" fill-rule="evenodd" stroke="{STROKE}" stroke-width="{line!r}">\n'
            f"{paths}\n  </g>\n"
            f'  <text x="0" y="{half_height + foot / 2!r}" font-family="sans-serif" font-size="{foot / 2!r}" '
            f'text-anchor="middle" fill="{STROKE}">{text}</text>\n</g>'
        )
    box = f"{-half_width!r} {-half_height!r} {len(outlines) * width!r} {height + foot!r}"
    size = f'width="{round(200 * len(outlines))}" height="{round(200 * (height + foot) / width)}"'
    body = "\n".join(groups)
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="{box}">\n{body}\n</svg>\n'


def write_strip(outlines: Sequence[tuple[str, Sketch]], canvas: Canvas, path: str | Path) -> None:
    """Write :func:`strip_svg` to a file. Raises ExportError."""
    text = strip_svg(outlines, canvas)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
