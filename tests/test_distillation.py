"""Score distillation: its gradient, its views, what is drawn when."""

from __future__ import annotations

import numpy as np
import pytest

from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.grammars.arc_line import ArcLine
from d4cad.objectives.distillation import WEIGHTINGS, Distillation, DistillationLoss, Wish
from d4cad.objectives.views import PAPER, PLAIN, SQUARE, View, Views, projected
from d4cad.priors.finite import FiniteDenoiser
from d4cad.program import Floats

SIZE = 12


def drawn(weighting: str = "x0", views: Views = PLAIN, guidance: float = 1.0, time: float = 0.6) -> DistillationLoss:
    rng = np.random.default_rng(0)
    sets = {"it": rng.uniform(-1, 1, (4, SIZE**2)), "": rng.uniform(-1, 1, (4, SIZE**2))}
    denoiser = FiniteDenoiser(SIZE, sets)
    return Distillation(denoiser, Wish("it", "", guidance, weighting), (time, time), 1, views=views).draw(rng)


def held(loss: DistillationLoss, coverage: Floats) -> list[Floats]:
    """The estimates for a raster, one for each view."""
    codes = np.array([2 * view.show(coverage) - 1 for view in loss.views])[:, None]
    return list(loss.estimate(codes)[:, 0])


@pytest.mark.parametrize("weighting", WEIGHTINGS)
@pytest.mark.parametrize("views", [PLAIN, Views(count=3, chance=1.0, crop=0.8, shade=0.2)], ids=["plain", "views"])
@pytest.mark.parametrize("side", [SIZE, 20])
def test_gradient_by_differences_with_estimates_held(weighting: str, views: Views, side: int) -> None:
    rng = np.random.default_rng(1)
    loss = drawn(weighting, views, guidance=3.0)
    coverage = rng.random((side, side))
    estimates = held(loss, coverage)
    weight = WEIGHTINGS[weighting](*loss.denoiser.scales(loss.time))

    def value(raster: Floats) -> float:
        offs = [2 * view.show(raster) - 1 - seen for view, seen in zip(loss.views, estimates, strict=True)]
        return 0.5 * weight * float(np.mean(np.square(offs)))

    pull = loss.pull(coverage)
    assert pull.value == pytest.approx(value(coverage))
    for _ in range(5):
        way = rng.standard_normal(coverage.shape)
        slope = (value(coverage + 1e-5 * way) - value(coverage - 1e-5 * way)) / 2e-5
        assert float(np.sum(pull.gradient * way)) == pytest.approx(slope, rel=1e-5, abs=1e-9)


def test_gradient_is_the_published_one() -> None:
    """DreamFusion's eq. 3: weight (predicted noise - noise) d code / d picture, the weight sqrt(a) (1 - a) (SPEC 6)."""
    loss = drawn("sds")
    coverage = np.random.default_rng(2).random((SIZE, SIZE))
    alpha, sigma = loss.denoiser.scales(loss.time)
    noisy = alpha * (2 * coverage - 1)[None, None] + sigma * loss.noise
    predicted = loss.denoiser.noise(noisy, loss.time, ["it"])
    expected = alpha * sigma**2 * (predicted - loss.noise)[0, 0] * 2 / SIZE**2
    assert loss.pull(coverage).gradient == pytest.approx(expected, rel=1e-9)


def test_the_pull_is_a_squared_error_to_first_order() -> None:
    for side, views in ((SIZE, PLAIN), (18, Views(count=2, chance=1.0))):
        loss = drawn(views=views, guidance=2.0)
        coverage = np.random.default_rng(3).random((side, side))
        pull = loss.pull(coverage)
        near = 2 * (coverage - pull.near.table.target) / coverage.size
        assert near * pull.scale == pytest.approx(pull.gradient)


def test_parameters_get_the_gradient_of_the_raster() -> None:
    canvas = Canvas.square(SIZE)
    grammar = ArcLine(canvas.pixel)
    program = grammar.axiom(canvas)
    loss = drawn()
    band = grammar.rasterize(program, canvas)
    evaluation = loss.evaluate(band)
    assert evaluation.gradient == pytest.approx(band.pull_back(loss.pull(band.coverage).gradient))
    assert evaluation.value == loss.value(band)
    assert evaluation.curvature is not None


def test_programs_of_a_round_are_compared_on_the_same_draw() -> None:
    loss = drawn()
    coverage = np.random.default_rng(4).random((SIZE, SIZE))
    again = DistillationLoss(loss.denoiser, loss.wish, loss.time, loss.noise, loss.drawn, loss.views)
    assert loss.pull(coverage).value == again.pull(coverage).value
    assert loss.pull(coverage) is loss.pull(coverage.copy())


def test_times_fall_from_draw_to_draw() -> None:
    objective = Distillation(drawn().denoiser, Wish("it"), (0.9, 0.1), rounds=5)
    rng = np.random.default_rng(0)
    times = [objective.draw(rng).time for _ in range(7)]
    assert times == pytest.approx([0.9, 0.7, 0.5, 0.3, 0.1, 0.1, 0.1])


def test_random_times_stay_within_their_spread() -> None:
    objective = Distillation(drawn().denoiser, Wish("it"), (0.5, 0.5), rounds=5, spread=0.48)
    rng = np.random.default_rng(0)
    times = [objective.draw(rng).time for _ in range(200)]
    assert 0.02 <= min(times) < 0.1
    assert 0.9 < max(times) <= 0.98


@pytest.mark.parametrize("shape", [(12, 12), (20, 16), (7, 9)])
def test_back_is_the_transpose_of_show(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(5)
    for view in [*PAPER.draw(10, rng), *Views(count=6, chance=0.7, crop=0.7, shade=0.3).draw(10, rng), View(10)]:
        coverage, gradient = rng.random(shape), rng.random((10, 10))
        shown = view.show(coverage) - view.ground
        assert float(np.sum(shown * gradient)) == pytest.approx(float(np.sum(coverage * view.back(gradient, shape))))


def test_a_homography_takes_corners_to_corners() -> None:
    corners = np.array([(0.1, 0.05), (0.9, 0.2), (1.1, 0.8), (-0.1, 1.0)])
    x, y = projected(corners, SQUARE[:, 0], SQUARE[:, 1])
    assert np.column_stack([x, y]) == pytest.approx(corners)
    u = np.linspace(0, 1, 5)
    x, y = projected(corners, u, np.zeros(5))  # straight lines stay straight
    along = corners[1] - corners[0]
    assert along[0] * (y - corners[0, 1]) - along[1] * (x - corners[0, 0]) == pytest.approx(0, abs=1e-12)


def test_half_as_many_pixels_are_means_of_four() -> None:
    coverage = np.random.default_rng(6).random((16, 16))
    assert View(8).show(coverage) == pytest.approx(coverage.reshape(8, 2, 8, 2).mean(axis=(1, 3)))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Wish("  "), "the prompt is empty"),
        (lambda: Wish("a", weighting="no"), "there is no weighting 'no'"),
        (lambda: Wish("a", guidance=-1.0), "guidance must be 0 or more"),
        (lambda: Wish("a", guidance=float("nan")), "guidance must be 0 or more"),
        (lambda: Views(count=0), "a count of 1 or more"),
        (lambda: Views(crop=0.0), "a crop is a share"),
        (lambda: Distillation(drawn().denoiser, Wish("it"), (1.0, 0.1)), "times must be between 0 and 1"),
    ],
)
def test_settings_that_mean_nothing(make: object, said: str) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=said):
        make()
