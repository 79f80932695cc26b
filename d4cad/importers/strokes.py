"""Strokes: open chains of lines and arcs, and how they join to closed loops."""

from __future__ import annotations

from collections.abc import Sequence
from math import tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from d4cad.edges import Bools, Complexes, Edges, Floats, points_along
from d4cad.errors import GeometryError
from d4cad.loop import Loop
from d4cad.segmentation import segment, segment_chain

Indices = NDArray[np.int64]

SAMPLING = 1 / 50
"""Share of the tolerance by which a curve may leave the points that stand for it."""

CORNER = 0.02
"""Radians by which a curve turns at a joint that stays a vertex."""


class Stroke(NamedTuple):
    """Consecutive edges: points (k + 1,), x + iy in mm, and bulges (k,)."""

    points: Complexes
    bulges: Floats

    def reversed(self) -> Stroke:
        """The same curve from its end."""
        return Stroke(self.points[::-1], 0.0 - self.bulges[::-1])

    @property
    def edges(self) -> Edges:
        """Its edges."""
        return Edges(self.points[:-1], self.points[1:], self.bulges)

    @property
    def loop(self) -> Loop:
        """The closed loop of a stroke that ends where it begins."""
        return Loop.from_arrays(plane(self.points[:-1]), self.bulges)


def line(z0: complex, z1: complex) -> Stroke:
    """A straight stroke."""
    return Stroke(np.array([z0, z1], dtype=np.complex128), np.zeros(1))


def arc(centre: complex, radius: float, start: float, sweep: float) -> Stroke:
    """Part of a circle from the angle ``start``, both in radians, counter-clockwise for a positive sweep.

    One edge up to half a turn, two beyond, so that a full circle is a closed stroke.
    """
    pieces = 1 if abs(sweep) <= np.pi * (1 + 1e-12) else 2
    points = centre + radius * np.exp(1j * (start + sweep * np.arange(pieces + 1) / pieces))
    if abs(abs(sweep) - 2 * np.pi) < 1e-12:
        points[-1] = points[0]
    return Stroke(points, np.full(pieces, tan(sweep / pieces / 4)))


def fitted(samples: Complexes, tolerance: float) -> Stroke:
    """A smooth curve given by points on it, closed if the last is the first, as few lines and arcs."""
    if samples[0] == samples[-1] and samples.size > 3:
        loop = segment(plane(samples[:-1]), tolerance)
        z = np.array([complex(*p) for p in loop.points])
        return Stroke(np.append(z, z[0]), np.array(loop.bulges))
    points, bulges = segment_chain(plane(samples), tolerance)
    return Stroke(np.ascontiguousarray(points).view(np.complex128).ravel(), bulges)


def plane(z: Complexes) -> Floats:
    """(n, 2) coordinates of complex points (n,)."""
    return np.stack([z.real, z.imag], axis=1)


def chained(strokes: Sequence[Stroke], gap: float) -> tuple[list[Loop], tuple[str, ...]]:
    """The closed loops that strokes make, their ends joined where at most ``gap`` apart, and notes.

    Strokes drawn twice count once; those no longer than ``gap`` are left out. Raises GeometryError, saying where, for
    an end without a partner and for a place where more than two strokes meet.
    """
    strokes = [stroke for stroke in strokes if stroke.bulges.size and _size(stroke) > gap]
    loops = [
        stroke.loop for stroke in strokes if stroke.bulges.size > 1 and abs(stroke.points[0] - stroke.points[-1]) <= gap
    ]
    rest = [s for s in strokes if not (s.bulges.size > 1 and abs(s.points[0] - s.points[-1]) <= gap)]
    if not rest:
        return loops, ()
    node = _nodes(np.array([end for s in rest for end in (s.points[0], s.points[-1])]), gap).reshape(-1, 2)
    kept = _once(rest, node, gap)
    notes = []
    if not np.all(kept):
        n = int(np.count_nonzero(~kept))
        notes.append(f"{n} stroke{'s' if n > 1 else ''} drawn twice counted once")
    rest, node = [s for s, keep in zip(rest, kept, strict=True) if keep], node[kept]
    _refuse_ends(rest, node, gap)
    widest = 0.0
    for ring in _rings(node):
        parts = [rest[k] if forward else rest[k].reversed() for k, forward in ring]
        gaps = [abs(a.points[-1] - b.points[0]) for a, b in zip(parts, [*parts[1:], parts[0]], strict=True)]
        widest = max(widest, *gaps)
        points = np.concatenate([part.points[:-1] for part in parts])
        loops.append(Loop.from_arrays(plane(points), np.concatenate([part.bulges for part in parts])))
    if widest > 1e-6:
        notes.append(f"gaps of up to {widest:.2g} mm between strokes were closed")
    return loops, tuple(notes)


def _size(stroke: Stroke) -> float:
    return float(
        np.abs(points_along(stroke.edges.take((slice(None), None)), np.arange(5) / 4) - stroke.points[0]).max()
    )


def _nodes(ends: Complexes, gap: float) -> Indices:
    """Equal numbers for ends that are joined, directly or through others."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(plane(ends)).query_pairs(gap, output_type="ndarray")
    ones = np.ones(len(pairs), dtype=np.int64)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(ends.size, ends.size))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _once(strokes: Sequence[Stroke], node: Indices, gap: float) -> Bools:
    """Which strokes do not repeat an earlier one: the same ends, the same middle."""
    seen: dict[tuple[int, int], list[complex]] = {}
    kept = np.ones(len(strokes), dtype=np.bool_)
    for k, stroke in enumerate(strokes):
        a, b = sorted(node[k].tolist())
        middle = complex(_middle(stroke))
        others = seen.setdefault((a, b), [])
        kept[k] = all(abs(middle - other) > 2 * gap for other in others)
        others.append(middle)
    return kept


def _middle(stroke: Stroke) -> complex:
    """The mean of points on the stroke, the same in both directions."""
    return complex(points_along(stroke.edges.take((slice(None), None)), (np.arange(5) + 0.5) / 5).mean())


def _refuse_ends(strokes: Sequence[Stroke], node: Indices, gap: float) -> None:
    count = np.bincount(node.ravel())
    place = np.zeros(count.size, dtype=np.complex128)
    for k, stroke in enumerate(strokes):
        place[node[k, 0]], place[node[k, 1]] = stroke.points[0], stroke.points[-1]
    many = np.flatnonzero(count > 2)
    if many.size:
        z = place[many[0]]
        raise GeometryError(f"{count[many[0]]} strokes meet at ({z.real:g}, {z.imag:g}): an outline does not branch")
    single = place[count == 1]
    if single.size:
        apart = np.abs(single[0] - single[1:])
        other = single[1:][np.argmin(apart)]
        raise GeometryError(
            f"its outline is open at ({single[0].real:g}, {single[0].imag:g}): the nearest other open end, at "
            f"({other.real:g}, {other.imag:g}), is {apart.min():.3g} mm away; ends up to {gap:g} mm apart are joined"
        )


def _rings(node: Indices) -> list[list[tuple[int, bool]]]:
    """Closed sequences of strokes, each with whether it runs forward; every node joins two stroke ends."""
    at: dict[int, list[int]] = {}
    for k, (a, b) in enumerate(node.tolist()):
        at.setdefault(a, []).append(k)
        at.setdefault(b, []).append(k)
    rings, used = [], np.zeros(len(node), dtype=np.bool_)
    for first in range(len(node)):
        ring, k, start = [], first, int(node[first, 0])
        while not used[k]:
            used[k] = True
            forward = int(node[k, 0]) == start
            ring.append((k, forward))
            start = int(node[k, 1 if forward else 0])
            k = next((other for other in at[start] if not used[other]), k)
        if ring:
            rings.append(ring)
    return rings
