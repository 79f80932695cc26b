"""SVG drawings, through svgelements: paths and basic shapes under any transforms, circular arcs kept."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from math import pi, tan
from typing import Any, NamedTuple

import numpy as np

from d4cad.edges import Complexes
from d4cad.errors import InputError
from d4cad.importers.drawing import Drawing, Outlines, assembled, nonzero, within_any
from d4cad.importers.strokes import CORNER, SAMPLING, Stroke, fitted
from d4cad.joining import joined
from d4cad.loop import ROUNDING, Loop, checked

DPI = 96.0
"""Pixels per inch of CSS and SVG."""

SVGELEMENTS_INCH = 1 / 0.0393701
"""mm in an inch as svgelements has it, for lengths in mm and cm."""

ROUND = 1e-8
"""Relative difference of an arc's radii that is rounding: files hold about ten digits."""

WHITE = 0xFFFFFF

PATH_DATA = re.compile(r"[MmZzLlHhVvCcSsQqTtAaEe0-9+\-.,\s]*")


def read_svg(data: bytes, tolerance: float, gap: float, layers: Sequence[str]) -> Drawing:
    """The closed outlines of an SVG file, as :func:`d4cad.importers.read` describes.

    y is turned up, the origin is the page's lower left corner, or where no page is stated the file's own. Without
    units a pixel is 1/96 inch. A filled path is closed as SVG closes it; a white filled shape around everything is
    background. SVG has no layers: InputError if any are asked for.
    """
    if layers:
        raise InputError("layers can be chosen in DXF drawings only")
    if not data.strip():
        raise InputError("it is empty")
    page = _parsed(data)
    unit = _unit(page)
    height = float(page.height) if page.values.get("height") or page.viewbox else 0.0
    shapes: list[_Shape] = []
    strokes: list[Stroke] = []
    segments, notes = 0, []
    if not re.search(r"[a-z]", str(page.values.get("width") or "")):
        notes.append(f"the drawing states no unit: {DPI:g} pixels per inch assumed")
    skipped: dict[str, int] = {}
    for element in page.elements():
        kind = type(element).__name__
        if kind in ("Text", "Image"):
            skipped[kind.lower()] = skipped.get(kind.lower(), 0) + 1
        if not _is_shape(element):
            continue
        shape, loose = _read(element, tolerance / unit)
        segments += shape.segments
        shapes.append(_placed(shape, unit, height))
        strokes += [_up(stroke, unit, height) for stroke in loose]
    if skipped:
        notes.append(f"left out, as no outline: {', '.join(f'{n} {kind}' for kind, n in sorted(skipped.items()))}")
    kept = _without_ground(shapes)
    if len(kept) < len(shapes):
        notes.append("white background left out")
    return assembled([Outlines(shape.loops) for shape in kept if shape.loops], strokes, gap, segments, notes)


class _Shape(NamedTuple):
    """The loops of one element. white: whether it is filled white and not stroked. segments: how many it is drawn
    with."""

    loops: tuple[Loop, ...]
    white: bool
    segments: int


def _parsed(data: bytes) -> Any:
    from xml.etree.ElementTree import ParseError

    import svgelements

    try:
        page = svgelements.SVG.parse(io.BytesIO(data), reify=True, ppi=DPI, on_error="raise")
    except ParseError as error:
        raise InputError(f"it is not SVG: {error}") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        text = " ".join(str(error).split())
        raise InputError(f"its SVG is damaged ({text[:120] or 'a number is missing or wrong'})") from None
    if not isinstance(page, svgelements.SVG) or page.values.get("tag") != "svg":
        raise InputError("it is not SVG: it has no svg element")
    return page


def _unit(page: Any) -> float:
    """mm per pixel of svgelements: exact where the page is in mm, cm or inches."""
    width = str(page.values.get("width") or "").strip()
    return SVGELEMENTS_INCH / DPI if width.endswith(("mm", "cm")) else 25.4 / DPI


def _is_shape(element: Any) -> bool:
    """Whether an element is drawn."""
    import svgelements

    if not isinstance(element, svgelements.Shape):
        return False
    if element.values.get("visibility") == "hidden":
        return False
    return _filled(element) or (element.stroke is not None and element.stroke.value is not None)


def _filled(element: Any) -> bool:
    # svgelements has no fill for "none" as well as for none given; SVG's default is black
    if element.fill is not None and element.fill.value is not None:
        return True
    return element.values.get("fill") is None and "fill" not in (element.values.get("attributes") or {})


def _read(element: Any, tolerance: float) -> tuple[_Shape, list[Stroke]]:
    """The loops of an element and, if it is not filled, its open strokes, in pixels."""
    import svgelements

    wrong = PATH_DATA.fullmatch(str(element.values.get("d") or "")) is None
    if wrong:
        raise InputError("its path data holds what is neither a command nor a number")
    path = svgelements.Path(element)
    filled = _filled(element)
    loops, loose, segments = [], [], 0
    for subpath in _subpaths(path):
        segments += sum(segment.start != segment.end for segment in subpath)
        stroke = _stroke(subpath, filled, tolerance)
        if stroke is None:
            continue
        if stroke.points[0] == stroke.points[-1]:
            if stroke.bulges.size > 1:
                loops.append(_tidy(stroke.loop))
        else:
            loose.append(stroke)
    if filled and element.values.get("fill-rule") != "evenodd":
        loops = list(nonzero(loops))
    white = filled and element.fill.value is not None and (element.fill.value >> 8) == WHITE
    stroked = element.stroke is not None and element.stroke.value is not None
    return _Shape(tuple(loops), white and not stroked, segments), loose


def _tidy(loop: Loop) -> Loop:
    """Without what repeats: zero-length edges, and joints on one line or circle."""
    loop = checked(loop, "an outline")
    return joined(loop, ROUNDING * loop.extent)


def _subpaths(path: Any) -> Iterator[list[Any]]:
    import svgelements

    segments: list[Any] = []
    for segment in path:
        if isinstance(segment, svgelements.Move):
            if segments:
                yield segments
            segments = []
        else:
            segments.append(segment)
            if isinstance(segment, svgelements.Close):
                yield segments
                segments = []
    if segments:
        yield segments


class _Part(NamedTuple):
    """One segment: its ends if it is a line or an arc with a bulge, points on it if it is another curve (bulge
    None)."""

    points: Complexes
    bulge: float | None


def _stroke(segments: Sequence[Any], filled: bool, tolerance: float) -> Stroke | None:
    """The segments of a subpath as one stroke; consecutive curves are fitted together. None if it has no length."""
    parts = [part for part in (_part(segment, tolerance) for segment in segments) if part is not None]
    if not parts:
        return None
    first, last = parts[0].points[0], parts[-1].points[-1]
    closed = type(segments[-1]).__name__ == "Close"
    if abs(first - last) <= ROUNDING * _reach(parts):
        parts[-1].points[-1] = first
        closed = True
    elif filled or closed:
        parts.append(_Part(np.array([last, first]), 0.0))
        closed = True
    groups = _groups(parts, closed)
    strokes = [
        Stroke(group[0].points, np.array([group[0].bulge]))
        if group[0].bulge is not None
        else fitted(np.concatenate([group[0].points, *(part.points[1:] for part in group[1:])]), tolerance)
        for group in groups
    ]
    strokes = [stroke for stroke in strokes if stroke.bulges.size]
    if not strokes:
        return None
    points = np.concatenate([strokes[0].points, *(stroke.points[1:] for stroke in strokes[1:])])
    if closed:
        points[-1] = points[0]
    return Stroke(points, np.concatenate([stroke.bulges for stroke in strokes]))


def _reach(parts: Sequence[_Part]) -> float:
    z = np.concatenate([part.points for part in parts])
    return max(float(np.ptp(z.real)), float(np.ptp(z.imag)))


def _groups(parts: Sequence[_Part], closed: bool) -> list[list[_Part]]:
    """Runs of curves that go on smoothly, and the other parts one by one; a closed path begins where a run does."""
    breaks = [k for k in range(len(parts)) if not _smooth(parts[k - 1], parts[k])]
    if closed and not breaks:
        return [list(parts)]
    if not closed:
        breaks = sorted({0, *breaks})
    parts = [*parts[breaks[0] :], *parts[: breaks[0]]]
    marks = {k - breaks[0] for k in breaks}
    groups: list[list[_Part]] = []
    for k, part in enumerate(parts):
        if k in marks:
            groups.append([part])
        else:
            groups[-1].append(part)
    return groups


def _smooth(before: _Part, after: _Part) -> bool:
    """Whether both are curves and the second goes on in the first one's direction."""
    if before.bulge is not None or after.bulge is not None:
        return False
    a, b = before.points[-1] - before.points[-2], after.points[1] - after.points[0]
    # chords of the curves turn by as much again as they span
    bend = abs(np.angle((before.points[-1] - before.points[-2]) / (before.points[-2] - before.points[-3])))
    bend += abs(np.angle((after.points[2] - after.points[1]) / (after.points[1] - after.points[0])))
    return bool(abs(np.angle(b / a)) <= CORNER + bend)


def _part(segment: Any, tolerance: float) -> _Part | None:
    """One segment of a path; None if it has no length."""
    import svgelements

    if segment.start is None or segment.end is None:
        return None
    z0, z1 = complex(segment.start), complex(segment.end)
    if isinstance(segment, svgelements.Arc):
        return _arc(segment, z0, z1, tolerance)
    if isinstance(segment, svgelements.CubicBezier):
        return _bezier([z0, complex(segment.control1), complex(segment.control2), z1], tolerance)
    if isinstance(segment, svgelements.QuadraticBezier):
        return _bezier([z0, complex(segment.control), z1], tolerance)
    return None if z0 == z1 else _Part(np.array([z0, z1]), 0.0)


def _arc(segment: Any, z0: complex, z1: complex, tolerance: float) -> _Part | None:
    rx, ry, sweep = float(segment.rx), float(segment.ry), float(segment.sweep)
    if z0 == z1 or rx == 0 or ry == 0:
        return None if z0 == z1 else _Part(np.array([z0, z1]), 0.0)
    if abs(rx - ry) <= ROUND * rx and abs(sweep) < 2 * pi - 1e-6:
        half = abs(z1 - z0) / 2
        # the sweep of a semicircle hangs on the last digits of its radius
        bulge = np.copysign(1.0, sweep) if abs(rx - half) <= ROUND * rx else tan(sweep / 4)
        return _Part(np.array([z0, z1]), float(bulge))
    step = 2 * np.sqrt(2 * max(SAMPLING * tolerance / max(rx, ry), 1e-7))
    z = np.asarray(segment.npoint(np.linspace(0, 1, max(int(np.ceil(abs(sweep) / step)), 4) + 1)))
    points = np.array(z[:, 0] + 1j * z[:, 1])
    points[0], points[-1] = z0, z1
    return _Part(points, None)


def _bezier(control: Sequence[complex], tolerance: float) -> _Part | None:
    """A chord over a step h of the parameter is at most h^2 / 8 max |z''| from the curve."""
    c = np.array(control)
    if np.abs(c - c[0]).max() == 0:
        return None
    degree = c.size - 1
    bend = degree * (degree - 1) * float(np.abs(np.diff(c, 2)).max())
    size = float(np.abs(c - c[0]).max())
    n = int(np.clip(np.ceil(np.sqrt(bend / (8 * max(SAMPLING * tolerance, 1e-7 * size)))), 4, 4000))
    t = np.linspace(0, 1, n + 1)
    rows = np.repeat(c[:, None], t.size, axis=1)
    while len(rows) > 1:  # de Casteljau
        rows = rows[:-1] * (1 - t) + rows[1:] * t
    points = rows[0]
    points[0], points[-1] = c[0], c[-1]
    return _Part(points, None)


def _up(stroke: Stroke, unit: float, height: float) -> Stroke:
    """A stroke of pixels, y down, in mm, y up."""
    points = stroke.points.real + 1j * (height - stroke.points.imag)
    return Stroke(np.asarray(points * unit), 0.0 - stroke.bulges)


def _placed(shape: _Shape, unit: float, height: float) -> _Shape:
    loops = tuple(
        Loop(tuple((x * unit, (height - y) * unit) for x, y in loop.points), tuple(0.0 - b for b in loop.bulges))
        for loop in shape.loops
    )
    return shape._replace(loops=loops)


def _without_ground(shapes: Sequence[_Shape]) -> list[_Shape]:
    """The shapes without white ones that lie in no other one."""
    loops = [loop for shape in shapes for loop in shape.loops]
    return [s for s in shapes if not (s.white and s.loops and not within_any(s.loops[0], loops))]
