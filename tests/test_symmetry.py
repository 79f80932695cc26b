"""Halves of symmetric structures against the whole ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from d4cad.beams.library import BRIDGE, CANTILEVER, L_BRACKET, MBB
from d4cad.beams.problem import Load, Place, Problem, Support
from d4cad.errors import InputError
from d4cad.objectives.symmetry import Folded

LEFT, RIGHT = Place((0, 0), (0, 40)), Place((80, 0), (80, 40))
PULLED = Problem(
    "pulled", (80, 40), 4.0, 0.5,
    supports=(Support(Place((40, 20), (40, 20))), Support(Place((40, 0), (40, 40)), "x")),
    loads=(Load(LEFT, (-500.0, 0.0)), Load(RIGHT, (500.0, 0.0))),
)  # fmt: skip
UP, ACROSS = Load(Place((40, 40), (40, 40)), (0.0, 9.0), "up"), Load(Place((40, 40), (40, 40)), (5.0, 0.0), "across")
PORTAL = Problem(
    "portal", (80, 40), 4.0, 0.5, supports=(Support(Place((0, 0), (80, 0))),), loads=(UP, ACROSS)
)  # fmt: skip

CASES = [
    (replace(CANTILEVER, element=6.0), (False, True)),
    (replace(MBB, element=10.0), (True, False)),
    (replace(BRIDGE, element=6.0), (True, False)),
    (replace(L_BRACKET, element=10.0), (False, False)),
    (PULLED, (True, True)),
    (replace(PORTAL, loads=(UP,)), (True, False)),
    (replace(PORTAL, loads=(ACROSS,)), (True, False)),
]


@pytest.mark.parametrize(("problem", "halves"), CASES, ids=lambda value: getattr(value, "name", None))
def test_the_half_works_as_the_whole(problem: Problem, halves: tuple[bool, bool]) -> None:
    """Loads that are symmetric, loads that push here as they pull there, loads on the axis, both axes."""
    domain = problem.domain()
    assert domain.mirrored == halves
    folded = Folded.of(domain.elastic, domain.mirrored)
    assert folded.halves == halves
    assert folded.elastic.grid.size < domain.elastic.grid.size or not any(halves)
    rng = np.random.default_rng(0)
    density = domain.unfolded(rng.uniform(0.1, 1.0, domain.canvas.shape))
    whole = domain.elastic.solve(domain.young(density))
    found = domain.work(density)
    assert found.compliance == pytest.approx(whole.compliance, rel=1e-9)
    assert found.energy == pytest.approx(whole.energy, rel=1e-6, abs=1e-9 * whole.energy.max())


def test_load_cases_of_both_kinds_need_the_whole() -> None:
    domain = PORTAL.domain()
    assert domain.mirrored == (True, False)
    assert Folded.of(domain.elastic, domain.mirrored).halves == (False, False)
    density = domain.unfolded(np.random.default_rng(1).uniform(0.1, 1.0, domain.canvas.shape))
    assert domain.work(density).compliance == domain.elastic.solve(domain.young(density)).compliance


def test_a_half_of_nothing_is_a_mechanism() -> None:
    with pytest.raises(InputError, match="mechanism"):
        replace(CANTILEVER, element=6.0).domain().work(np.zeros((10, 20)))
