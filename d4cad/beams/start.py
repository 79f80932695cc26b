"""Programs to start from: the contour of a density, or the whole domain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from d4cad.canvas import PAPER_RAMP
from d4cad.descent import descend
from d4cad.errors import InputError
from d4cad.objectives.domain import Domain
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program
from d4cad.protocols import Tracer
from d4cad.sketch import Loop

TOLERANCE = 0.5
"""Elements by which the first outline may leave the contour: shape descent moves it further than that anyway."""

RULES = ("split", "to-line", "merge-line", "merge-arc", "close", "add-loop", "remove-loop", "pinch")
"""Arc-Line's rewrites that change what a part is made of; a joint need not be smooth to carry."""

RECTANGLE = 0.5
"""Price of a rectangle in summed squared error where a density is drawn with rectangles."""

GRAMMARS = ("arc-line", "union-rect")


def beam_grammar(name: str, domain: Domain) -> Any:
    """The grammar of that name as beams want it."""
    from d4cad.grammars.arc_line import ArcLine
    from d4cad.grammars.arc_line.places import DemandPlaces
    from d4cad.grammars.union_rect import UnionRect

    pixel = domain.canvas.pixel
    if name == "arc-line":
        return ArcLine(pixel, frozenset(RULES), DemandPlaces(small=3.0, least=2.0, most=8))
    if name == "union-rect":
        return UnionRect(pixel)
    raise InputError(f"beams are designed in one of {', '.join(GRAMMARS)}, got {name!r}")


def density_program(grammar: Any, domain: Domain, density: Floats) -> Program[Any]:
    """The program that draws a density's contour: its lines as arcs of bulge 0, so that all of them can bend.

    Where bars are thin its loops may cross, which repair mends. A grammar that cannot draw a contour is fitted to it as
    to a picture.
    """
    loops = density_loops(domain, density)
    if isinstance(grammar, Tracer):
        return _bent(loops)
    from d4cad.grammars.arc_line import ArcLine
    from d4cad.methods import fast_rectangles

    canvas = domain.canvas.with_ramp(PAPER_RAMP)
    drawn = ArcLine(canvas.pixel)
    target = drawn.rasterize(drawn.repair(drawn.drawn(loops)).program, canvas).coverage
    method = fast_rectangles(canvas, RECTANGLE)
    loss = ImageLoss.of(target)
    return descend(grammar.axiom(canvas), grammar, loss, canvas, method, np.random.default_rng(0)).program


def density_contour(domain: Domain, density: Floats) -> list[Floats]:
    """Closed polylines (n, 2) in pixels of the domain's canvas around the densest elements of the domain's volume.

    Beyond the domain, where a program is cut off, the density of the nearest element goes on.
    """
    from contourpy import contour_generator
    from scipy.ndimage import distance_transform_edt

    falling = np.sort(density[domain.inside])[::-1]
    level = falling[min(round(domain.volume), falling.size - 1)]
    nearest = distance_transform_edt(~domain.inside, return_distances=False, return_indices=True)
    height, width = domain.drawn
    around = np.pad(density[tuple(nearest)], domain.margin, mode="edge")
    around = np.pad(around[: height + 2 * domain.margin, : width + 2 * domain.margin], 1)
    # pixel centres lie half a pixel in, and the frame of zeros that closes the contours one out
    lines: Any = contour_generator(z=around).lines(level)
    return [np.asarray(line[:-1] - 0.5) for line in lines if len(line) > 3]


def density_loops(domain: Domain, density: Floats) -> list[Loop]:
    """The contour as few lines and arcs, in world units of the domain's canvas."""
    from d4cad.segmentation import segment

    canvas = domain.canvas
    found = [segment(line, TOLERANCE) for line in density_contour(domain, density)]
    points = [canvas.to_world(np.array(loop.points)) for loop in found]
    loops = [Loop.from_arrays(p, np.array(loop.bulges)) for p, loop in zip(points, found, strict=True)]
    return [loop for loop in loops if abs(loop.area) > canvas.pixel**2]


def whole_domain(grammar: Any, domain: Domain) -> Program[Any]:
    """A box over all that a program may draw."""
    x, y = domain.canvas.extent
    edge = domain.canvas.pixel
    x, y = x - edge, y - edge
    if isinstance(grammar, Tracer):
        return _bent([Loop.polyline([(-x, -y), (x, -y), (x, y), (-x, y)])])
    first = grammar.axiom(domain.canvas)
    return Program(first.structure, np.array([0.0, 0.0, x, y, 0.0]))


def _bent(loops: Sequence[Loop]) -> Program[Any]:
    """The program of loops in which every edge is an arc, straight ones of bulge 0."""
    from d4cad.grammars.arc_line.structure import Structure

    sizes = tuple(len(loop.points) for loop in loops)
    points = np.array([point for loop in loops for point in loop.points])
    bulges = np.array([bulge for loop in loops for bulge in loop.bulges])
    return Program(Structure(sizes, (True,) * len(bulges)), np.concatenate([points.ravel(), bulges]))
