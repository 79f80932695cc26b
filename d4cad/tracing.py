"""A start from the picture itself: its contours, sub-pixel, already parted into lines and arcs.

The contour at coverage 1/2 by marching squares (Lorensen and Cline 1987, here contourpy) lies within a tenth of a pixel
of a straight or gently bent boundary, but cuts corners; a picture with noise or without grey is smoothed first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from d4cad.canvas import Canvas
from d4cad.loop import Loop
from d4cad.program import Floats
from d4cad.segmentation import segment

LEVEL = 0.5
CLEAN = 0.02
"""Standard deviation of the noise under which a picture needs no smoothing."""
SMOOTHING = 1.0
"""Standard deviation in pixels of the smoothing of others."""
TOLERANCE = 0.4
"""How far (px) an edge may be from the contour of a clean picture: less is a matter of cut corners."""
ROUGH_TOLERANCE = 0.6
LEAST_AREA = 4.0
"""Contours around fewer square pixels are specks."""


def contours(target: Floats, blur: float = 0.0) -> list[Floats]:
    """The closed contours of coverage (height, width): points (n, 2) in pixels from the lower left corner, the last one
    not repeated, the inside on their left. What lies beyond the picture is outside.

    blur: standard deviation in pixels of the smoothing before.
    """
    from contourpy import contour_generator
    from scipy.ndimage import gaussian_filter

    framed = np.pad(target, 1)
    if blur > 0:
        framed = gaussian_filter(framed, blur)
        framed[0], framed[-1], framed[:, 0], framed[:, -1] = 0, 0, 0, 0
    lines = [np.asarray(line) for line in contour_generator(z=framed, corner_mask=False).lines(LEVEL)]
    return [line[:-1] - 0.5 for line in lines if abs(_area(line[:-1])) >= LEAST_AREA]


def _area(points: Floats) -> float:
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def traced(target: Floats, canvas: Canvas, noise: float = 0.0) -> Sequence[Loop]:
    """The picture's contours as loops of lines and arcs in world units, the inside on their left.

    noise: standard deviation of a pixel, that of a picture without grey included.
    """
    rough = noise > CLEAN
    tolerance = ROUGH_TOLERANCE if rough else TOLERANCE
    found = []
    for points in contours(target, SMOOTHING if rough else 0.0):
        found.append(segment(canvas.to_world(points), tolerance * canvas.pixel))
    return found
