"""The image-matching objective: mean squared error between coverage and a target picture (paper, section 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from d4cad.program import Floats
from d4cad.protocols import Evaluation
from d4cad.raster.band import Band, SquaresTable


@dataclass(frozen=True, slots=True, eq=False)
class ImageLoss:
    """Mean over pixels of (coverage - target)^2. It is its own objective: nothing in it is random."""

    table: SquaresTable

    @classmethod
    def of(cls, target: Floats, slack: float = 0.0) -> ImageLoss:
        """The loss of a target coverage (height, width), row 0 lowest; ``slack`` as in a SquaresTable."""
        return cls(SquaresTable.of(target, slack))

    def draw(self, rng: np.random.Generator) -> ImageLoss:
        """The loss itself."""
        return self

    def value(self, band: Band) -> float:
        """Mean squared error."""
        return self.table.value(band) / self.table.target.size

    def evaluate(self, band: Band) -> Evaluation:
        """Mean squared error, 2 J'r / N and 2 J'J / N for the N pixels."""
        value, force, matrix = self.table.normal(band)
        n = self.table.target.size
        return Evaluation(value / n, force * (2 / n), matrix * (2 / n))

    def demand(self, band: Band) -> Floats:
        """Target minus coverage."""
        return np.asarray(self.table.target - band.coverage)
