"""CAD-like shapes with known truth: plates with fillets, chamfers, notches, tabs, slots, holes and islands.

A shape grows: plates are placed, then random features are tried, and each one that keeps every rule below stays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from d4cad import outlines
from d4cad.edges import Complexes, Edges, Floats, chords, lengths, points_along, sagittas, windings
from d4cad.errors import GeometryError, InputError
from d4cad.outlines import Curve, Outline, Random
from d4cad.sketch import Loop, Sketch

DIFFICULTIES = {"easy": 8, "medium": 40, "hard": 95}
"""The number of primitives of three classes of difficulty, for :func:`generate`."""

REACH = 1.1
"""Every shape lies in [-REACH, REACH]^2 of the world."""

PIXEL = 3 / 256
MIN_GAP = 6 * PIXEL
"""Nothing is thinner than this, neither material nor the space between."""

MIN_EDGE = 5 * PIXEL
MIN_SAGITTA = 1.2 * PIXEL
"""A flatter arc could not be told from a line."""

TURNS = (0.35, 2.45)
"""Radians by which the boundary turns at a vertex, unless it is tangent there."""

TANGENT = 1e-6
MIN_BEND_CHANGE = 0.25
"""Least relative change of curvature at a vertex where the boundary is tangent."""

STEP = 0.015
"""World units between the points along a curve by which distances are measured."""

ATTEMPTS = 8
"""Features that are tried for each primitive, before a shape is given up or accepted as it is."""

TOLERANCE = 0.2
"""Largest relative difference of the number of primitives from the number asked for."""


class Drawing(NamedTuple):
    """What has grown: the curves, points along each, and the angle in radians to which the part is aligned."""

    curves: tuple[Curve, ...]
    traces: tuple[Complexes, ...]
    angle: float

    @property
    def primitives(self) -> int:
        """Number of primitives."""
        return sum(curve.b.size for curve in self.curves)


Feature = Callable[[Random, Drawing, int], Drawing]


def generate(rng: Random, primitives: int = 8) -> Sketch:
    """A random part of about ``primitives`` lines and arcs (within 20 %), a full circle counting two.

    The same generator state gives the same shape. Half of the parts are turned by an arbitrary angle. No vertex
    can be left out: no neighbours lie on one line or circle.
    Raises InputError for fewer than 4 or more than 110 primitives.
    """
    if not 4 <= primitives <= 110:
        raise InputError(f"expected 4 to 110 primitives, got {primitives}")
    for _ in range(200):
        drawing = _grown(rng, primitives)
        if abs(drawing.primitives - primitives) <= TOLERANCE * primitives:
            return Sketch.from_loops([_loop(curve) for curve in drawing.curves])
    raise GeometryError(f"no shape of about {primitives} primitives came of 200 attempts")


def _grown(rng: Random, primitives: int) -> Drawing:
    slack = TOLERANCE / 2 * primitives
    goal = round(primitives + rng.uniform(-slack, slack))
    angle = rng.uniform(0, 2 * np.pi) if rng.random() < 0.5 else 0.0
    drawing = Drawing((), (), angle)
    plates = 1 + int(rng.binomial(min(3, goal // 8), 0.3))
    for _ in range(8 * plates):
        if len(drawing.curves) < plates:
            drawing = _with_plate(rng, drawing, goal, plates)
    if not drawing.curves:
        return drawing
    if rng.random() < 0.3:
        # Before the others, because later there is hardly room for it.
        for _ in range(10):
            drawing = _with_island(rng, drawing, goal) if len(drawing.curves) <= plates else drawing
    for _ in range(ATTEMPTS * goal):
        if drawing.primitives == goal:
            break
        feature = FEATURES[rng.choice(len(FEATURES), p=WEIGHTS)]
        drawing = feature(rng, drawing, goal)
    return drawing


def _loop(curve: Curve) -> Loop:
    return Loop.from_arrays(_plane(curve.z), curve.b)


# Features: each returns the drawing with something added, or as it was where a rule forbids that.


def _with_plate(rng: Random, drawing: Drawing, goal: int, plates: int) -> Drawing:
    size = rng.uniform(0.65 if goal < 60 else 0.85, 1.0) * REACH / plates**0.6
    room = max(REACH - size, 0.0)
    at = complex(*rng.uniform(-room, room, 2))
    return _with_curves(drawing, [_outline(rng, drawing, outlines.PLATES, size).placed(at, 0.0)], max(4, goal * 3 // 4))


def _with_opening(rng: Random, drawing: Drawing, goal: int) -> Drawing:
    """A hole in material, an island in a hole, or now and then a small part beside the others."""
    at = _somewhere(rng, drawing)
    if not _is_inside(drawing, at) and rng.random() < 0.8:
        return drawing
    return _with_curves(drawing, [_outline(rng, drawing, outlines.OPENINGS, _size(rng, goal)).placed(at, 0.0)], goal)


def _with_ring_of_openings(rng: Random, drawing: Drawing, goal: int) -> Drawing:
    """Three to six equal openings around a point, as bolt holes are."""
    centre = complex(drawing.curves[_some_curve(rng, drawing)].z.mean())
    n, radius, start = int(rng.integers(3, 7)), rng.uniform(0.15, 0.9), rng.uniform(0, 2 * np.pi)
    if not _is_inside(drawing, centre + radius * np.exp(1j * start)):
        return drawing
    opening = _outline(rng, drawing, outlines.OPENINGS, min(_size(rng, goal), 0.6 * radius)).placed(radius, 0.0)
    return _with_curves(drawing, [opening.placed(centre, start + 2 * np.pi * k / n) for k in range(n)], goal)


def _with_island(rng: Random, drawing: Drawing, goal: int) -> Drawing:
    """A wide hole with an island in it."""
    at, size = _somewhere(rng, drawing), rng.uniform(0.16, 0.45)
    if not _is_inside(drawing, at):
        return drawing
    hole = _outline(rng, drawing, outlines.OPENINGS, size).placed(at, 0.0)
    island = _outline(rng, drawing, outlines.OPENINGS, rng.uniform(0.2, 0.6) * size).placed(at, 0.0)
    return _with_curves(drawing, [hole, island], goal)


def _with_row_of_openings(rng: Random, drawing: Drawing, goal: int) -> Drawing:
    """Two to four equal openings in a row along the part."""
    n, size = int(rng.integers(2, 5)), _size(rng, goal)
    pitch = size * rng.uniform(2.3, 4) * np.exp(1j * (drawing.angle + rng.integers(2) * np.pi / 2))
    opening, at = _outline(rng, drawing, outlines.OPENINGS, size), _somewhere(rng, drawing)
    if not _is_inside(drawing, at):
        return drawing
    return _with_curves(drawing, [opening.placed(at + k * pitch, 0.0) for k in range(n)], goal)


def _at_line(cut: Callable[[Random, Curve, int], Curve]) -> Feature:
    def with_cut(rng: Random, drawing: Drawing, goal: int) -> Drawing:
        k = _some_curve(rng, drawing)
        curve = drawing.curves[k]
        lines = np.flatnonzero(curve.b == 0)
        if lines.size == 0:
            return drawing
        reach = chords(curve.edges.take(lines))
        return _with_changed(drawing, k, cut(rng, curve, int(rng.choice(lines, p=reach / reach.sum()))), goal)

    return with_cut


def _at_corner(cut: Callable[[Random, Curve, int], Curve]) -> Feature:
    def with_cut(rng: Random, drawing: Drawing, goal: int) -> Drawing:
        k = _some_curve(rng, drawing)
        curve = drawing.curves[k]
        corners = np.flatnonzero((curve.b == 0) & (np.roll(curve.b, 1) == 0))
        if corners.size == 0:
            return drawing
        return _with_changed(drawing, k, cut(rng, curve, int(rng.choice(corners))), goal)

    return with_cut


FEATURES: tuple[Feature, ...] = (
    _with_opening,
    _with_ring_of_openings,
    _with_row_of_openings,
    _at_corner(outlines.fillet),
    _at_corner(outlines.chamfer),
    _at_line(outlines.square_notch),
    _at_line(outlines.vee_notch),
    _at_line(outlines.round_notch),
    _at_line(outlines.slot_notch),
)
WEIGHTS = (0.4, 0.05, 0.05, 0.15, 0.08, 0.08, 0.05, 0.06, 0.08)


def _outline(rng: Random, drawing: Drawing, kinds: Sequence[Outline], size: float) -> Curve:
    """A random outline at the origin, mostly aligned with the part or across it."""
    aligned = drawing.angle + rng.integers(4) * np.pi / 2
    angle = aligned if rng.random() < 0.75 else rng.uniform(0, 2 * np.pi)
    return kinds[int(rng.integers(len(kinds)))](rng, size).placed(0.0, angle)


def _size(rng: Random, goal: int) -> float:
    """Half the longer side of an opening: small ones as often as large ones, and smaller where many must fit."""
    return float(np.exp(rng.uniform(np.log(0.05), np.log(0.75 / goal**0.25))))


def _some_curve(rng: Random, drawing: Drawing) -> int:
    """A curve, the longer the likelier."""
    size = np.array([trace.size for trace in drawing.traces])
    return int(rng.choice(size.size, p=size / size.sum()))


def _somewhere(rng: Random, drawing: Drawing) -> complex:
    """A point in the box of some curve."""
    z = drawing.traces[_some_curve(rng, drawing)]
    return complex(rng.uniform(z.real.min(), z.real.max()), rng.uniform(z.imag.min(), z.imag.max()))


def _is_inside(drawing: Drawing, at: complex) -> bool:
    return any(windings(curve.edges, np.array([at]))[0] for curve in drawing.curves)


def _with_curves(drawing: Drawing, curves: Sequence[Curve], goal: int) -> Drawing:
    if drawing.primitives + sum(curve.b.size for curve in curves) > goal:
        return drawing
    grown = drawing
    for curve in curves:
        trace = _trace(curve)
        if not (_is_sound(curve, trace) and _is_clear_of(trace, grown.traces)):
            return drawing
        grown = Drawing((*grown.curves, curve), (*grown.traces, trace), grown.angle)
    return grown


def _with_changed(drawing: Drawing, k: int, curve: Curve, goal: int) -> Drawing:
    """Curve k replaced."""
    if drawing.primitives + curve.b.size - drawing.curves[k].b.size > goal:
        return drawing
    others = Drawing(
        drawing.curves[:k] + drawing.curves[k + 1 :], drawing.traces[:k] + drawing.traces[k + 1 :], drawing.angle
    )
    changed = _with_curves(others, [curve], goal)
    return drawing if changed is others else changed


# Rules


def _trace(curve: Curve) -> Complexes:
    """Points at most STEP apart along the curve."""
    e = curve.edges
    counts = np.ceil(lengths(e) / STEP).astype(np.int64)
    edge = np.repeat(np.arange(counts.size), counts)
    place = np.arange(edge.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return points_along(e.take(edge), place / counts[edge])


def _is_sound(curve: Curve, trace: Complexes) -> bool:
    """Whether the curve by itself keeps the rules on edges, corners, thickness and reach."""
    e = curve.edges
    if chords(e).min() < MIN_EDGE or np.any((e.b != 0) & (np.abs(sagittas(e)) < MIN_SAGITTA)):
        return False
    if max(np.abs(trace.real).max(), np.abs(trace.imag).max()) > REACH:
        return False
    return _corners_are_clear(e) and _is_nowhere_thin(trace)


def _corners_are_clear(e: Edges) -> bool:
    if e.b.size == 2 and np.all(e.b == 1):
        return True  # a circle
    heading, half_sweep = np.angle(e.z1 - e.z0), 2 * np.arctan(e.b)
    turn = (np.roll(heading - half_sweep, -1) - heading - half_sweep + np.pi) % (2 * np.pi) - np.pi
    bend = 4 * e.b / ((1 + e.b**2) * chords(e))
    after = np.roll(bend, -1)
    differ = np.abs(after - bend) > MIN_BEND_CHANGE * np.maximum(np.abs(after), np.abs(bend))
    sharp = (np.abs(turn) >= TURNS[0]) & (np.abs(turn) <= TURNS[1])
    return bool(np.all(sharp | ((np.abs(turn) < TANGENT) & differ)))


def _is_nowhere_thin(trace: Complexes) -> bool:
    """Whether points nearer than MIN_GAP are neighbours along the curve; so it does not cross itself either.

    Beside the sharpest corner allowed, points that far apart lie at most MIN_GAP / sin(half its angle) along.
    """
    from scipy.spatial import cKDTree

    pairs = cKDTree(_plane(trace)).query_pairs(MIN_GAP, output_type="ndarray")
    along = np.abs(pairs[:, 0] - pairs[:, 1])
    along = np.minimum(along, trace.size - along) * STEP
    return bool(np.all(along <= MIN_GAP / np.sin((np.pi - TURNS[1]) / 2) + 2 * STEP))


def _is_clear_of(trace: Complexes, others: Sequence[Complexes]) -> bool:
    from scipy.spatial import cKDTree

    if not others:
        return True
    near, _ = cKDTree(_plane(np.concatenate(others))).query(_plane(trace), distance_upper_bound=MIN_GAP + STEP)
    # The nearest points of two traces lie within half a step of where the curves are nearest.
    return bool(near.min() ** 2 >= MIN_GAP**2 + (STEP / 2) ** 2)


def _plane(z: Complexes) -> Floats:
    """(n, 2) coordinates of complex points (n,)."""
    return np.stack([z.real, z.imag], axis=1)
