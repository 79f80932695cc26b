"""Where a program is drawn: domain, resolution and edge model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError

SPAN = 3.0
"""World units along the longer side of every canvas: the paper's domain is [-1.5, 1.5]^2."""

PAPER_RAMP = 1 / sqrt(2)
"""Half-width in pixels of the paper's coverage ramp (SPEC: blur 1/sqrt(2))."""


AREA = 0.0
"""The ``ramp`` of a canvas on which coverage is exact area, as renderers draw it."""


@dataclass(frozen=True, slots=True)
class Canvas:
    """A grid of ``height`` x ``width`` square pixels whose centre is the world's origin, y up.

    Pixel (i, j) of an array on the canvas has its centre at column coordinate j + 0.5 from the left
    and row coordinate i + 0.5 from the *bottom*: row 0 is the lowest, as in the paper.

    ``pixel``: world units per pixel. ``ramp``: the edge model. Above 0 the half-width in pixels of the linear ramp by
    which coverage falls from 1 to 0 across an edge: coverage = clip(1/2 - d / (2 ramp), 0, 1) for the signed distance
    d in pixels, negative inside. ``AREA`` = 0: coverage is the exact area of the pixel inside the shape.
    """

    width: int
    height: int
    pixel: float
    ramp: float = PAPER_RAMP

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise InputError(f"a canvas needs at least 1x1 pixels, got {self.width}x{self.height}")
        if not (self.pixel > 0 and self.ramp >= 0):
            raise InputError(
                f"the pixel size must be positive and the ramp not negative, got {self.pixel} and {self.ramp}"
            )

    @classmethod
    def square(cls, n: int = 256, ramp: float = PAPER_RAMP) -> Canvas:
        """The paper's canvas: n x n pixels over [-1.5, 1.5]^2."""
        return cls(n, n, SPAN / n, ramp)

    @classmethod
    def for_image(cls, shape: tuple[int, ...], ramp: float = PAPER_RAMP) -> Canvas:
        """The canvas of an array of ``shape`` (height, width): the longer side spans 3 world units."""
        height, width = shape[:2]
        return cls(width, height, SPAN / max(width, height), ramp)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width), the shape of an array on this canvas."""
        return self.height, self.width

    @property
    def size(self) -> int:
        """Number of pixels."""
        return self.height * self.width

    @property
    def extent(self) -> tuple[float, float]:
        """Half-sizes (x, y) of the domain in world units."""
        return self.width * self.pixel / 2, self.height * self.pixel / 2

    def with_ramp(self, ramp: float) -> Canvas:
        """The same grid with another edge model."""
        return replace(self, ramp=ramp)

    def to_pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """World points (..., 2) as (column, row) coordinates in pixels from the lower left corner."""
        return np.asarray(points / self.pixel + np.array([self.width / 2, self.height / 2]))

    def to_world(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The inverse of :meth:`to_pixels`."""
        return np.asarray((points - np.array([self.width / 2, self.height / 2])) * self.pixel)
