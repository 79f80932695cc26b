"""The trained prior as it is shipped."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

from d4cad.objectives.distillation import Distillation, Wish
from d4cad.priors.learned import learned
from d4cad.priors.library import shipped
from d4cad.priors.network import SIDE
from d4cad.text import fit_text


def test_the_shipped_weights_know_their_words() -> None:
    assert (files("d4cad.priors") / "learned.safetensors").stat().st_size < 6_000_000  # type: ignore[attr-defined]
    prior = learned("heart")
    coverage = shipped().picture("heart").reshape(SIDE, 4, SIDE, 4).mean(axis=(1, 3))
    for time in (0.3, 0.6):
        loss = Distillation(prior, Wish("heart", guidance=1.0), (time, time), 1).draw(np.random.default_rng(0))
        seen = loss.estimate(2 * coverage[None, None] - 1)[0, 0]
        assert np.mean((seen - (2 * coverage - 1)) ** 2) < 0.1


def test_the_shipped_weights_make_a_part() -> None:
    (candidate,) = fit_text("heart", prior="learned", steps=100, seed=1)
    assert candidate.fit.primitives <= 60
    picture = shipped().picture("heart").reshape(64, 2, 64, 2).mean(axis=(1, 3))
    shapes = [candidate.fit.coverage, picture]
    areas = [shape.mean() for shape in shapes]
    assert areas[0] == pytest.approx(areas[1], rel=0.4)
