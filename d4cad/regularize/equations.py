"""The equations of every kind of relation: what must vanish, and its derivatives.

Angles in radians, lengths relative or in the sketch's unit, as each function says. All are sums of measures with
coefficients that depend on values only, so that rows may be derivatives by any linear image of the parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import log, pi
from typing import NamedTuple

import numpy as np

from d4cad.edges import Floats
from d4cad.regularize.measures import Measure, Measures
from d4cad.regularize.parameters import Parameters
from d4cad.relations import Relation


class Equations(NamedTuple):
    """residual: (m,). rows: (m, n) its derivatives. spread: (m,) how large residuals are where nothing is related."""

    residual: Floats
    rows: Floats
    spread: Floats


def equations(relation: Relation, layout: Parameters, measures: Measures) -> Equations:
    """The equations of ``relation`` for a sketch of this layout."""
    edges = [layout.number(ref) for ref in relation.refs]
    return WRITERS[relation.kind](relation, edges, layout, measures)


def stacked(parts: Sequence[Equations], width: int) -> Equations:
    """All equations one below the other; ``width``: number of columns if there are none."""
    if not parts:
        return Equations(np.zeros(0), np.zeros((0, width)), np.zeros(0))
    return Equations(*(np.concatenate([part[k] for part in parts]) for k in range(3)))


def gauge(layout: Parameters, measures: Measures) -> Equations:
    """What holds in every sketch: a full circle's vertices lie at its right and left, its edges are semicircles."""
    rings = [layout.starts[loop] for loop in np.flatnonzero(layout.circles)]
    parts = []
    for k in rings:
        sign = 1.0 if measures.bulge.value[k] > 0 else -1.0
        both = np.array([measures.bulge.value[k] - sign, measures.bulge.value[k + 1] - sign])
        level = _difference(measures.py, k, k + 1, 1.0)
        parts.append(
            stacked([Equations(both, measures.bulge.rows[[k, k + 1]], np.ones(2)), level], measures.bulge.rows.shape[1])
        )
    return stacked(parts, measures.bulge.rows.shape[1])


def wrapped(angle: Floats | float, period: float) -> Floats:
    """The angle moved by whole periods into [-period / 2, period / 2)."""
    return np.asarray((np.asarray(angle) + period / 2) % period - period / 2)


def _difference(measure: Measure, a: int, b: int, spread: float) -> Equations:
    residual = np.array([measure.value[b] - measure.value[a]])
    return Equations(residual, (measure.rows[b] - measure.rows[a])[None, :], np.array([spread]))


ANGLES = pi
"""Spread of unrelated angles modulo half a turn."""
RATIOS = 2.0
"""Spread of the natural logarithms of unrelated lengths."""


def _turned(a: int, b: int, by: float, m: Measures) -> Equations:
    residual = wrapped(m.heading.value[b] - m.heading.value[a] - by, pi)
    return Equations(residual.reshape(1), (m.heading.rows[b] - m.heading.rows[a])[None, :], np.array([ANGLES]))


def _level(edges: list[int], layout: Parameters, m: Measures, vertical: bool) -> Equations:
    if len(edges) == 2:
        return _difference(m.cx if vertical else m.cy, edges[0], edges[1], _extent(m))
    (k,) = edges
    end = int(layout.following[k])
    length = float(np.exp(m.chord.value[k]))
    return _difference(m.px if vertical else m.py, k, end, ANGLES * length)


def _horizontal(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """End minus start in y, or of two centres."""
    return _level(edges, layout, m, vertical=False)


def _vertical(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """End minus start in x, or of two centres."""
    return _level(edges, layout, m, vertical=True)


def _parallel(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Difference of the headings, modulo half a turn."""
    return _turned(edges[0], edges[1], 0.0, m)


def _perpendicular(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Difference of the headings minus a quarter turn, modulo half a turn."""
    return _turned(edges[0], edges[1], pi / 2, m)


def _angle(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Difference of the headings minus the value, modulo half a turn."""
    assert r.value is not None
    return _turned(edges[0], edges[1], r.value, m)


def _tangent(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Direction at the start of the second edge minus that at the end of the first."""
    a, b = edges
    turn = m.heading.value[b] - m.bend.value[b] - m.heading.value[a] - m.bend.value[a]
    rows = m.heading.rows[b] - m.bend.rows[b] - m.heading.rows[a] - m.bend.rows[a]
    return Equations(wrapped(turn, 2 * pi).reshape(1), rows[None, :], np.array([ANGLES]))


def _equal_radius(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Difference of the logarithms of the radii."""
    return _difference(m.radius, edges[0], edges[1], RATIOS)


def _equal_length(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Difference of the logarithms of the lengths."""
    return _difference(m.chord, edges[0], edges[1], RATIOS)


def _concentric(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Difference of the centres."""
    extent = _extent(m)
    return stacked([_difference(c, edges[0], edges[1], extent) for c in (m.cx, m.cy)], m.x.rows.shape[1])


def _collinear(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Distances of the second line's ends from the first line, the longer of the two taken as the first."""
    a, b = edges if m.chord.value[edges[0]] >= m.chord.value[edges[1]] else edges[::-1]
    parts = [_off_line(a, end, layout, m) for end in (b, int(layout.following[b]))]
    return stacked(parts, m.x.rows.shape[1])


def _off_line(a: int, vertex: int, layout: Parameters, m: Measures) -> Equations:
    """Signed distance of a vertex from the line of edge a, positive to its left."""
    end, u = int(layout.following[a]), m.along[a]
    p = complex(m.px.value[vertex] - m.px.value[a], m.py.value[vertex] - m.py.value[a])
    turned = p * np.conj(u)
    share = turned.real / float(np.exp(m.chord.value[a]))
    nx, ny = -u.imag, u.real
    rows = nx * (m.px.rows[vertex] - (1 - share) * m.px.rows[a] - share * m.px.rows[end])
    rows += ny * (m.py.rows[vertex] - (1 - share) * m.py.rows[a] - share * m.py.rows[end])
    return Equations(np.array([turned.imag]), rows[None, :], np.array([_extent(m)]))


def _symmetric(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """For each pair: the difference along the axis, and the midpoint's distance from it; then differences of bulges.

    A free axis is that of the pair whose points are furthest apart.
    """
    a, b = np.array(edges[0::2]), np.array(edges[1::2])
    z = m.x.value + 1j * m.y.value
    apart = z[b] - z[a]
    lead = int(np.argmax(np.abs(apart)))
    n = apart[lead] / np.abs(apart[lead]) if r.value is None else complex(np.exp(1j * (r.value + pi / 2)))
    width, extent = m.x.rows.shape[1], _extent(m)
    dx, dy = m.x.rows[b] - m.x.rows[a], m.y.rows[b] - m.y.rows[a]
    middle = (z[a] + z[b]) / 2 - (z[a] + z[b])[lead] / 2
    mx, my = (m.x.rows[a] + m.x.rows[b]) / 2, (m.y.rows[a] + m.y.rows[b]) / 2
    mx, my = mx - mx[lead], my - my[lead]
    along = (apart * np.conj(n)).imag  # across n, that is along the axis
    off = (middle * np.conj(n)).real
    along_rows, off_rows = n.real * dy - n.imag * dx, n.real * mx + n.imag * my
    if r.value is None:  # as the points of the leading pair move, n turns: dn = i n (across rows of lead) / distance
        turn = along_rows[lead] / np.abs(apart[lead])
        # d Im(v conj n) = -Re(v conj n) dphi and d Re(v conj n) = Im(v conj n) dphi
        along_rows = along_rows - (apart * np.conj(n)).real[:, None] * turn
        off_rows = off_rows + (middle * np.conj(n)).imag[:, None] * turn
    rows = np.concatenate([along_rows, off_rows])
    residual = np.concatenate([along, off])
    keep = np.ones(2 * len(a), dtype=bool)
    keep[len(a) + lead] = False
    if r.value is None:
        keep[lead] = False
    keep[: len(a)] &= a != b  # a vertex on the axis mirrors itself
    points = Equations(residual[keep], rows[keep], np.full(int(keep.sum()), extent))
    return stacked([points, _same_bulges(edges, layout, m, mirrored=True)], width)


def _same_bulges(edges: list[int], layout: Parameters, m: Measures, mirrored: bool) -> Equations:
    """Differences of the bulges of edges that correspond; of circles, of the radii.

    Mirrored, the edge that leaves a corresponds to the one that ends at b; else to the one that leaves b.
    """
    before = np.empty_like(layout.following)
    before[layout.following] = np.arange(before.size)
    rings = {layout.starts[loop] for loop in np.flatnonzero(layout.circles)}
    round_pairs, bent_pairs = set(), set()
    for a, b in zip(edges[0::2], edges[1::2], strict=True):
        if a in rings:
            round_pairs.add((min(a, b), max(a, b)))
        elif mirrored:
            bent_pairs |= {tuple(sorted((a, int(before[b])))), tuple(sorted((int(before[a]), b)))}
        else:
            bent_pairs.add((a, b))
    parts = [_difference(m.radius, a, b, RATIOS) for a, b in sorted(round_pairs) if a != b]
    parts += [_difference(m.bulge, a, b, 1.0) for a, b in sorted(bent_pairs) if a != b and layout.arcs[a]]
    return stacked(parts, m.x.rows.shape[1])


def _congruent(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Differences of the lengths of corresponding chords, of the turns between them, and of the bulges."""
    parts = []
    for a, b in zip(edges[0::2], edges[1::2], strict=True):
        a1, b1 = int(layout.following[a]), int(layout.following[b])
        parts.append(_difference(m.chord, a, b, RATIOS))
        turn = (m.heading.value[b1] - m.heading.value[b]) - (m.heading.value[a1] - m.heading.value[a])
        rows = m.heading.rows[b1] - m.heading.rows[b] - m.heading.rows[a1] + m.heading.rows[a]
        parts.append(Equations(wrapped(turn, 2 * pi).reshape(1), rows[None, :], np.array([ANGLES])))
    return stacked([*parts, _same_bulges(edges, layout, m, mirrored=False)], m.x.rows.shape[1])


def _polar(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """The discrete Fourier transform of the centres, but for its mean and the one turn that goes around once."""
    count = len(edges)
    waves = np.exp(-2j * pi * np.outer(np.arange(2, count), np.arange(count)) / count) / count
    value = waves @ (m.cx.value[edges] + 1j * m.cy.value[edges])
    x, y = m.cx.rows[edges], m.cy.rows[edges]
    rows = np.concatenate([waves.real @ x - waves.imag @ y, waves.imag @ x + waves.real @ y])
    residual = np.concatenate([value.real, value.imag])
    return Equations(residual, rows, np.full(residual.size, _extent(m) / count))


def _row(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Second differences of the centres."""
    parts = []
    for a, b, c in zip(edges, edges[1:], edges[2:], strict=False):
        for p in (m.cx, m.cy):
            residual = np.array([p.value[a] - 2 * p.value[b] + p.value[c]])
            rows = (p.rows[a] - 2 * p.rows[b] + p.rows[c])[None, :]
            parts.append(Equations(residual, rows, np.array([_extent(m)])))
    return stacked(parts, m.x.rows.shape[1])


def _sized(measure: Measure, k: int, value: float) -> Equations:
    return Equations(np.array([measure.value[k] - log(value)]), measure.rows[k][None, :], np.array([RATIOS]))


def _radius(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Logarithm of the radius over the value."""
    assert r.value is not None
    return _sized(m.radius, edges[0], r.value)


def _diameter(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Logarithm of the diameter over the value."""
    assert r.value is not None
    return _sized(m.radius, edges[0], r.value / 2)


def _length(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Logarithm of the length over the value."""
    assert r.value is not None
    return _sized(m.chord, edges[0], r.value)


def _distance(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Distance of the centres of two arcs, or of the second line's start from the first line, minus the value."""
    assert r.value is not None
    a, b = edges
    if layout.arcs[a] and layout.arcs[b]:
        d = complex(m.cx.value[b] - m.cx.value[a], m.cy.value[b] - m.cy.value[a])
        u = d / abs(d)
        rows = u.real * (m.cx.rows[b] - m.cx.rows[a]) + u.imag * (m.cy.rows[b] - m.cy.rows[a])
        return Equations(np.array([abs(d) - r.value]), rows[None, :], np.array([_extent(m)]))
    off = _off_line(a, b, layout, m)
    sign = 1.0 if off.residual[0] >= 0 else -1.0
    return Equations(sign * off.residual - r.value, sign * off.rows, off.spread)


def _extents(r: Relation, point: Measure, center: Measure, layout: Parameters, m: Measures, axis: complex) -> Equations:
    """Extent along an axis minus the value."""
    assert r.value is not None
    high, high_row = _furthest(point, center, layout, m, axis, 1.0)
    low, low_row = _furthest(point, center, layout, m, axis, -1.0)
    return Equations(np.array([high - low - r.value]), (high_row - low_row)[None, :], np.array([_extent(m)]))


def _furthest(
    point: Measure, center: Measure, layout: Parameters, m: Measures, axis: complex, sign: float
) -> tuple[float, Floats]:
    """The largest (or least) coordinate of the whole sketch along an axis: at a vertex, or at the side of an arc."""
    k = int(np.argmax(sign * point.value))
    radius = np.exp(m.radius.value)
    # The arc reaches there if that direction lies within half its sweep of its apex, which is to the right of travel.
    apex = -1j * m.along * np.sign(m.bulge.value)
    within = np.abs(np.angle(sign * axis / np.where(layout.arcs, apex, 1.0))) < np.abs(m.bend.value)
    side = np.where(layout.arcs & within, center.value + sign * radius, -sign * np.inf)
    j = int(np.argmax(sign * side))
    if sign * side[j] > sign * point.value[k]:
        return float(side[j]), center.rows[j] + sign * radius[j] * m.radius.rows[j]
    return float(point.value[k]), point.rows[k]


def _width(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Extent in x minus the value."""
    return _extents(r, m.px, m.cx, layout, m, 1.0 + 0j)


def _height(r: Relation, edges: list[int], layout: Parameters, m: Measures) -> Equations:
    """Extent in y minus the value."""
    return _extents(r, m.py, m.cy, layout, m, 1j)


def _extent(m: Measures) -> float:
    return float(max(np.ptp(m.px.value), np.ptp(m.py.value)))


Writer = Callable[[Relation, list[int], Parameters, Measures], Equations]

WRITERS: dict[str, Writer] = {
    "horizontal": _horizontal,
    "vertical": _vertical,
    "parallel": _parallel,
    "perpendicular": _perpendicular,
    "tangent": _tangent,
    "equal_radius": _equal_radius,
    "equal_length": _equal_length,
    "concentric": _concentric,
    "collinear": _collinear,
    "symmetric": _symmetric,
    "congruent": _congruent,
    "polar": _polar,
    "row": _row,
    "radius": _radius,
    "diameter": _diameter,
    "length": _length,
    "distance": _distance,
    "angle": _angle,
    "width": _width,
    "height": _height,
}
