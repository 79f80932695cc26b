"""The paper's compliance loss, as published: a linear ramp, stiffness by the square of occupancy, a gradient injected
at the boundary, and a controller for the volume (SPEC 6). For comparison; :mod:`d4cad.objectives.compliance` is ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from d4cad.canvas import SPAN
from d4cad.objectives.fem import PlaneStress
from d4cad.program import Floats
from d4cad.protocols import Evaluation
from d4cad.raster.band import Band

WEAK = 1e-4
REACH = 1.0
"""Pixels to either side of the boundary in which the gradient acts: the ramp that the canvas must have."""


@dataclass(eq=False)
class Controller:
    """The published PID controller, its derivative gain 0: the multiplier is the error plus a fifth of its sum.

    start: the first volume. The volume asked for falls linearly to half of it within ``steps`` steps.
    """

    start: float
    steps: int = 500
    count: int = 0
    summed: float = 0.0
    multiplier: float = 0.0

    @property
    def wanted(self) -> float:
        """The mean occupancy asked for now."""
        return self.start * (1 - 0.5 * min(1.0, self.count / self.steps))

    def advance(self, volume: float) -> None:
        """One step at a mean occupancy."""
        error = volume - self.wanted
        self.summed += error
        self.multiplier = error + 0.2 * self.summed
        self.count += 1


@dataclass(frozen=True, slots=True, eq=False)
class PaperCompliance:
    """C + l (V - V*), V the mean occupancy. It is its own objective; every evaluation advances the controller.

    ramp: half-width in pixels of the occupancy's ramp.
    """

    elastic: PlaneStress
    controller: Controller
    ramp: float
    live: bool = True

    def draw(self, rng: np.random.Generator) -> PaperCompliance:
        """The loss itself."""
        return self

    def frozen(self) -> PaperCompliance:
        """The loss with the multiplier that it has now, for proposals."""
        return replace(self, live=False)

    def value(self, band: Band) -> float:
        """The loss at the present multiplier."""
        filled = self.occupancy(band.coverage)
        compliance = self.elastic.solve(WEAK + (1 - WEAK) * filled**2).compliance
        return self._value(compliance, float(filled.mean()))

    def _value(self, compliance: float, volume: float) -> float:
        return compliance + self.controller.multiplier * (volume - self.controller.wanted)

    def evaluate(self, band: Band) -> Evaluation:
        """The loss, and as its gradient the sensitivity less the multiplier at every pixel within REACH."""
        filled = self.occupancy(band.coverage)
        response = self.elastic.solve(WEAK + (1 - WEAK) * filled**2)
        volume = float(filled.mean())
        if self.live:
            self.controller.advance(volume)
        push = 2 * filled * (1 - WEAK) * response.energy - self.controller.multiplier
        # coverage = (1 - distance / REACH) / 2 on the canvas' ramp, in pixels; the paper's distance is in world units
        gradient = band.pull_back(-2 * REACH * push) * SPAN / band.shape[0]
        return Evaluation(self._value(response.compliance, volume), gradient)

    def occupancy(self, coverage: Floats) -> Floats:
        """The paper's occupancy from coverage on a ramp of half-width REACH."""
        distance = (0.5 - coverage) * 2 * REACH
        return np.clip(0.5 - distance / (2 * self.ramp), 0.0, 1.0)

    def demand(self, band: Band) -> Floats:
        """Nothing: places for new loops are drawn at random."""
        return np.zeros(band.shape)
