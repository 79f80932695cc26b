"""Relations that might hold between single edges: everything that the picture's evidence does not rule out."""

from __future__ import annotations

from collections.abc import Iterator
from math import log, pi

import numpy as np

from d4cad.edges import Floats
from d4cad.regularize.equations import ANGLES, RATIOS, wrapped
from d4cad.regularize.measures import Measure, Measures
from d4cad.regularize.parameters import Ints, Parameters
from d4cad.regularize.selection import LIMIT, Candidate
from d4cad.regularize.solving import SATISFIED
from d4cad.relations import Relation

LIKELY = 1.0
"""Price in nats of what designers do all the time."""
USUAL = 2.0
SELDOM = 4.0
ROUND_ANGLE = pi / 12
"""Angles between lines that are worth looking at: multiples of 15 degrees."""
SIMILAR = 1.5
"""Largest ratio of radii or lengths that are looked at: beyond, a picture that poor has nothing to say."""


def single_candidates(layout: Parameters, at: Measures, spread: Measures) -> list[Candidate]:
    """Candidates of all kinds that relate one or two edges. at: the measures. spread: the same with rows in standard
    deviations.
    """
    lines = np.flatnonzero(~layout.arcs)
    rings = np.array([layout.starts[loop] for loop in np.flatnonzero(layout.circles)], dtype=np.int64)
    second = rings + 1
    arcs = np.setdiff1d(np.flatnonzero(layout.arcs), second)
    return [
        *_axes(layout, lines, at),
        *_tangents(layout, second, arcs),
        *_directions(layout, lines, at, spread),
        *_angles(layout, lines, at),
        *_pairs(layout, arcs, spread.radius, "equal_radius", RATIOS, USUAL),
        *_concentric(layout, arcs, rings, at, spread),
        *_pairs(layout, lines, spread.chord, "equal_length", RATIOS, USUAL),
        *_collinear(layout, lines, at, spread),
        *_levels(layout, rings, at, spread),
    ]


def _relation(layout: Parameters, kind: str, *edges: int, value: float | None = None) -> Relation:
    return Relation(kind, tuple(layout.refs[k] for k in edges), value)


def _axes(layout: Parameters, lines: Ints, at: Measures) -> Iterator[Candidate]:
    """Each line along its nearer axis."""
    for k in lines.tolist():
        u = at.along[k]
        yield Candidate(_relation(layout, "horizontal" if abs(u.real) > abs(u.imag) else "vertical", k), LIKELY)


def _tangents(layout: Parameters, second: Ints, arcs: Ints) -> Iterator[Candidate]:
    """Neighbours of which one is an arc at least, full circles apart."""
    round_edges = set(second.tolist()) | {k for k in arcs.tolist() if layout.following[k] in second}
    for k, after in enumerate(layout.following.tolist()):
        if k not in round_edges and (layout.arcs[k] or layout.arcs[after]):
            yield Candidate(_relation(layout, "tangent", k, after), LIKELY)


def _close(measure: Measure, edges: Ints, distance: Floats, spread: float, price: float) -> Iterator[tuple[int, int]]:
    """Pairs i < j of edges whose distance (k, k) is small enough for their difference of ``measure``, in standard
    deviations, to be believable by itself.
    """
    rows = measure.rows[edges]
    cov = rows @ rows.T
    own = np.diagonal(cov)
    sigma = np.sqrt(np.maximum(own[:, None] + own[None, :] - 2 * cov, 1e-300))
    z = distance / sigma
    gain = np.log(spread / sigma) - 0.5 * log(2 * pi) - z * z / 2 - price
    holds = np.abs(distance) <= SATISFIED  # already, by what was found before
    good = np.triu((np.abs(z) <= LIMIT) & (gain > 0) | holds, 1)
    for i, j in np.argwhere(good).tolist():
        yield int(edges[i]), int(edges[j])


def _many(edges: Ints) -> float:
    """Nats by which one partner among many is less likely to be the one."""
    return log(max(len(edges) - 1, 1))


def _directions(layout: Parameters, lines: Ints, at: Measures, spread: Measures) -> Iterator[Candidate]:
    """Lines that are parallel or at right angles."""
    if lines.size < 2:
        return
    heading = at.heading.value[lines]
    turn = heading[None, :] - heading[:, None]
    price = LIKELY + _many(lines)
    for kind, by in (("parallel", 0.0), ("perpendicular", pi / 2)):
        for a, b in _close(spread.heading, lines, wrapped(turn - by, pi), ANGLES, price):
            yield Candidate(_relation(layout, kind, a, b), price)


def _angles(layout: Parameters, lines: Ints, at: Measures) -> Iterator[Candidate]:
    """Angles of lines with the longest line, in multiples of 15 degrees."""
    if lines.size < 2:
        return
    longest = int(lines[np.argmax(at.chord.value[lines])])
    for k in lines.tolist():
        turn = (at.heading.value[k] - at.heading.value[longest]) % pi
        steps = round(turn / ROUND_ANGLE)
        if k != longest and steps % 6:
            # of the twelve directions within half a turn a designer means one, and seldom one of these
            relation = _relation(layout, "angle", longest, k, value=steps * ROUND_ANGLE)
            yield Candidate(relation, SELDOM + log(pi / ROUND_ANGLE))


def _pairs(
    layout: Parameters, edges: Ints, measure: Measure, kind: str, spread: float, price: float
) -> Iterator[Candidate]:
    """Pairs of edges of one size."""
    if edges.size < 2:
        return
    price += _many(edges)
    value = measure.value[edges]
    distance = value[None, :] - value[:, None]
    distance = np.where(np.abs(distance) < log(SIMILAR), distance, np.inf)
    for a, b in _close(measure, edges, distance, spread, price):
        yield Candidate(_relation(layout, kind, a, b), price)


def _concentric(layout: Parameters, arcs: Ints, rings: Ints, at: Measures, spread: Measures) -> Iterator[Candidate]:
    """Pairs of arcs about one centre."""
    if arcs.size < 2:
        return
    price = LIKELY + _many(arcs)
    extent = float(np.ptp(at.px.value) + np.ptp(at.py.value))
    x, y = at.cx.value[arcs], at.cy.value[arcs]
    close_x = set(_close(spread.cx, arcs, x[None, :] - x[:, None], extent, 0.0))
    for a, b in _close(spread.cy, arcs, y[None, :] - y[:, None], extent, 0.0):
        if (a, b) in close_x:
            yield Candidate(_relation(layout, "concentric", a, b), price)


def _collinear(layout: Parameters, lines: Ints, at: Measures, spread: Measures) -> Iterator[Candidate]:
    """Pairs of lines, not neighbours, that continue each other."""
    if lines.size < 2:
        return
    price = USUAL + _many(lines)
    heading = at.heading.value[lines]
    turn = wrapped(heading[None, :] - heading[:, None], pi)
    pixel = float(np.ptp(at.px.value) + np.ptp(at.py.value)) / 50
    for a, b in _close(spread.heading, lines, turn, ANGLES, LIKELY):
        middle = complex(at.px.value[b] - at.px.value[a], at.py.value[b] - at.py.value[a])
        if abs((middle * np.conj(at.along[a])).imag) < pixel:
            yield Candidate(_relation(layout, "collinear", a, b), price)


def _levels(layout: Parameters, rings: Ints, at: Measures, spread: Measures) -> Iterator[Candidate]:
    """Full circles whose centres lie on one level, in y or in x."""
    if rings.size < 2:
        return
    price = USUAL + _many(rings)
    extent = float(max(np.ptp(at.px.value), np.ptp(at.py.value)))
    for kind, place, measure in (("horizontal", at.cy.value, spread.cy), ("vertical", at.cx.value, spread.cx)):
        distance = place[rings][None, :] - place[rings][:, None]
        for a, b in _close(measure, rings, distance, extent, price):
            yield Candidate(_relation(layout, kind, a, b), price)
