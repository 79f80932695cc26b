"""How true an outline is to its picture: distances to the picture's edge, overlap, and features too small to trust."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.deviation import gathered
from d4cad.edges import Complexes, Edges, Floats, distances, lengths, points_along
from d4cad.errors import InputError
from d4cad.sketch import Sketch

STEP = 0.5
"""Pixels, at most, between the points of a curve at which distances are looked for."""

CANDIDATES = 3
"""The nearest of these points name the edges that may be nearest; the distance is then exact."""

SMALL = 1.0
"""Pixels below which a picture says little about a feature."""


@dataclass(frozen=True, slots=True)
class Trace:
    """Points along an outline in world units, (n,) complex, and how far each is from the picture's edge in pixels."""

    points: Complexes
    apart: Floats


@dataclass(frozen=True, slots=True)
class Fidelity:
    """Figures of one fit.

    psnr: dB. iou: sum of the lesser over the sum of the greater of both coverages, pixel by pixel. largest_px, mean_px:
    distance between the picture's edge (its contour at 1/2, sub-pixel) and the exact outline, the larger of both ways
    and the mean along both. Coverage rounds a right-angled corner off by about 0.2 px, so that a perfect part has
    that as its largest. redrawn_px: the same between the picture's contour and that of the outline drawn as a picture,
    where both are rounded alike. largest_mm, mean_mm: of the former. narrowest_px: the least width of material or of
    the space between. shortest_px: the shortest edge. warnings: a sentence for each that is under the tolerance.
    """

    psnr: float
    iou: float
    largest_px: float
    mean_px: float
    largest_mm: float
    mean_mm: float
    redrawn_px: float
    narrowest_px: float | None
    shortest_px: float
    warnings: tuple[str, ...]

    def facts(self) -> dict[str, Any]:
        """The figures as JSON values."""
        return {**asdict(self), "warnings": list(self.warnings)}


def measured(
    target: Floats, coverage: Floats, outline: Sketch, canvas: Canvas, mm: float, psnr: float, tolerance: float = SMALL
) -> tuple[Fidelity, Trace]:
    """The figures of an outline in world units for a target, and its distances along the outline.

    target, coverage: (height, width) of the canvas, the latter of the outline. mm: millimetres per pixel. tolerance:
    pixels under which features are warned of. Raises InputError for a target without an edge.
    """
    edge = contour(target)
    if edge.b.size == 0:
        raise InputError("the picture has no edge to compare with: no pixel of it is over 1/2")
    drawn = _in_pixels(outline, canvas)
    here, there = samples(drawn), samples(edge)
    from_outline, from_edge = apart(here, edge), apart(there, drawn)
    redrawn = contour(coverage)
    again = max(apart(samples(redrawn), edge).max(), apart(there, redrawn).max()) if redrawn.b.size else np.inf
    largest = float(max(from_outline.max(), from_edge.max()))
    mean = float((from_outline.mean() + from_edge.mean()) / 2)
    narrowest, shortest = _narrowest(outline, tolerance * canvas.pixel), float(lengths(drawn).min())
    narrowest = None if narrowest is None else narrowest / canvas.pixel
    figures = Fidelity(
        psnr=psnr,
        iou=float(np.minimum(target, coverage).sum() / max(float(np.maximum(target, coverage).sum()), 1e-12)),
        largest_px=largest,
        mean_px=mean,
        largest_mm=largest * mm,
        mean_mm=mean * mm,
        redrawn_px=float(again),
        narrowest_px=narrowest,
        shortest_px=shortest,
        warnings=_warnings(narrowest, shortest, mm, tolerance),
    )
    world = (here - complex(canvas.width / 2, canvas.height / 2)) * canvas.pixel
    return figures, Trace(world, from_outline)


def contour(target: Floats) -> Edges:
    """The curve where coverage (height, width) is 1/2, linear between the centres of pixels, in pixels from the lower
    left corner; the ground beyond the border closes it."""
    import contourpy

    padded = np.pad(target, 1)
    lines = contourpy.contour_generator(z=padded).lines(0.5)
    parts = [np.ascontiguousarray(line, dtype=np.float64).view(np.complex128).ravel() for line in lines]
    shift = 0.5 + 0.5j  # a pixel's centre lies half a pixel in, and the padding is one pixel
    start = np.concatenate([part[:-1] for part in parts]) if parts else np.zeros(0, np.complex128)
    end = np.concatenate([part[1:] for part in parts]) if parts else np.zeros(0, np.complex128)
    return Edges(start - shift, end - shift, np.zeros(start.size))


def left_by(coverage: Floats, target: Floats) -> float:
    """How far in pixels the contour of an outline's coverage leaves that of the picture; infinite if it has none.

    One way only: specks of the picture that the outline leaves out do not count.
    """
    here, edge = contour(coverage), contour(target)
    return float(apart(samples(here), edge).max()) if here.b.size and edge.b.size else float("inf")


def samples(e: Edges, step: float = STEP) -> Complexes:
    """Points along edges at most ``step`` apart, starts among them."""
    return _sampled(e, step)[0]


def _sampled(e: Edges, step: float) -> tuple[Complexes, Any]:
    count = np.ceil(lengths(e) / step).clip(1).astype(np.int64)
    edge = np.repeat(np.arange(count.size), count)
    place = np.arange(edge.size) - np.repeat(np.cumsum(count) - count, count)
    return points_along(e.take(edge), place / count[edge]), edge


def apart(q: Complexes, e: Edges) -> Floats:
    """Distance of each point q from the nearest of edges, all in pixels."""
    from scipy.spatial import cKDTree

    points, edge = _sampled(e, STEP)
    tree = cKDTree(np.stack([points.real, points.imag], axis=1))
    _, near = tree.query(np.stack([q.real, q.imag], axis=1), k=min(CANDIDATES, points.size))
    index = edge[np.reshape(near, (q.size, -1))]
    return np.asarray(distances(e.take(index), q[:, None]).min(axis=1))


def _in_pixels(outline: Sketch, canvas: Canvas) -> Edges:
    e = gathered(outline.loops)
    middle = complex(canvas.width / 2, canvas.height / 2)
    return Edges(e.z0 / canvas.pixel + middle, e.z1 / canvas.pixel + middle, e.b)


def _narrowest(outline: Sketch, limit: float) -> float | None:
    from d4cad.exporters.checks.spans import spans

    turned = [loop.reversed() for loop in outline.loops]
    found = [spans(loops, limit).length for loops in (outline.loops, turned)]
    return min((float(length.min()) for length in found if length.size), default=None)


def _warnings(narrowest: float | None, shortest: float, mm: float, tolerance: float) -> tuple[str, ...]:
    found = []
    why = "which the picture can hardly show" if tolerance <= SMALL else "the tolerance"
    under = f"under {tolerance:.3g} px, {why}"
    if narrowest is not None and narrowest < tolerance:
        found.append(f"the narrowest wall or gap is {narrowest:.2g} px ({narrowest * mm:.2g} mm), {under}")
    if shortest < tolerance:
        found.append(f"the shortest edge is {shortest:.2g} px ({shortest * mm:.2g} mm), {under}")
    return tuple(found)
