"""Exact plane geometry of a part: faces bounded by loops of lines and circular arcs. No pixels here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from d4cad.edges import Edges, Floats, boxes, chords, meetings, neighbour_meetings, windings
from d4cad.errors import GeometryError
from d4cad.joining import joined
from d4cad.loop import ROUNDING, Circle, Loop, Point, checked

__all__ = ["Circle", "Face", "Loop", "Point", "Sketch"]

NeutralEdge = dict[str, Any]
NeutralLoops = list[list[NeutralEdge]]


@dataclass(frozen=True, slots=True)
class Face:
    """One connected region: inside ``outer`` (counter-clockwise) and outside every hole (clockwise)."""

    outer: Loop
    holes: tuple[Loop, ...] = ()

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The outer loop, then the holes."""
        return (self.outer, *self.holes)

    @property
    def area(self) -> float:
        """Area, holes taken off, in the sketch's unit squared."""
        return sum(loop.area for loop in self.loops)


@dataclass(frozen=True, slots=True)
class Sketch:
    """Disjoint faces in one plane, y up.

    ``unit``: what one unit of length is, "world" or "mm".

    >>> square = Loop.polyline([(0, 0), (4, 0), (4, 4), (0, 4)])
    >>> plate = Sketch.from_loops([square, Circle((2, 2), 1).loop()], "mm")
    >>> len(plate.faces), len(plate.faces[0].holes), round(plate.area, 6)
    (1, 1, 12.858407)
    """

    faces: tuple[Face, ...]
    unit: str = "world"

    @classmethod
    def from_loops(cls, loops: Iterable[Loop], unit: str = "world") -> Sketch:
        """Nests disjoint simple loops by depth into faces with holes; islands in holes are faces of their own.

        The loops may come in any order and orientation. Zero-length edges are dropped. Raises GeometryError, saying
        which loop and where, if a loop is not finite, has fewer than two edges of any length or encloses no
        area, or if edges cross, touch or overlap (closer than 1e-9 of the extent).
        """
        good = tuple(checked(loop, f"loop {k}") for k, loop in enumerate(loops))
        if good:
            _refuse_meetings(good)
        return cls(_nested(good), unit)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Every loop: face by face, the outer one first."""
        return tuple(loop for face in self.faces for loop in face.loops)

    @property
    def area(self) -> float:
        """Exact area in units squared."""
        return sum(face.area for face in self.faces)

    @property
    def length(self) -> float:
        """Length of all edges."""
        return sum(loop.length for loop in self.loops)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Exact xmin, ymin, xmax, ymax. Raises GeometryError for a sketch without faces."""
        if not self.faces:
            raise GeometryError("an empty sketch has no bounds")
        box = np.array([face.outer.bounds for face in self.faces])
        low, high = box[:, :2].min(axis=0), box[:, 2:].max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    @property
    def primitives(self) -> int:
        """Number of edges as they are, a full circle counting two; joined first if it comes from `simplified`."""
        return sum(len(loop.points) for loop in self.loops)

    def simplified(self, tolerance: float) -> Sketch:
        """Fewer edges, every loop within ``tolerance``, a length in `unit`: see :func:`d4cad.joining.joined`."""
        return self._mapped([joined(loop, tolerance) for loop in self.loops], self.unit)

    def scaled(self, factor: float, unit: str = "mm") -> Sketch:
        """All coordinates times ``factor``, which must be positive and finite, now in ``unit``."""
        if not (factor > 0 and isfinite(factor)):
            raise GeometryError(f"the scale of a sketch must be positive and finite, got {factor}")
        return self._mapped([loop.scaled(factor) for loop in self.loops], unit)

    def translated(self, dx: float, dy: float) -> Sketch:
        """The sketch moved by (dx, dy)."""
        return self._mapped([loop.translated(dx, dy) for loop in self.loops], self.unit)

    def polygon(self, tolerance: float) -> list[Floats]:
        """One polygon (n, 2) for each of `loops`, its corners on the loop and its sides within ``tolerance``."""
        return [loop.polygon(tolerance) for loop in self.loops]

    def to_neutral(self) -> NeutralLoops:
        """Loops as lists of lines {"type", "start", "end"} and arcs, which have the DXF "bulge" as well."""
        return [[_neutral(i, loop) for i in range(len(loop.points))] for loop in self.loops]

    @classmethod
    def from_neutral(cls, loops: Sequence[Sequence[NeutralEdge]], unit: str = "world") -> Sketch:
        """Reads what `to_neutral` writes; an arc may have "bulge_height", its signed sagitta, in place of "bulge".

        Raises GeometryError for a loop that is open (an end over 1e-6 of the loop's extent from the next start),
        for an edge that is neither line nor arc, and as :meth:`from_loops`.
        """
        return cls.from_loops([loop_from_neutral(loop, f"loop {k}") for k, loop in enumerate(loops)], unit)

    def _mapped(self, loops: Sequence[Loop], unit: str) -> Sketch:
        rest = iter(loops)
        faces = tuple(Face(next(rest), tuple(next(rest) for _ in face.holes)) for face in self.faces)
        return Sketch(faces, unit)


def loop_from_neutral(edges: Sequence[NeutralEdge], name: str = "a loop") -> Loop:
    """One loop of the neutral format; see :meth:`Sketch.from_neutral`. ``name`` begins the error messages."""
    if len(edges) < 2:
        raise GeometryError(f"{name} needs at least 2 edges, got {len(edges)}")
    try:
        parts = [(_point(e["start"]), _point(e["end"]), _bulge(e)) for e in edges]
    except (KeyError, TypeError, ValueError) as error:
        raise GeometryError(f"{name} has an edge that is not a line or arc with start and end: {error}") from error
    starts = np.array([p[0] for p in parts])
    gaps = np.abs(np.array([p[1] for p in parts]) - np.roll(starts, -1, axis=0)).max(axis=1)
    span = float(np.ptp(starts, axis=0).max())
    if np.any(gaps > 1e-6 * span):
        i = int(np.argmax(gaps))
        x, y = parts[i][1]
        raise GeometryError(f"{name} is open at ({x:g}, {y:g}): edge {i} ends {gaps[i]:g} from where the next begins")
    return Loop(tuple(p[0] for p in parts), tuple(p[2] for p in parts))


def _point(value: Any) -> Point:
    x, y = value
    return float(x), float(y)


def _bulge(edge: NeutralEdge) -> float:
    if edge["type"] == "line":
        return 0.0
    if edge["type"] != "arc":
        raise ValueError(f"type {edge['type']!r}")
    if "bulge" in edge:
        return float(edge["bulge"])
    (x0, y0), (x1, y1) = edge["start"], edge["end"]
    chord = float(np.hypot(x1 - x0, y1 - y0))
    if chord == 0:
        raise ValueError("an arc whose ends coincide")
    return 2 * float(edge["bulge_height"]) / chord


def _neutral(i: int, loop: Loop) -> NeutralEdge:
    start, end, bulge = loop.points[i], loop.points[(i + 1) % len(loop.points)], loop.bulges[i]
    ends = {"start": list(start), "end": list(end)}
    return {"type": "line", **ends} if bulge == 0 else {"type": "arc", **ends, "bulge": bulge}


def _nested(loops: Sequence[Loop]) -> tuple[Face, ...]:
    """Faces of disjoint loops: even depth bounds material, odd depth is a hole of the loop one level up.

    Disjoint loops lie wholly inside or outside each other, so that one vertex of each decides.
    """
    first = np.array([complex(*loop.points[0]) for loop in loops])
    inside = np.array([windings(loop.edges, first) != 0 for loop in loops]).reshape(len(loops), len(loops))
    np.fill_diagonal(inside, False)  # inside[a, b]: loop b lies in loop a
    depth = inside.sum(axis=0)
    faces = []
    for a in np.flatnonzero(depth % 2 == 0).tolist():
        holes = np.flatnonzero(inside[a] & (depth == depth[a] + 1)).tolist()
        faces.append(Face(loops[a].oriented(), tuple(loops[h].oriented(clockwise=True) for h in holes)))
    return tuple(faces)


class Meeting(NamedTuple):
    """Where two edges meet that may not: loops ``first`` and ``second``, which may be one, at x + iy."""

    first: int
    second: int
    place: complex


def meetings_of(loops: Sequence[Loop]) -> list[Meeting]:
    """The places where two edges of finite loops meet other than at the vertex they share."""
    parts = [loop.edges for loop in loops]
    e = Edges(*(np.concatenate([part[k] for part in parts]) for k in range(3)))
    sizes = np.array([part.b.size for part in parts])
    owner = np.repeat(np.arange(len(loops)), sizes)
    begin = np.cumsum(sizes) - sizes
    place = np.arange(owner.size) - begin[owner]
    following = begin[owner] + (place + 1) % sizes[owner]
    box = boxes(e)
    extent = float((box[:, 2:].max(axis=0) - box[:, :2].min(axis=0)).max())
    touch = min(ROUNDING * extent, 0.1 * float(chords(e).min()))
    found = _listed(neighbour_meetings(e, e.take(following), touch), owner, owner)
    i, j = _near_pairs(box, touch)
    apart = (following[i] != j) & (following[j] != i)
    i, j = i[apart], j[apart]
    return found + _listed(meetings(e.take(i), e.take(j), touch), owner[i], owner[j])


def _refuse_meetings(loops: Sequence[Loop]) -> None:
    """Raises GeometryError at the first place where two edges meet other than at the vertex they share."""
    for a, b, where in meetings_of(loops):
        other = "itself" if a == b else f"loop {b}"
        raise GeometryError(f"loop {a} crosses or touches {other} at ({where.real:g}, {where.imag:g})")


def _near_pairs(box: Floats, touch: float) -> tuple[Any, Any]:
    """Indices i < j of boxes (n, 4) that overlap or come within ``touch``, in lexical order.

    Sorted by their left ends, a box can only meet the ones that begin before it ends.
    """
    order = np.argsort(box[:, 0], kind="stable")
    low, high = box[order, :2] - touch, box[order, 2:]
    count = np.searchsorted(low[:, 0], high[:, 0], side="right") - np.arange(order.size) - 1
    first = np.repeat(np.arange(order.size), count)
    second = first + 1 + np.arange(first.size) - np.repeat(np.cumsum(count) - count, count)
    near = (low[first, 1] <= high[second, 1]) & (low[second, 1] <= high[first, 1])
    i, j = order[first[near]], order[second[near]]
    i, j = np.minimum(i, j), np.maximum(i, j)
    sort = np.lexsort((j, i))
    return i[sort], j[sort]


def _listed(found: tuple[Any, Any], first: Any, second: Any) -> list[Meeting]:
    met, where = found
    return [Meeting(int(first[k]), int(second[k]), complex(where[k])) for k in np.flatnonzero(met).tolist()]
