"""What a picture says about an outline, and the outline regularised by it (:mod:`d4cad.regularize`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from d4cad.canvas import Canvas
from d4cad.edges import Floats
from d4cad.errors import GeometryError
from d4cad.placement import Placement
from d4cad.program import Program, dense
from d4cad.protocols import Grammar, Tracer
from d4cad.raster.band import SquaresTable
from d4cad.regularize import Evidence, Parameters, Scale, regularized
from d4cad.relations import Relation
from d4cad.sketch import Sketch

POLISH = 10
"""Most Gauss-Newton steps of the joined outline before relations are looked for."""
DAMPING = 1e-6
"""Share of every parameter's own curvature that is added, so that directions without any are not moved along."""
FLOOR = 1e-10
"""Least variance of a pixel: what moves an edge by 1e-5 pixels or less is not told from an unfinished descent."""
REPEATED = 9.0
"""Pixels along an edge over which an edge model's error repeats: measured by benchmarks/snap.py, with area coverage."""
FLAT = 3
"""Pixels from the boundary beyond which only noise is left."""
TRIMMED = 0.02
"""Share of the boundary's pixels, the worst, that do not count as noise: a feature that was missed."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A picture as evidence about the parameters of an outline: the program that draws it, and a target."""

    program: Program[Any]
    grammar: Grammar[Any]
    canvas: Canvas
    table: SquaresTable

    def loss(self, params: Floats) -> float:
        """Sum of squared errors."""
        return self.table.value(self.grammar.rasterize(self.program.moved(params), self.canvas))

    def newton(self, params: Floats) -> tuple[Floats, Floats]:
        """The parameters that the Gauss-Newton step leads to, and the matrix J'J."""
        _, force, curvature = self.table.normal(self.grammar.rasterize(self.program.moved(params), self.canvas))
        matrix = dense(curvature)
        most = float(np.diagonal(matrix).max(initial=0.0))
        if most < 1e-100:  # the picture sees none of it
            return params, matrix
        unit = 1 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-12 * most))
        damped = matrix * np.outer(unit, unit) + DAMPING * np.eye(unit.size)
        return params - unit * cho_solve(cho_factor(damped), unit * force), matrix

    def variance(self, params: Floats) -> float:
        """Variance that a pixel at the boundary has in effect, from what the outline leaves unexplained there.

        What is not noise of the picture, seen far from the boundary, or rounding is the edge model's error: it
        repeats from pixel to pixel along an edge, so that averaging over an edge does not lessen it as it does noise.
        """
        from scipy.ndimage import binary_dilation

        band = self.grammar.rasterize(self.program.moved(params), self.canvas)
        target = self.table.target
        mask = np.zeros(self.canvas.shape, dtype=np.bool_)
        mask[band.row, band.col] = True
        flat = ~binary_dilation(mask, iterations=FLAT)
        noise = 2 * float(((target - band.coverage)[flat] ** 2).mean()) if flat.any() else 0.0  # half was clipped
        edge = (band.cover > 0) & (band.cover < 1)
        values = target[band.row[edge], band.col[edge]]
        noise += _step(values) ** 2 / 12
        squares = np.sort((band.cover[edge] - values) ** 2)
        left = squares[: squares.size - int(TRIMMED * squares.size)]
        total = float(left.mean()) if left.size else 0.0
        return max(noise + REPEATED * max(total - noise, 0.0), FLOOR)


def _step(values: Floats) -> float:
    """The step between grey levels where there are at most about 300 of them, else 0."""
    steps = np.diff(np.sort(values))
    steps = steps[steps > 1e-9]
    least = float(steps.min()) if steps.size else 0.0
    return least if least > 1 / 300 else 0.0


@dataclass(frozen=True, slots=True)
class Snap:
    """What regularisation has done to an outline, in world units.

    sketch: with relations and dimensions. moved: the longest way of a vertex. before, after: mean squared error without
    and with the relations. freed: the number of parameters that they take.
    """

    sketch: Sketch
    moved: float
    before: float
    after: float
    freed: int

    @property
    def relations(self) -> tuple[Relation, ...]:
        """What holds exactly now."""
        return self.sketch.relations


def scale_of(size: Placement | None, canvas: Canvas) -> Scale | None:
    """mm per world unit of an outline on ``canvas`` that ``size`` places; None if no size is given."""
    if size is None or not size.sized:
        return None
    return Scale(size.pixel_size / canvas.pixel) if size.width is None else Scale(width=size.width)


def snapped(
    outline: Sketch,
    grammar: Tracer,
    canvas: Canvas,
    target: Floats,
    scale: Scale | None = None,
    slack: float = 0.0,
) -> tuple[Snap, Program[Any]]:
    """The outline, in world units, regularised by the picture ``target`` (height, width); and its program.

    grammar: it draws the outline with its parameters laid out as `Parameters` says. scale: mm per world unit, if round
    sizes are wanted. slack: as in :class:`d4cad.raster.band.SquaresTable`.
    """
    layout = Parameters(outline)
    picture = Picture(grammar.drawn(outline.loops), grammar, canvas, SquaresTable.of(target, slack))
    params = _polished(picture, layout)
    variance = picture.variance(params)

    def renewed(at: Floats) -> Evidence:
        best, matrix = picture.newton(at)
        return Evidence(best, matrix, picture.loss, variance, canvas.pixel)

    _, matrix = picture.newton(params)
    evidence = Evidence(params, matrix, picture.loss, variance, canvas.pixel)
    found = regularized(outline, evidence, scale=scale, renewed=renewed)
    before, after = (loss / canvas.size for loss in (found.before, found.after))
    return Snap(found.sketch, found.moved, before, after, found.freed), picture.program.moved(found.params)


def _polished(picture: Picture, layout: Parameters) -> Floats:
    """The outline's parameters after the few steps that undo what joining its edges has cost."""
    params = layout.values
    loss = picture.loss(params)
    for _ in range(POLISH):
        step, _ = picture.newton(params)
        better = picture.loss(step)
        if not better < loss:
            break
        try:
            layout.sketched(step)
        except GeometryError:
            break
        gained, params, loss = loss - better, step, better
        if gained < 1e-3 * loss:
            break
    return params
