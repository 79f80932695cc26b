"""A program to start from: the contour of a density, or the whole domain."""

from __future__ import annotations

from typing import Any

import numpy as np

from d4cad.objectives.domain import Domain
from d4cad.program import Floats
from d4cad.sketch import Loop, Sketch

TOLERANCE = 0.5
"""Elements by which the first outline may leave the contour: shape descent moves it further than that anyway."""


def density_contour(domain: Domain, density: Floats) -> list[Floats]:
    """Closed polylines (n, 2) in pixels of the domain's canvas around the densest elements of the domain's volume.

    Beyond the domain, where a program is cut off, the density of the nearest element goes on.
    """
    from contourpy import contour_generator
    from scipy.ndimage import distance_transform_edt

    level = np.sort(density[domain.inside])[::-1][round(domain.volume)]
    nearest = distance_transform_edt(~domain.inside, return_distances=False, return_indices=True)
    height, width = domain.drawn
    around = np.pad(density[tuple(nearest)], domain.margin, mode="edge")
    around = np.pad(around[: height + 2 * domain.margin, : width + 2 * domain.margin], 1)
    # pixel centres lie half a pixel in, and the frame of zeros that closes the contours one out
    return [np.asarray(line[:-1] - 0.5) for line in contour_generator(z=around).lines(level) if len(line) > 3]


def density_sketch(domain: Domain, density: Floats) -> Sketch:
    """The contour as few lines and arcs, in world units of the domain's canvas."""
    from d4cad.segmentation import segment

    canvas = domain.canvas
    found = [segment(line, TOLERANCE) for line in density_contour(domain, density)]
    points = [canvas.to_world(np.array(loop.points)) for loop in found]
    loops = [Loop.from_arrays(p, np.array(loop.bulges)) for p, loop in zip(points, found, strict=True)]
    return Sketch.from_loops([loop for loop in loops if abs(loop.area) > canvas.pixel**2])


def whole_domain(domain: Domain) -> Sketch:
    """A box over all that a program may draw."""
    x, y = domain.canvas.extent
    edge = domain.canvas.pixel
    corners = [(edge - x, edge - y), (x - edge, edge - y), (x - edge, y - edge), (edge - x, y - edge)]
    return Sketch.from_loops([Loop.polyline(corners)])
