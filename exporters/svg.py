"""SVG drawings whose arcs stay arcs."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

from d4cad.errors import InputError
from d4cad.exporters.color import hexadecimal
from d4cad.exporters.kerf import compensated
from d4cad.exporters.names import printable
from d4cad.files import replacing
from d4cad.loop import Loop, Point
from d4cad.sketch import Face, Sketch

FILL = "#c9d6e8"
STROKE = "#1f3a5f"
CUT = "#ff0000"
HAIRLINE = 0.01
"""Width in mm of what is to be cut: laser drivers take lines thinner than about 0.02 mm for a cut."""

STYLES = ("fill", "cut")
NEARLY_HALF = (0.8, 1.25)
"""Bulges of arcs that are written as two. SVG gives an arc by its radius, and close to a semicircle its middle is found
from the small difference of radius and half chord: half the digits would be lost."""


FLATTEST = 1e-8
"""Bulge below which a line is closer than what a reader makes of the arc: its centre is 1e8 chords away, in doubles."""


def require_style(style: str) -> str:
    """The style. Raises InputError unless it is one of STYLES."""
    if style not in STYLES:
        raise InputError(f"the style of an SVG drawing must be {' or '.join(STYLES)}, got {style!r}")
    return style


def svg(sketch: Sketch, *, style: str = "fill", color: str | None = None, name: str | None = None) -> str:
    """The sketch as an SVG document, y down, sized in mm where the sketch is; coordinates to the last digit.

    ``style``: "fill" draws each face as one even-odd path of class "face"; "cut" draws each loop once as a hairline
    without fill, of class "inner" or "outer", a part's holes before its outline. ``color``: of the fill or of the
    hairline. ``name``: the title. Raises InputError for an empty sketch, an unknown style or colour.
    """
    if not sketch.faces:
        raise InputError("an empty sketch cannot be drawn: it has no faces")
    cut = require_style(style) == "cut"
    xmin, ymin, xmax, ymax = sketch.bounds
    line = HAIRLINE if cut else 0.004 * max(xmax - xmin, ymax - ymin)
    left, top, width, height = xmin - line, -ymax - line, xmax - xmin + 2 * line, ymax - ymin + 2 * line
    size = f'width="{_number(width)}mm" height="{_number(height)}mm" ' if sketch.unit == "mm" else ""
    if cut:
        look = f'fill="none" stroke="{CUT if color is None else hexadecimal(color)}"'
    else:
        look = f'fill="{FILL if color is None else hexadecimal(color)}" fill-rule="evenodd" stroke="{STROKE}"'
    title = "" if name is None else f"<title>{escape(printable(name))}</title>\n"
    paths = "\n".join(_cuts(sketch) if cut else _fills(sketch))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}'
        f'viewBox="{_number(left)} {_number(top)} {_number(width)} {_number(height)}">\n{title}'
        f'<g {look} stroke-width="{_number(line)}" stroke-linejoin="round">\n{paths}\n</g>\n</svg>\n'
    )


def write_svg(
    sketch: Sketch,
    path: str | Path,
    *,
    kerf: float | None = None,
    style: str = "fill",
    color: str | None = None,
    name: str | None = None,
) -> None:
    """Writes :func:`svg` to a file.

    ``kerf``: mm that the cutter takes away, see :func:`d4cad.exporters.kerf.compensated`. Raises InputError as
    :func:`svg` does and for a bad kerf, ExportError if the file cannot be written.
    """
    text = svg(compensated(sketch, kerf), style=style, color=color, name=name)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


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
    for start, end, b in edges:
        if NEARLY_HALF[0] < abs(b) < NEARLY_HALF[1]:
            (x0, y0), (x1, y1) = start, end
            top = (x0 + x1 + b * (y1 - y0)) / 2, (y0 + y1 - b * (x1 - x0)) / 2
            half = b / (1 + (1 + b * b) ** 0.5)  # tan(a / 2) of b = tan(a)
            parts += [_edge(start, top, half), _edge(top, end, half)]
        else:
            parts.append(_edge(start, end, b))
    return "".join(parts) + "Z"


def _fills(sketch: Sketch) -> list[str]:
    return [f'  <path id="face-{k}" class="face" d="{face_path(face)}"/>' for k, face in enumerate(sketch.faces, 1)]


def _cuts(sketch: Sketch) -> list[str]:
    paths = []
    for k, face in enumerate(sketch.faces, 1):
        for h, hole in enumerate(face.holes, 1):
            paths.append(f'  <path id="inner-{k}-{h}" class="inner" d="{loop_path(hole)}"/>')
        paths.append(f'  <path id="outer-{k}" class="outer" d="{loop_path(face.outer)}"/>')
    return paths


def _edge(start: Point, end: Point, b: float) -> str:
    (x0, y0), (x1, y1) = start, end
    where = f"{_number(x1)} {_number(-y1)}"
    if abs(b) < FLATTEST:
        return f"L{where}"
    radius = _number(((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5 * (1 + b * b) / (4 * abs(b)))
    return f"A{radius} {radius} 0 {int(abs(b) > 1)} {int(b < 0)} {where}"


def _number(value: float) -> str:
    """The shortest decimal that reads back as the same number."""
    return repr(float(value) + 0.0).removesuffix(".0")  # adding 0 turns -0 into 0
