"""SVG drawings whose arcs stay arcs."""

from __future__ import annotations

from pathlib import Path

from d4cad.errors import InputError
from d4cad.files import replacing
from d4cad.loop import Loop
from d4cad.sketch import Face, Sketch

FILL = "#c9d6e8"
STROKE = "#1f3a5f"


def svg(sketch: Sketch) -> str:
    """The sketch as an SVG document: one even-odd path per face, y down, sized in mm where the sketch is.

    Coordinates are the sketch's with y negated, ten significant digits. Raises InputError for an empty sketch.
    """
    if not sketch.faces:
        raise InputError("an empty sketch cannot be drawn: it has no faces")
    xmin, ymin, xmax, ymax = sketch.bounds
    line = 0.004 * max(xmax - xmin, ymax - ymin)
    left, top, width, height = xmin - line, -ymax - line, xmax - xmin + 2 * line, ymax - ymin + 2 * line
    size = f'width="{_number(width)}mm" height="{_number(height)}mm" ' if sketch.unit == "mm" else ""
    paths = "\n".join(f'  <path d="{face_path(face)}"/>' for face in sketch.faces)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}'
        f'viewBox="{_number(left)} {_number(top)} {_number(width)} {_number(height)}">\n'
        f'<g fill="{FILL}" fill-rule="evenodd" stroke="{STROKE}" stroke-width="{_number(line)}" '
        f'stroke-linejoin="round">\n{paths}\n</g>\n</svg>\n'
    )


def write_svg(sketch: Sketch, path: str | Path) -> None:
    """Writes :func:`svg` to a file. Raises ExportError if that fails."""
    text = svg(sketch)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def face_path(face: Face) -> str:
    """The path data of all loops of a face."""
    return " ".join(loop_path(loop) for loop in face.loops)


def loop_path(loop: Loop) -> str:
    """Path data of one closed loop. Counter-clockwise stays so to the eye, which in SVG, with y down, is sweep 0."""
    x, y = loop.points[0]
    parts = [f"M{_number(x)} {_number(-y)}"]
    ends = (*loop.points[1:], loop.points[0])
    edges = list(zip(loop.points, ends, loop.bulges, strict=True))
    if edges[-1][2] == 0:
        edges.pop()  # Z draws it
    for (x0, y0), (x1, y1), b in edges:
        end = f"{_number(x1)} {_number(-y1)}"
        if b == 0:
            parts.append(f"L{end}")
        else:
            radius = _number(((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5 * (1 + b * b) / (4 * abs(b)))
            parts.append(f"A{radius} {radius} 0 {int(abs(b) > 1)} {int(b < 0)} {end}")
    return "".join(parts) + "Z"


def _number(value: float) -> str:
    return f"{value + 0.0:.10g}"  # adding 0 turns -0 into 0
