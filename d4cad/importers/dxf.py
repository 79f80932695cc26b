"""DXF drawings: lines, arcs, circles, polylines with bulges, ellipses, splines and blocks of them, through ezdxf."""

from __future__ import annotations

import io
import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import isfinite, radians
from typing import TYPE_CHECKING, Any

import numpy as np

from d4cad.edges import Complexes, Floats, cross
from d4cad.errors import GeometryError, InputError
from d4cad.importers.drawing import Drawing, assembled
from d4cad.importers.strokes import SAMPLING, Stroke, arc, fitted, line

if TYPE_CHECKING:
    from ezdxf.document import Drawing as Document

UNITS = {0: 1.0, 1: 25.4, 2: 304.8, 4: 1.0, 5: 10.0, 6: 1e3, 8: 2.54e-5, 9: 0.0254, 10: 914.4, 13: 1e-3, 14: 100.0}
"""mm in each $INSUNITS that a part may be drawn in: none, inches, feet, mm, cm, m, microinches, mils, yards,
micrometres, decimetres (DXF reference, header variables)."""

DEEPEST = 16
"""Blocks within blocks that are followed."""

MOST = 200_000
"""Strokes of a drawing; a few lines of blocks within blocks can ask for billions."""

SMALLEST = 1e-7
"""Least distance between curve and chord as a share of the curve's size: what is far larger than a part stays few
points."""

FINEST = 24
"""Halvings of a spline's parameter, at most."""

FLAT = 1e-9
"""Largest slope of an entity's plane, and relative difference of the axes of an ellipse that is a circle."""

DAMAGED = (
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    AssertionError,
    RecursionError,
    EOFError,
    StopIteration,
)
"""What ezdxf raises, besides its own errors, on files that are damaged."""


def read_dxf(data: bytes, tolerance: float, gap: float, layers: Sequence[str]) -> Drawing:
    """The closed outlines in the modelspace of a DXF file, as :func:`d4cad.importers.read` describes.

    $INSUNITS says what one unit is; mm where it says nothing. Layers that are off or frozen are not read. Text,
    dimensions, hatches and what lies out of the plane are left out, with a note.
    """
    from ezdxf.lldxf.const import DXFError

    if not data.strip():
        raise InputError("it is empty")
    try:
        document = _document(data)
        reader = _Reader(document, tolerance, _wanted(document, layers))
        for entity in document.modelspace():
            reader.take(entity, entity.dxf.layer, 0)
    except (InputError, GeometryError):
        raise
    except (DXFError, *DAMAGED) as error:
        raise InputError(f"its DXF is damaged ({_reason(error)})") from None
    return assembled((), reader.strokes, gap, reader.segments, reader.notes)


def _document(data: bytes) -> Document:
    """The parsed file. Raises what ezdxf raises."""
    import ezdxf
    from ezdxf.lldxf.validator import is_dxf_stream

    logging.getLogger("ezdxf").addHandler(
        logging.NullHandler()
    )  # else its remarks go to stderr where nobody set up logs
    if data.startswith(b"AutoCAD Binary DXF"):
        return _from_file(data)
    head = data[:4096].decode("latin-1").replace("\r\n", "\n")
    if not is_dxf_stream(io.StringIO(head)):
        raise InputError("it is not DXF")
    encoding = ezdxf.filemanagement.dxf_stream_info(io.StringIO(data.decode("latin-1").replace("\r\n", "\n"))).encoding
    text = data.decode(encoding, errors="surrogateescape").replace("\r\n", "\n")
    return ezdxf.read(io.StringIO(text))


def _from_file(data: bytes) -> Document:
    """A binary DXF, which ezdxf reads by name only."""
    import tempfile
    from pathlib import Path

    import ezdxf

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawing.dxf"
        path.write_bytes(data)
        return ezdxf.readfile(path)


def _reason(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return text[:120] if text else type(error).__name__


def _wanted(document: Document, layers: Sequence[str]) -> set[str]:
    """Names, in lower case, of the layers to read. Raises InputError for one that the drawing does not have."""
    names = {layer.dxf.name.lower(): layer.dxf.name for layer in document.layers}
    names |= {entity.dxf.layer.lower(): entity.dxf.layer for entity in document.modelspace()}
    for layer in layers:
        if layer.lower() not in names:
            raise InputError(f"it has no layer {layer!r}, only {', '.join(sorted(names.values()))}")
    if layers:
        return {layer.lower() for layer in layers}
    hidden = {layer.dxf.name.lower() for layer in document.layers if layer.is_off() or layer.is_frozen()}
    return set(names) - hidden - {"defpoints"}


@dataclass
class _Reader:
    """Collects strokes, in mm, and what was left out."""

    document: Document
    tolerance: float
    layers: set[str]
    strokes: list[Stroke] = field(default_factory=list)
    segments: int = 0
    left_out: Counter[str] = field(default_factory=Counter)

    @property
    def unit(self) -> float:
        """mm per drawing unit."""
        units = self.document.units
        if units not in UNITS:
            raise InputError(f"its $INSUNITS is {units}, expected one of {', '.join(map(str, UNITS))}")
        return UNITS[units]

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence each on the unit and on what was left out."""
        found = [] if self.document.units else ["the drawing states no unit: mm assumed"]
        if self.left_out:
            listed = ", ".join(f"{n} {kind}" for kind, n in sorted(self.left_out.items()))
            found.append(f"left out, as no outline: {listed}")
        return tuple(found)

    def take(self, entity: Any, layer: str, depth: int) -> None:
        """Adds the strokes of an entity. layer: what it is on, layer 0 of a block being that of its insertion."""
        kind = entity.dxftype()
        if kind == "INSERT":
            self._take_block(entity, layer, depth)
            return
        if layer.lower() not in self.layers:
            return
        read = _KINDS.get(kind)
        if read is None:
            self.left_out[kind] += 1
        elif abs(_normal(entity)[0]) > FLAT or abs(_normal(entity)[1]) > FLAT:
            self.left_out[f"{kind} out of the plane"] += 1
        else:
            found = [Stroke(s.points * self.unit, s.bulges) for s in read(entity, self.tolerance / self.unit)]
            self.strokes += found
            self.segments += _pieces(entity) if kind in ("SPLINE", "ELLIPSE") else sum(s.bulges.size for s in found)
        if len(self.strokes) > MOST:
            raise InputError(f"it has more than {MOST} strokes")

    def _take_block(self, insert: Any, layer: str, depth: int) -> None:
        if depth >= DEEPEST:
            raise InputError(f"its block {insert.dxf.name!r} is nested over {DEEPEST} deep")
        if insert.mcount > MOST:
            raise InputError(f"it has more than {MOST} strokes")
        for single in insert.multi_insert() if insert.mcount > 1 else (insert,):
            for entity in single.virtual_entities():
                self.take(entity, layer if entity.dxf.layer == "0" else entity.dxf.layer, depth + 1)


def _pieces(curve: Any) -> int:
    """Number of polynomial pieces of a spline; 1 of an ellipse."""
    return _breaks(curve.construction_tool()).size - 1 if curve.dxftype() == "SPLINE" else 1


def _normal(entity: Any) -> tuple[float, float, float]:
    x, y, z = entity.dxf.get("extrusion", (0, 0, 1)) if entity.dxf.is_supported("extrusion") else (0, 0, 1)
    return float(x), float(y), float(z)


def _facing(entity: Any) -> float:
    """-1 for an entity that is seen from behind, as mirrored ones are, else 1."""
    return -1.0 if _normal(entity)[2] < 0 else 1.0


def _world(entity: Any, point: Any) -> complex:
    """A point in the entity's own coordinates."""
    x, y, _ = entity.ocs().to_wcs((point[0], point[1], point[2] if len(point) > 2 else 0.0))
    return complex(x, y)


def _line(entity: Any, tolerance: float) -> Iterator[Stroke]:
    a, b = entity.dxf.start, entity.dxf.end
    yield line(complex(a.x, a.y), complex(b.x, b.y))


def _arc(entity: Any, tolerance: float) -> Iterator[Stroke]:
    start = radians(entity.dxf.start_angle)
    sweep = radians((entity.dxf.end_angle - entity.dxf.start_angle) % 360.0) or 2 * np.pi
    yield _placed_arc(entity, start, sweep)


def _circle(entity: Any, tolerance: float) -> Iterator[Stroke]:
    yield _placed_arc(entity, 0.0, 2 * np.pi)


def _placed_arc(entity: Any, start: float, sweep: float) -> Stroke:
    centre = _world(entity, entity.dxf.center)
    if _facing(entity) < 0:  # x runs the other way
        start, sweep = np.pi - start, -sweep
    return arc(centre, abs(float(entity.dxf.radius)), start, sweep)


def _lwpolyline(entity: Any, tolerance: float) -> Iterator[Stroke]:
    corners = [(_world(entity, (x, y, 0.0)), b * _facing(entity)) for x, y, b in entity.get_points("xyb")]
    yield from _polyline(corners, entity.closed)


def _old_polyline(entity: Any, tolerance: float) -> Iterator[Stroke]:
    if not (entity.is_2d_polyline or entity.is_3d_polyline):
        raise InputError("it has a mesh, which is no outline")
    corners = []
    for vertex in entity.vertices:
        if vertex.dxf.flags & 16:  # a control point of the curve, not on it
            continue
        at = vertex.dxf.location
        z = _world(entity, at) if entity.is_2d_polyline else complex(at.x, at.y)
        corners.append((z, (vertex.dxf.bulge if entity.is_2d_polyline else 0.0) * _facing(entity)))
    yield from _polyline(corners, entity.is_closed)


def _polyline(corners: Sequence[tuple[complex, float]], closed: bool) -> Iterator[Stroke]:
    """Vertices and the bulges of the edges that leave them; repeated vertices count once."""
    if closed and corners:
        corners = [*corners, corners[0]]
    kept = [k for k in range(len(corners) - 1) if corners[k][0] != corners[k + 1][0]]
    if kept:
        points = np.array([corners[k][0] for k in kept] + [corners[kept[-1] + 1][0]])
        yield Stroke(points, np.array([corners[k][1] for k in kept], dtype=np.float64))


def _ellipse(entity: Any, tolerance: float) -> Iterator[Stroke]:
    a, c = entity.dxf.major_axis, entity.dxf.center
    major, centre, ratio = complex(a.x, a.y), complex(c.x, c.y), float(entity.dxf.ratio)
    start = float(entity.dxf.start_param)
    sweep = (float(entity.dxf.end_param) - start) % (2 * np.pi)
    if sweep < FLAT or 2 * np.pi - sweep < FLAT:
        sweep = 2 * np.pi
    facing = _facing(entity)
    if abs(abs(ratio) - 1) <= FLAT:
        turn = facing * np.sign(ratio)
        yield arc(centre, abs(major), float(np.angle(major)) + turn * start, turn * sweep)
        return
    # R (1 - cos(step / 2)) for the largest radius of curvature bounds the distance of the chords
    step = 2 * np.sqrt(2 * max(SAMPLING * tolerance / max(abs(major), 1e-300), SMALLEST))
    t = start + np.linspace(0, sweep, max(int(np.ceil(sweep / step)), 8) + 1)
    z = centre + major * np.cos(t) + 1j * facing * ratio * major * np.sin(t)
    if sweep == 2 * np.pi:
        z[-1] = z[0]
    yield fitted(np.asarray(z), tolerance)


def _spline(entity: Any, tolerance: float) -> Iterator[Stroke]:
    curve = entity.construction_tool()
    size = max((abs(complex(p.x, p.y) - complex(curve.control_points[0].x, curve.control_points[0].y))
                for p in curve.control_points), default=0.0)  # fmt: skip
    if not (isfinite(size) and size > 0):
        raise GeometryError("it has a spline without a size")
    z = _flattened(curve, max(SAMPLING * tolerance, SMALLEST * size))
    if abs(z[-1] - z[0]) <= FLAT * size or entity.closed:
        z = np.append(z[:-1], z[0]) if abs(z[-1] - z[0]) <= FLAT * size else np.append(z, z[0])
    yield fitted(z, tolerance)


def _breaks(curve: Any) -> Floats:
    """Parameters between which a B-spline is one polynomial each, in order; at least two.

    A curve of degree p with n control points is defined from knot p to knot n only, counted from 0 (de Boor, A
    Practical Guide to Splines, IX): the knots outside, which closed splines have, shape it but are none of its points.
    """
    knots = np.array(curve.knots())
    low, high = knots[curve.degree], knots[curve.count]
    if not low < high:
        raise GeometryError("it has a spline without a length")
    return np.unique(knots[(knots >= low) & (knots <= high)])


def _flattened(curve: Any, distance: float) -> Complexes:
    """Points of a B-spline between which its middle is nowhere ``distance`` or more from the chord."""

    def at(t: Floats) -> Complexes:
        return np.array([complex(p.x, p.y) for p in curve.points(t.tolist())])

    breaks = _breaks(curve)
    t = np.interp(np.arange(8 * (breaks.size - 1) + 1) / 8, np.arange(breaks.size), breaks)
    z = at(t)
    new = np.ones(t.size - 1, dtype=np.bool_)
    for _ in range(FINEST):
        k = np.flatnonzero(new)
        middle = (t[k] + t[k + 1]) / 2
        found = at(middle)
        chord = z[k + 1] - z[k]
        off = np.abs(cross(chord, found - z[k])) / np.maximum(np.abs(chord), 1e-300)
        bent = off >= distance
        if not bent.any():
            break
        t, z = np.insert(t, k[bent] + 1, middle[bent]), np.insert(z, k[bent] + 1, found[bent])
        new = np.zeros(t.size - 1, dtype=np.bool_)
        first = k[bent] + np.arange(np.count_nonzero(bent))
        new[first] = new[first + 1] = True
    return z


_KINDS = {
    "LINE": _line,
    "ARC": _arc,
    "CIRCLE": _circle,
    "LWPOLYLINE": _lwpolyline,
    "POLYLINE": _old_polyline,
    "ELLIPSE": _ellipse,
    "SPLINE": _spline,
}
