"""The design domain and the compliance objective: adjoints, gradients, and what the fine grid says of them."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from d4cad.beams.library import CANTILEVER
from d4cad.beams.problem import Place
from d4cad.grammars.arc_line import ArcLine
from d4cad.grammars.arc_line.structure import Structure
from d4cad.objectives.compliance import ComplianceLoss, tented
from d4cad.program import Floats, Program

BENCHMARK = Path(__file__).parent.parent / "benchmarks" / "beam_gradient.py"


def loaded(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


trusses = loaded(BENCHMARK)
FRAME = trusses.frame(60, 30)


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans())
def test_folded_is_the_transpose_of_unfolded(seed: int, left: bool, low: bool) -> None:
    """<unfolded(c), g> = <c, folded(g)> but for the fixed elements, which no coverage moves."""
    rng = np.random.default_rng(seed)
    domain = replace(
        replace(CANTILEVER, element=6.0, voids=(Place((60, 30), (60, 30), 9.0),)).domain(), mirrored=(left, low)
    )
    coverage, gradient = rng.normal(size=domain.canvas.shape), rng.normal(size=domain.shape)
    fixed = domain.unfolded(np.zeros(domain.canvas.shape))
    through = np.sum((domain.unfolded(coverage) - fixed) * gradient)
    assert through == pytest.approx(np.sum(coverage * domain.folded(gradient)))


def test_unfolding_mirrors() -> None:
    domain = replace(CANTILEVER, element=6.0).domain()
    assert domain.mirrored == (False, True)
    assert domain.canvas.shape == (5 + 8, 20 + 8)
    density = domain.unfolded(np.random.default_rng(0).uniform(size=domain.canvas.shape))
    assert density.shape == (10, 20)
    assert np.array_equal(density, density[::-1])


def test_fixed_regions_stay() -> None:
    solid, void = Place((60, 30), (60, 30), 15.0), Place((60, 30), (60, 30), 7.0)
    domain = replace(CANTILEVER, element=3.0, solids=(solid,), voids=(void,)).domain()
    for coverage in (0.0, 1.0):
        density = domain.unfolded(np.full(domain.canvas.shape, coverage))
        assert np.all(density[domain.solid] == 1)
        assert np.all(density[domain.void] == 0)
        assert np.all(density[domain.free] == coverage)


def test_tent_is_a_ramp_with_a_tent_for_a_derivative() -> None:
    """Coverage of a straight side moved across a pixel, and its derivative by the move."""
    domain = FRAME.domain()
    grammar, canvas = ArcLine(domain.canvas.pixel), domain.canvas
    program = trusses.truss(domain)
    way = trusses.parallel_motion(program, 0) * canvas.pixel  # the lower side moves down by one element
    places = np.linspace(-1.2, 1.2, 25)
    column = canvas.shape[1] // 2
    row = domain.margin + 2  # its centre is half an element above the side
    covers, slopes = [], []
    for place in places:
        soft = tented(grammar.rasterize(program.moved(program.params + place * way), canvas))
        covers.append(soft.coverage[row, column])
        pick = np.zeros(canvas.shape)
        pick[row, column] = 1.0
        slopes.append(soft.pull_back(pick) @ way)
    t = np.clip(-0.5 - places, -1, 1)  # distance of the centre over the half-width, negative inside
    assert covers == pytest.approx(0.5 - t + np.sign(t) * t * t / 2, abs=1e-9)
    assert slopes == pytest.approx(1 - np.abs(t), abs=1e-9)


@given(st.integers(0, 2**32 - 1))
@example(6518)  # a pixel's nearest edge changes 4e-8 behind the program
def test_gradient_is_that_of_the_soft_objective(seed: int) -> None:
    """Differences of second order in float64 along random directions: compliance, and volume.

    Where the nearest edge of a pixel changes, its coverage has a kink. One that lies within the step spoils the
    difference on its side alone, so the gradient has to agree with the forward or with the backward difference.
    """
    domain = FRAME.domain()
    loss, grammar = ComplianceLoss.of(domain), ArcLine(domain.canvas.pixel)
    rng = np.random.default_rng(seed)
    start = trusses.truss(domain)
    program = start.moved(start.params + np.concatenate([np.zeros(26), rng.uniform(-0.1, 0.1, 13)]))
    way = rng.normal(size=program.params.size)

    def values(step: float) -> Floats:
        density = loss.density(grammar.rasterize(program.moved(program.params + step * way), domain.canvas))
        return np.array([loss.response(density).compliance / loss.full, density.sum()])

    found = loss.evaluate(grammar.rasterize(program, domain.canvas))
    assert found.constraint is not None
    exact = [(4 * values(h) - values(2 * h) - 3 * values(0)) / (2 * h) for h in (1e-7, -1e-7)]
    scale = np.linalg.norm(way) * np.array([np.linalg.norm(found.gradient), np.linalg.norm(found.constraint.gradient)])
    slopes = np.array([found.gradient @ way, found.constraint.gradient @ way])
    errors = np.abs(slopes - exact) / scale  # (forward and backward, compliance and volume)
    assert errors.max(axis=1).min() < 1e-6


def test_gradient_is_near_that_of_the_solid_part_on_a_fine_grid() -> None:
    """Every edge moved by half an element either way; solid and void, four times as fine, seven elements a member.

    At 120 x 60 benchmarks/beam_gradient.py has a median of under 5 percent; at this half size it is larger.
    """
    found, exact = trusses.slopes(FRAME, edges=(0, 2, 4, 6, 8, 10, 12)).T
    errors = np.abs(found / exact - 1)
    assert np.median(errors) < 0.10
    assert errors.max() < 0.25


def test_demand_wants_holes_where_nothing_is_carried() -> None:
    domain = FRAME.domain()
    loss, grammar = ComplianceLoss.of(domain), ArcLine(domain.canvas.pixel)
    low, high = domain.canvas.to_world(np.array([[2.0, 2.0], [66.0, 36.0]]))
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    full = Program(Structure((4,), (False,) * 4), corners.ravel())
    wanted = loss.demand(grammar.rasterize(full, domain.canvas))[4:-4, 4:-4]
    assert wanted.max() <= 0
    assert wanted[-3:, -10:].mean() < -0.9  # the unloaded corner
    assert wanted[:2, :5].mean() > -0.1  # the clamped one
