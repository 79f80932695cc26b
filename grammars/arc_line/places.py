"""Where a new loop might go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import ndimage

from d4cad.canvas import Canvas
from d4cad.program import Floats

Place = tuple[float, float, float]
"""x, y in world units, and the radius of the new loop: negative for a hole."""


class Places(Protocol):
    """A way to choose places for new loops."""

    def __call__(self, demand: Floats, inside: Floats, canvas: Canvas, rng: np.random.Generator) -> list[Place]:
        """Places, given where material is wanted (Loss.demand) and the present coverage, (height, width) each."""
        ...


@dataclass(frozen=True, slots=True)
class UniformPlaces:
    """The paper's choice: uniform over the whole canvas, one small radius (world units)."""

    count: int = 16
    radius: float = 0.01

    def __call__(self, demand: Floats, inside: Floats, canvas: Canvas, rng: np.random.Generator) -> list[Place]:
        """``count`` random places; a hole where the place lies inside the shape."""
        points = rng.uniform(-1, 1, (self.count, 2)) * canvas.extent
        cells = canvas.to_pixels(points).astype(np.int64)
        rows = np.minimum(cells[:, 1], canvas.height - 1)
        cols = np.minimum(cells[:, 0], canvas.width - 1)
        signs = np.where(inside[rows, cols] >= 0.5, -1.0, 1.0)
        return [(float(x), float(y), float(self.radius * s)) for (x, y), s in zip(points, signs, strict=True)]


@dataclass(frozen=True, slots=True)
class DemandPlaces:
    """Where the demand is: the deepest place of every connected region of demand above ``level``, of either sign.

    The depth is the distance to the region's outside (distance transform); the new circle has that radius less half a
    pixel. Circles under ``small`` pixels of radius are left to the other rewrites as long as there are larger ones,
    those under ``least`` always; the ``most`` deepest are kept per sign.
    """

    level: float = 0.5
    small: float = 2.0
    least: float = 1.0
    most: int = 16

    def __call__(self, demand: Floats, inside: Floats, canvas: Canvas, rng: np.random.Generator) -> list[Place]:
        """Places for material and, with a negative radius, for holes."""
        places = self._deepest(demand > self.level, canvas, 1.0) + self._deepest(demand < -self.level, canvas, -1.0)
        return [place for place in places if abs(place[2]) >= self.small * canvas.pixel] or places

    def _deepest(self, wanted: np.ndarray, canvas: Canvas, sign: float) -> list[Place]:
        rows, cols = np.flatnonzero(wanted.any(axis=1)), np.flatnonzero(wanted.any(axis=0))
        if rows.size == 0:
            return []
        # One pixel of margin, also beyond the canvas, so that a region at its border has its true depth.
        r, c = rows[0], cols[0]
        cut = np.pad(wanted[r : rows[-1] + 1, c : cols[-1] + 1], 1)
        depth = ndimage.distance_transform_edt(cut)
        labels, count = ndimage.label(cut)
        peaks = ndimage.maximum_position(depth, labels, range(1, count + 1))
        deep = sorted(
            ((float(depth[p]), p) for p in peaks if depth[p] - 0.5 >= self.least), key=lambda item: (-item[0], item[1])
        )
        places = []
        for radius, (i, j) in deep[: self.most]:
            x, y = canvas.to_world(np.array([c + j - 1 + 0.5, r + i - 1 + 0.5]))
            places.append((float(x), float(y), sign * (radius - 0.5) * canvas.pixel))
        return places
