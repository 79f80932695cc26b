"""How coverage is shown to a denoiser: resampled, and if asked in random perspective, cropped, on a shade of ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from d4cad.errors import InputError
from d4cad.program import Floats


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A linear map from coverage to a picture, and a shade.

    size: pixels along the picture. corners: (4, 2) where the picture's corners lie on the canvas, as shares of it from
    (0, 0) bottom left to (1, 1), in the order bottom left, bottom right, top right, top left. ground, ink: what is
    shown for coverage 0 and 1. smooth resampling: bilinear, ground beyond the canvas.
    """

    size: int
    corners: Floats | None = None
    ground: float = 0.0
    ink: float = 1.0

    def show(self, coverage: Floats) -> Floats:
        """The picture (size, size) of coverage (height, width), row 0 lowest in both."""
        seen = coverage
        if self._resamples(coverage.shape):
            seen = (self._matrix(coverage.shape) @ coverage.ravel()).reshape(self.size, self.size)
        return self.ground + (self.ink - self.ground) * seen

    def back(self, gradient: Floats, shape: tuple[int, ...]) -> Floats:
        """From d/dpicture (size, size) to d/dcoverage of ``shape``."""
        gradient = gradient * (self.ink - self.ground)
        if not self._resamples(shape):
            return gradient
        return np.asarray((self._matrix(shape).T @ gradient.ravel()).reshape(shape))

    def _resamples(self, shape: tuple[int, ...]) -> bool:
        return self.corners is not None or shape != (self.size, self.size)

    def _matrix(self, shape: tuple[int, ...]) -> Any:
        """The sparse matrix (size^2, height * width) of the resampling."""
        from scipy.sparse import csr_matrix

        corners = SQUARE if self.corners is None else self.corners
        height, width = shape
        across = (np.arange(self.size) + 0.5) / self.size
        u, v = (part.ravel() for part in np.meshgrid(across, across))
        x, y = projected(corners, u, v)
        column, row = x * width - 0.5, y * height - 0.5
        left, low = np.floor(column).astype(int), np.floor(row).astype(int)
        entries: list[tuple[Floats, Any, Any]] = []
        for j, by_x in ((left, left + 1 - column), (left + 1, column - left)):
            for i, by_y in ((low, low + 1 - row), (low + 1, row - low)):
                held = (j >= 0) & (j < width) & (i >= 0) & (i < height)
                entries.append(((by_x * by_y)[held], np.flatnonzero(held), (i * width + j)[held]))
        values, rows, columns = (np.concatenate(parts) for parts in zip(*entries, strict=True))
        return csr_matrix((values, (rows, columns)), (self.size**2, height * width))


SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def projected(corners: Floats, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Where the homography that takes the unit square's corners to ``corners`` takes points (u, v), (n,) each."""
    rows, right = [], []
    for (s, t), (x, y) in zip(SQUARE, corners, strict=True):
        rows += [[s, t, 1, 0, 0, 0, -x * s, -x * t], [0, 0, 0, s, t, 1, -y * s, -y * t]]
        right += [x, y]
    a, b, c, d, e, f, g, h = np.linalg.solve(np.array(rows), np.array(right))
    depth = g * u + h * v + 1
    return (a * u + b * v + c) / depth, (d * u + e * v + f) / depth


@dataclass(frozen=True, slots=True)
class Views:
    """How views are drawn.

    count: at a time. chance: of a view in perspective, whose corners then move inwards or outwards by up to
    ``distortion`` of half the picture. crop: the least side of a random crop as a share of the canvas. shade: ground
    and ink are drawn within so much of 0 and 1.
    """

    count: int = 1
    chance: float = 0.0
    distortion: float = 0.5
    crop: float = 1.0
    shade: float = 0.0

    def __post_init__(self) -> None:
        if self.count < 1 or not (0 <= self.chance <= 1 and 0 <= self.distortion < 1):
            raise InputError("views need a count of 1 or more, a chance from 0 to 1 and a distortion from 0 to below 1")
        if not (0 < self.crop <= 1 and 0 <= self.shade < 0.5):
            raise InputError("a crop is a share above 0 and up to 1, a shade from 0 to below 0.5")

    def draw(self, size: int, rng: np.random.Generator) -> tuple[View, ...]:
        """``count`` views of pictures of ``size`` pixels a side."""
        return tuple(self._one(size, rng) for _ in range(self.count))

    def _one(self, size: int, rng: np.random.Generator) -> View:
        corners: Floats | None = None
        if self.chance > 0 and rng.random() < self.chance:
            # torchvision's RandomPerspective moves corners inwards in the picture: the same as a look from further off
            inward = rng.uniform(0, self.distortion / 2, (4, 2)) * (1 - 2 * SQUARE)
            corners = SQUARE - inward
        if self.crop < 1:
            side = rng.uniform(self.crop, 1)
            low = rng.uniform(0, 1 - side, 2)
            corners = low + side * (SQUARE if corners is None else corners)
        ground = rng.uniform(0, self.shade) if self.shade else 0.0
        ink = 1 - rng.uniform(0, self.shade) if self.shade else 1.0
        return View(size, corners, ground, ink)


PLAIN = Views()
"""One view, straight on."""

PAPER = Views(chance=0.7, distortion=0.5, crop=512 / 600)
"""The paper's (SPEC 6): perspective of distortion 0.5 with probability 0.7, a crop of 512 pixels out of 600."""
