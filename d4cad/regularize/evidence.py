"""What a picture says about a sketch's parameters: the most likely values, how well it fixes them, and a loss."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from d4cad.edges import Floats
from d4cad.regularize.parameters import Parameters

REACH = 2.0
"""Standard deviation in pixels of a vertex' place, and of an arc's apex, before the picture is asked: an outline that
was fitted is not off by many pixels even along directions that the picture leaves open."""

ROUNDING = 1e-11
"""What keeps a singular matrix positive definite in floating point."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """params: (n,) where the loss is least. matrix: (n, n) with loss(params + d) = loss(params) + d' matrix d for small
    d: the Gauss-Newton matrix J'J of a sum of squares. variance: the loss that noise alone adds for one parameter that
    is held to its true value; of a picture, a pixel's noise variance. pixel: its size in the sketch's unit.
    """

    params: Floats
    matrix: Floats
    loss: Callable[[Floats], float]
    variance: float
    pixel: float

    def spread(self, layout: Parameters) -> Floats:
        """(n, n) matrix S with params + S u as likely as u, standard normal: S S' is the covariance.

        From here on all lengths of moves are in these units, of one standard deviation each.
        """
        count = layout.starts[-1]
        length = np.full(self.params.size, self.pixel)
        points = self.params[: 2 * count].reshape(-1, 2)
        chord = np.hypot(*(points[layout.following] - points).T)
        length[2 * count :] = 2 * self.pixel / chord[layout.arcs]  # a bulge moves the apex by half the chord
        precision = self.matrix / self.variance + np.diag((REACH * length) ** -2)
        unit = 1 / np.sqrt(np.diagonal(precision))
        correlation = precision * np.outer(unit, unit)
        factor = cholesky(correlation + ROUNDING * np.eye(unit.size), lower=True)
        return np.asarray(unit[:, None] * solve_triangular(factor, np.eye(unit.size), lower=True).T)
