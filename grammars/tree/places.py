"""Where a tree might grow to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import ndimage

from d4cad.canvas import Canvas
from d4cad.grammars.tree.structure import Limits
from d4cad.program import Floats

Place = tuple[float, float, float]
"""x, y in world units, and the size of the leaf that has room there (0: not known)."""


class Places(Protocol):
    """A way to choose the points that new chains of nodes lead to."""

    def __call__(
        self, demand: Floats, canvas: Canvas, limits: Limits, count: int, rng: np.random.Generator
    ) -> list[Place]:
        """Places, given where material is wanted (Loss.demand), (height, width), and the number of nodes."""
        ...


@dataclass(frozen=True, slots=True)
class UniformPlaces:
    """The paper's choice: as many as there are nodes and at least ``least``, uniform over the canvas but for a margin
    of the greatest leaf size.

    The paper keeps that margin at the size limit of 1 that its Tr-5 has (SPEC 5.4), which confines its points to the
    middle of the canvas; here sizes are limited to what leaves have.
    """

    least: int = 32

    def __call__(
        self, demand: Floats, canvas: Canvas, limits: Limits, count: int, rng: np.random.Generator
    ) -> list[Place]:
        """Random places of unknown size."""
        half = np.maximum(np.array(canvas.extent) - limits.size, 0.0)
        points = rng.uniform(-1, 1, (max(count, self.least), 2)) * half
        return [(float(x), float(y), 0.0) for x, y in points]


@dataclass(frozen=True, slots=True)
class DemandPlaces:
    """Where the demand is: the places deepest within the region of demand above ``level``, one for each square of
    ``tile`` pixels, the ``most`` deepest that are at least ``least`` pixels deep."""

    level: float = 0.5
    tile: int = 8
    least: float = 1.0
    most: int = 64

    def __call__(
        self, demand: Floats, canvas: Canvas, limits: Limits, count: int, rng: np.random.Generator
    ) -> list[Place]:
        """Places with the size of the largest disc that fits there, within the limit."""
        wanted = demand > self.level
        if not wanted.any():
            return []
        depth = ndimage.distance_transform_edt(np.pad(wanted, 1))[1:-1, 1:-1]
        rows, cols = -(-canvas.height // self.tile), -(-canvas.width // self.tile)
        padded = np.zeros((rows * self.tile, cols * self.tile))
        padded[: canvas.height, : canvas.width] = depth
        tiles = padded.reshape(rows, self.tile, cols, self.tile).swapaxes(1, 2).reshape(rows * cols, -1)
        deepest = tiles.max(axis=1)
        chosen = np.argsort(-deepest, kind="stable")[: self.most]
        chosen = chosen[deepest[chosen] >= self.least]
        places = []
        for tile, inner in zip(chosen.tolist(), tiles[chosen].argmax(axis=1).tolist(), strict=True):
            row = (tile // cols) * self.tile + inner // self.tile
            col = (tile % cols) * self.tile + inner % self.tile
            x, y = canvas.to_world(np.array([col + 0.5, row + 0.5]))
            places.append((float(x), float(y), float(min(deepest[tile] * canvas.pixel, limits.size))))
        return places


def shape_bottom(target: Floats, canvas: Canvas) -> tuple[float, float]:
    """The middle of the lowest row that a target (height, width) fills, in world units: the median pixel's centre.

    The bottom of the canvas where the target fills none.
    """
    rows = np.flatnonzero((target > 0.5).any(axis=1))
    if rows.size == 0:
        return 0.0, -canvas.extent[1]
    cols = np.flatnonzero(target[rows[0]] > 0.5)
    x, y = canvas.to_world(np.array([cols[(cols.size - 1) // 2] + 0.5, rows[0] + 0.5]))
    return float(x), float(y)
