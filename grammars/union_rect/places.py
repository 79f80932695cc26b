"""Where new rectangles and holes might go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import ndimage

from d4cad.canvas import Canvas
from d4cad.program import Floats

Box = tuple[float, float, float, float, float]
"""Centre x, y, half-sizes and angle of a box, world units and radians."""


class Places(Protocol):
    """A way to choose boxes to fill or to empty, and shares at which to split."""

    def boxes(
        self, demand: Floats, inside: Floats, canvas: Canvas, rng: np.random.Generator, count: int
    ) -> tuple[list[Box], list[Box]]:
        """Boxes for new rectangles and boxes for holes, given where material is wanted (Loss.demand), the present
        coverage, (height, width) each, and the number of rectangles."""
        ...

    def shares(self, rng: np.random.Generator) -> tuple[float, ...]:
        """Shares of a rectangle's extent at which to split it."""
        ...


@dataclass(frozen=True, slots=True)
class UniformPlaces:
    """The paper's choice (SPEC 4.1): points uniform over the canvas, max(number of rectangles, least) of them.

    Outside the shape a square of half-size ``add`` at a random angle, inside a hole of half-size ``hole``; one random
    share for each split.
    """

    least: int = 32
    add: float = 0.03
    hole: float = 0.05

    def boxes(
        self, demand: Floats, inside: Floats, canvas: Canvas, rng: np.random.Generator, count: int
    ) -> tuple[list[Box], list[Box]]:
        """Squares at random points."""
        points = rng.uniform(-1, 1, (max(count, self.least), 2)) * canvas.extent
        cells = canvas.to_pixels(points).astype(np.int64)
        rows = np.minimum(cells[:, 1], canvas.height - 1)
        cols = np.minimum(cells[:, 0], canvas.width - 1)
        fill, empty = [], []
        for (x, y), within in zip(points.tolist(), (inside[rows, cols] >= 0.5).tolist(), strict=True):
            angle = float(rng.uniform(0, np.pi / 2))
            if within:
                empty.append((x, y, self.hole, self.hole, 0.0))
            else:
                fill.append((x, y, self.add, self.add, angle))
        return fill, empty

    def shares(self, rng: np.random.Generator) -> tuple[float, ...]:
        """One uniform share."""
        return (float(rng.uniform()),)


@dataclass(frozen=True, slots=True)
class DemandPlaces:
    """Where the demand is: a box for every connected region of demand above each of ``levels``, of either sign.

    For each region the box of its second moments, and the square in its deepest place at the same angle. Regions of
    fewer than ``least`` pixels are left out, the ``most`` largest are kept for each sign and level.
    """

    levels: tuple[float, ...] = (0.5,)
    least: int = 4
    most: int = 8
    cuts: tuple[float, ...] = (0.25, 0.5, 0.75)

    def boxes(
        self, demand: Floats, inside: Floats, canvas: Canvas, rng: np.random.Generator, count: int
    ) -> tuple[list[Box], list[Box]]:
        """Boxes where material is missing, and where there is too much."""
        fill = [box for level in self.levels for box in self._regions(demand > level, canvas)]
        empty = [box for level in self.levels for box in self._regions(demand < -level, canvas)]
        return fill, empty

    def shares(self, rng: np.random.Generator) -> tuple[float, ...]:
        """The same cuts for every rectangle."""
        return self.cuts

    def _regions(self, wanted: np.ndarray, canvas: Canvas) -> list[Box]:
        labels, count = ndimage.label(wanted)
        if count == 0:
            return []
        sizes = np.bincount(labels.ravel())[1:]
        found = []
        slices = ndimage.find_objects(labels)
        for k in np.argsort(-sizes, kind="stable")[: self.most].tolist():
            if sizes[k] < self.least:
                break
            window = slices[k]
            mask = np.pad(labels[window] == k + 1, 1)
            rows, cols = np.nonzero(mask)
            points = np.stack([cols + window[1].start - 0.5, rows + window[0].start - 0.5], axis=1)
            spread = np.cov(points.T, bias=True)
            values, axes = np.linalg.eigh(spread)
            angle = float(np.arctan2(axes[1, 1], axes[0, 1]))
            # A box of half-size h has the variance h^2 / 3 along it.
            half = np.maximum(np.sqrt(3 * np.maximum(values[::-1], 0)), 0.75)
            x, y = canvas.to_world(points.mean(axis=0))
            found.append((float(x), float(y), *(half * canvas.pixel).tolist(), angle))
            depth = ndimage.distance_transform_edt(mask)
            deepest = np.unravel_index(int(np.argmax(depth)), depth.shape)
            radius = max(float(depth[deepest]) - 0.5, 0.75) * canvas.pixel
            x, y = canvas.to_world(
                np.array([deepest[1] + window[1].start - 0.5, deepest[0] + window[0].start - 0.5], dtype=np.float64)
            )
            found.append((float(x), float(y), radius, radius, angle))
        return found
