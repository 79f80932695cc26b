"""Regularisation: known answers, derivatives, and what must hold for any sketch."""

from __future__ import annotations

from math import cos, pi, radians, sin, tan
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from d4cad.edges import Floats
from d4cad.errors import GeometryError, InputError
from d4cad.regularize import Evidence, Parameters, Regularized, Scale, regularized
from d4cad.regularize.equations import WRITERS, equations, gauge
from d4cad.regularize.measures import Measures
from d4cad.regularize.selection import Belief
from d4cad.regularize.solving import solved
from d4cad.relations import Dimension, Relation
from d4cad.sketch import Circle, Loop, Sketch

PIXEL = 0.1


def evidence(layout: Parameters, params: Floats, sigma: float, weights: Floats | None = None) -> Evidence:
    """What measurements of all parameters with the standard deviation ``sigma`` say; of a bulge, of its arc's apex."""
    length = np.ones(layout.size)
    count = layout.starts[-1]
    points = params[: 2 * count].reshape(-1, 2)
    chord = np.hypot(*(points[layout.following] - points).T)
    length[2 * count :] = 2 / chord[layout.arcs]
    weight = (1.0 if weights is None else weights) / length**2

    def loss(at: Floats) -> float:
        return float(((at - params) ** 2 * weight).sum())

    return Evidence(params, np.diag(weight), loss, sigma**2, PIXEL)


def perturbed(truth: Sketch, sigma: float, seed: int = 0) -> tuple[Sketch, Evidence]:
    """The sketch as measured with an error of ``sigma``, circles staying circles."""
    layout = Parameters(truth)
    noise = sigma * np.random.default_rng(seed).standard_normal(layout.size)
    count = layout.starts[-1]
    points = layout.values[: 2 * count].reshape(-1, 2)
    chord = np.hypot(*(points[layout.following] - points).T)
    noise[2 * count :] *= 2 / chord[layout.arcs]
    for loop in np.flatnonzero(layout.circles):
        k = layout.starts[loop]
        noise[2 * k + 3] = noise[2 * k + 1]
        noise[layout.columns[k : k + 2, 4]] = 0
    params = layout.values + noise
    return layout.sketched(params), evidence(layout, params, sigma)


def snap(truth: Sketch, sigma: float = 0.01, seed: int = 0, scale: Scale | None = None) -> Regularized:
    sketch, seen = perturbed(truth, sigma, seed)
    return regularized(sketch, seen, scale=scale)


def residual(sketch: Sketch, relation: Relation) -> float:
    layout = Parameters(sketch)
    found = equations(relation, layout, Measures.of(layout, layout.values)).residual
    return float(np.abs(found).max(initial=0.0))


def holds(sketch: Sketch, kind: str, *refs: tuple[int, int], value: float | None = None) -> bool:
    return residual(sketch, Relation(kind, refs, value)) < 1e-9


def count(found: Regularized, kind: str) -> int:
    return sum(relation.kind == kind for relation in found.sketch.relations)


def rectangle() -> Sketch:
    return Sketch.from_loops([Loop.polyline([(0, 0), (8, 0), (8, 5), (0, 5)])])


def slot() -> Sketch:
    z = [(-4, -1.5), (4, -1.5), (4, 1.5), (-4, 1.5)]
    c, s = cos(0.4), sin(0.4)
    points = tuple((c * x - s * y, s * x + c * y) for x, y in z)
    return Sketch.from_loops([Loop(points, (0.0, 1.0, 0.0, 1.0))])


def flange(holes: int = 5, radius: float = 0.7) -> Sketch:
    ring = [
        Circle((3 + 5 * cos(2 * pi * k / holes + 0.3), 1 + 5 * sin(2 * pi * k / holes + 0.3)), radius).loop()
        for k in range(holes)
    ]
    return Sketch.from_loops([Circle((3, 1), 7.5).loop(), *ring])


def bracket() -> Sketch:
    """Mirrored about x = 0: a sloping plate with a vee in its top and two holes."""
    outer = [(-6, 0), (6, 0), (4.5, 4.2), (1.3, 5.1), (0, 3.3), (-1.3, 5.1), (-4.5, 4.2)]
    holes = [Circle((x, 1.7), 0.8).loop() for x in (-3.2, 3.2)]
    return Sketch.from_loops([Loop.polyline(outer), *holes])


def test_a_rectangle_becomes_level() -> None:
    found = snap(rectangle())
    points = np.array(found.sketch.loops[0].points)
    assert points[0, 1] == points[1, 1]
    assert points[2, 1] == points[3, 1]
    assert points[0, 0] == points[3, 0]
    assert points[1, 0] == points[2, 0]
    assert (count(found, "horizontal"), count(found, "vertical")) == (2, 2)
    assert found.freed == 4
    assert 0 < found.moved < 0.05
    assert found.after > found.before == 0
    assert {d.name for d in found.sketch.dimensions} == {"width", "height"}


def test_a_turned_slot_becomes_tangent_parallel_and_equal() -> None:
    found = snap(slot())
    for i in range(4):
        assert holds(found.sketch, "tangent", (0, i), (0, (i + 1) % 4))
    assert holds(found.sketch, "parallel", (0, 0), (0, 2))
    assert holds(found.sketch, "equal_radius", (0, 1), (0, 3))
    assert holds(found.sketch, "equal_length", (0, 0), (0, 2))
    assert np.allclose(np.abs(found.sketch.loops[0].bulges), [0, 1, 0, 1], atol=1e-9)
    assert count(found, "horizontal") == count(found, "vertical") == 0
    (end,) = [d for d in found.sketch.dimensions if d.kind == "radius"]
    assert end.name == "end_radius"
    assert set(end.refs) == {(0, 1), (0, 3)}


def test_bolt_holes_become_equal_and_even() -> None:
    truth = flange()
    found = snap(truth)
    refs = [(k, 0) for k in range(1, 6)]
    assert count(found, "polar") == 1
    assert all(holds(found.sketch, "equal_radius", refs[0], ref) for ref in refs[1:])
    centers = np.array([loop.points[0] for loop in found.sketch.loops[1:]])
    radii = np.array([(loop.points[0][0] - loop.points[1][0]) / 2 for loop in found.sketch.loops[1:]])
    centers[:, 0] -= radii
    middle = centers.mean(axis=0)
    reach = np.hypot(*(centers - middle).T)
    assert np.ptp(reach) < 1e-9
    (hole,) = [d for d in found.sketch.dimensions if d.name == "hole_diameter"]
    assert hole.value == pytest.approx(1.4, abs=0.02)
    assert sorted(hole.refs) == refs


def test_a_mirrored_bracket_becomes_symmetric() -> None:
    found = snap(bracket())
    z = np.array(found.sketch.loops[0].points)
    axis = z[4, 0]
    for a, b in ((0, 1), (6, 2), (5, 3)):
        assert z[a, 0] + z[b, 0] == pytest.approx(2 * axis, abs=1e-9)
        assert z[a, 1] == pytest.approx(z[b, 1], abs=1e-9)
    first, second = (loop.circle for loop in found.sketch.loops[1:])
    assert first is not None
    assert second is not None
    assert first.center[0] + second.center[0] == pytest.approx(2 * axis, abs=1e-7)
    assert first.radius == pytest.approx(second.radius, abs=1e-7)
    assert count(found, "symmetric") >= 1


def test_a_row_of_holes_becomes_even() -> None:
    holes = [Circle((2 + 2.3 * k, 2 + 0.4 * k), 0.6).loop() for k in range(4)]
    found = snap(Sketch.from_loops([Loop.polyline([(0, 0), (12, 0.5), (11, 6), (0.7, 5)]), *holes]))
    assert count(found, "row") == 1
    assert holds(found.sketch, "row", *((k, 0) for k in range(1, 5)))


def test_repeated_loops_become_congruent() -> None:
    one = np.array([(0, 0), (1.9, 0.3), (1.1, 1.7), (0.2, 1.2)])
    c, s = cos(0.7), sin(0.7)
    other = one @ np.array([[c, s], [-s, c]]) + (5, 1)
    plate = Loop.polyline([(-2, -3), (9.3, -2.1), (8, 5), (-3, 6)])
    found = snap(Sketch.from_loops([plate, *(Loop.from_arrays(z, np.zeros(4)) for z in (one, other))]), 0.004)
    assert count(found, "congruent") == 1
    first, second = (np.sort(loop.lengths) for loop in found.sketch.loops[1:])
    assert np.allclose(first, second, atol=1e-9)


@pytest.mark.parametrize("off", [1.0, 2.0])
def test_what_is_clearly_off_is_left_alone(off: float) -> None:
    """A side one degree off level, and holes of which one is two per cent larger, both seen to a 200th of a unit."""
    lift = 8 * tan(radians(off))
    outer = Loop.polyline([(0, 0), (8, lift), (8.3, 6), (-0.4, 5.1)])
    holes = [Circle((2, 3), 1.0).loop(), Circle((5.1, 3.7), 1.0 + 0.02 * off).loop()]
    found = snap(Sketch.from_loops([outer, *holes]), 0.002)
    assert found.sketch.relations == ()
    assert found.freed == 0


def test_of_contradicting_relations_the_worse_is_dropped() -> None:
    """The top side is seen well to be a little off level, the bottom is level: both cannot be level and as seen."""
    layout = Parameters(rectangle())
    params = layout.values.copy()
    params[5] += 0.03
    weights = np.ones(8)
    weights[4:] = 400
    seen = evidence(layout, params, 0.01, weights)
    found = regularized(layout.sketched(params), seen)
    assert holds(found.sketch, "horizontal", (0, 0))
    assert not holds(found.sketch, "horizontal", (0, 2))
    assert not holds(found.sketch, "parallel", (0, 0), (0, 2))


def test_equations_that_contradict_have_no_solution() -> None:
    layout = Parameters(rectangle())
    spread = evidence(layout, layout.values, 0.01).spread(layout)
    both = [Relation("length", ((0, 0),), 8.0), Relation("length", ((0, 0),), 7.0)]
    assert solved(both, layout, layout.values, spread) is None
    assert solved(both[:1], layout, layout.values, spread) is not None


def test_an_edge_without_a_length_has_no_solution() -> None:
    layout = Parameters(rectangle())
    spread = evidence(layout, layout.values, 0.01).spread(layout)
    params = layout.values.copy()
    params[2:4] = params[:2]
    assert solved([Relation("length", ((0, 0),), 8.0)], layout, params, spread) is None
    assert solved([Relation("parallel", ((0, 0), (0, 2)))], layout, params, spread) is None


def test_a_relation_that_the_loss_forbids_is_dropped() -> None:
    """The matrix says that nothing is known, the loss that the top must stay."""
    layout = Parameters(rectangle())
    params = layout.values.copy()
    params[5] += 0.02
    seen = evidence(layout, params, 0.02)

    def loss(at: Floats) -> float:
        return 1e6 * float((at[5] - at[7] - 0.02) ** 2)

    found = regularized(layout.sketched(params), Evidence(params, seen.matrix, loss, seen.variance, PIXEL))
    assert not holds(found.sketch, "horizontal", (0, 2))
    assert holds(found.sketch, "horizontal", (0, 0))
    assert found.after - found.before < 10 * seen.variance


def test_sizes_become_round_only_with_a_scale() -> None:
    truth = Sketch.from_loops(
        [Loop.polyline([(0, 0), (8, 0), (8, 5.5), (0, 5.5)]), Circle((2.5, 2.75), 0.6).loop(clockwise=True)]
    )
    assert not any(r.value is not None for r in snap(truth).sketch.relations if r.kind != "symmetric")
    found = snap(truth, 0.005, scale=Scale(mm=10.0))
    sizes = {d.name: d for d in found.sketch.dimensions}
    assert sizes["width"].value == pytest.approx(8, abs=1e-12)
    assert sizes["height"].value == pytest.approx(5.5, abs=1e-12)
    assert sizes["hole_diameter"].value == pytest.approx(1.2, abs=1e-12)
    assert all(sizes[name].round for name in ("width", "height", "hole_diameter"))
    xmin, ymin, xmax, ymax = found.sketch.bounds
    assert xmax - xmin == pytest.approx(8, abs=1e-9)
    assert ymax - ymin == pytest.approx(5.5, abs=1e-9)


def test_a_given_width_stays() -> None:
    truth = Sketch.from_loops([Loop.polyline([(0, 0), (8, 0), (8, 6), (0, 6)])])
    found = snap(truth, 0.005, scale=Scale(width=40.0))
    xmin, ymin, xmax, ymax = found.sketch.bounds
    assert (ymax - ymin) * 40 / (xmax - xmin) == pytest.approx(30, abs=1e-9)


def test_sizes_between_the_steps_stay() -> None:
    truth = Sketch.from_loops([Loop.polyline([(0, 0), (8.0373, 0), (8.0373, 5.5219), (0, 5.5219)])])
    found = snap(truth, 0.001, scale=Scale(mm=10.0))
    assert not any(r.kind in ("width", "height", "length") for r in found.sketch.relations)


def test_a_scale_is_one_number() -> None:
    with pytest.raises(InputError, match="either"):
        Scale()
    with pytest.raises(InputError, match="either"):
        Scale(mm=1.0, width=2.0)


def test_nothing_comes_of_nothing() -> None:
    empty = Sketch(())
    found = regularized(empty, Evidence(np.zeros(0), np.zeros((0, 0)), lambda at: 0.0, 1.0, 1.0))
    assert found.sketch == empty


@pytest.mark.parametrize("matrix", [0.0, 1e-12, 1e12])
def test_a_matrix_without_information_or_with_much_is_no_error(matrix: float) -> None:
    sketch, seen = perturbed(flange(), 0.01)
    blind = Evidence(seen.params, seen.matrix * matrix, seen.loss, seen.variance, PIXEL)
    found = regularized(sketch, blind)
    assert np.isfinite(found.params).all()


def test_a_triangle_of_short_edges_is_no_error() -> None:
    found = snap(Sketch.from_loops([Loop.polyline([(0, 0), (0.3, 0), (0.1, 0.2)])]), 0.05)
    assert len(found.sketch.loops[0].points) == 3


def test_the_loops_stay_apart() -> None:
    """Two holes so near each other that nothing may bring them nearer."""
    layout = Parameters(rectangle())
    crossed = layout.values.copy()
    crossed[[0, 1, 4, 5]] = crossed[[4, 5, 0, 1]]
    with pytest.raises(GeometryError):
        layout.sketched(np.where(np.arange(8) == 0, 9.0, layout.values))
    with pytest.raises(GeometryError):
        layout.sketched(crossed[::-1].copy())


TRUTHS = {"rectangle": rectangle, "slot": slot, "flange": flange, "bracket": bracket}
RELAXED = settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])


@RELAXED
@given(st.sampled_from(sorted(TRUTHS)), st.integers(0, 10**6), st.sampled_from([1e-4, 1e-3, 0.01, 0.03]))
def test_what_is_told_holds_and_snapping_again_changes_nothing(name: str, seed: int, sigma: float) -> None:
    sketch, seen = perturbed(TRUTHS[name](), sigma, seed)
    found = regularized(sketch, seen)
    assert found.sketch.relations
    assert max(residual(found.sketch, relation) for relation in found.sketch.relations) < 1e-9
    layout = Parameters(found.sketch)
    again = regularized(found.sketch, evidence(layout, layout.values, sigma))
    assert again.sketch.loops == found.sketch.loops
    assert set(again.sketch.relations) == set(found.sketch.relations)


@RELAXED
@given(st.integers(0, 10**6), st.floats(0.05, 20), st.floats(-5, 5), st.floats(-5, 5))
def test_a_similar_sketch_snaps_likewise(seed: int, factor: float, dx: float, dy: float) -> None:
    sketch, seen = perturbed(bracket(), 0.01, seed)
    other = sketch.translated(dx, dy).scaled(factor, "world")
    layout = Parameters(other)
    there = evidence(layout, layout.values, 0.01 * factor)
    found = regularized(sketch, seen)
    alike = regularized(other, Evidence(there.params, there.matrix, there.loss, there.variance, PIXEL * factor))
    assert set(alike.sketch.relations) == set(found.sketch.relations)
    back = alike.sketch.scaled(1 / factor, "world").translated(-dx, -dy)
    for mine, theirs in zip(found.sketch.loops, back.loops, strict=True):
        assert np.allclose(mine.points, theirs.points, atol=1e-7)


@RELAXED
@given(st.sampled_from(sorted(TRUTHS)), st.integers(0, 10**6))
def test_snapping_brings_vertices_nearer_to_the_truth(name: str, seed: int) -> None:
    """Relations that hold in the truth can only take error away: a projection in the metric of the error."""
    truth = TRUTHS[name]()
    sketch, seen = perturbed(truth, 0.01, seed)
    found = regularized(sketch, seen)
    true = Parameters(truth).values
    before, after = ((at - true) @ seen.matrix @ (at - true) for at in (seen.params, found.params))
    assert after <= before * 1.01


MANY = Sketch.from_loops(
    [
        Loop(((0, 0), (4, 0.1), (4.2, 3), (2, 3.3), (0.1, 3)), (0.0, 0.3, 0.0, -0.2, 0.0)),
        Loop(((1, 1), (2, 1.05), (2, 2), (1, 2)), (0.0, 0.5, 0.0, 0.4)),
        *(Circle(center, radius).loop() for center, radius in (((3, 1), 0.3), ((3, 2), 0.4), ((3.1, 2.6), 0.15))),
    ]
)
MIRROR = ((0, 0), (0, 1), (0, 4), (0, 2), (0, 3), (0, 3), (2, 0), (3, 0))
EXAMPLES: list[tuple[str, Any, float | None]] = [
    ("horizontal", ((0, 0),), None),
    ("horizontal", ((2, 0), (3, 0)), None),
    ("vertical", ((0, 0),), None),
    ("vertical", ((2, 0), (3, 0)), None),
    ("parallel", ((0, 0), (0, 2)), None),
    ("perpendicular", ((0, 0), (0, 4)), None),
    ("angle", ((0, 0), (0, 2)), 0.3),
    ("tangent", ((0, 0), (0, 1)), None),
    ("tangent", ((0, 3), (0, 4)), None),
    ("equal_radius", ((0, 1), (2, 0)), None),
    ("concentric", ((0, 1), (2, 0)), None),
    ("equal_length", ((0, 0), (1, 0)), None),
    ("collinear", ((0, 0), (1, 0)), None),
    ("symmetric", MIRROR, None),
    ("symmetric", (*MIRROR, (4, 0), (4, 0)), pi / 2),
    ("symmetric", MIRROR, 0.3),
    ("congruent", ((1, 0), (1, 2), (1, 1), (1, 3), (1, 2), (1, 0), (1, 3), (1, 1)), None),
    ("polar", ((2, 0), (3, 0), (4, 0)), None),
    ("row", ((2, 0), (3, 0), (4, 0)), None),
    ("radius", ((0, 1),), 1.0),
    ("diameter", ((2, 0),), 1.0),
    ("length", ((0, 0),), 2.0),
    ("distance", ((0, 0), (1, 0)), 1.0),
    ("distance", ((2, 0), (3, 0)), 1.0),
    ("width", (), 1.0),
    ("height", (), 1.0),
]


@pytest.mark.parametrize(("kind", "refs", "value"), EXAMPLES)
def test_derivatives(kind: str, refs: Any, value: float | None) -> None:
    layout = Parameters(MANY)
    relation = Relation(kind, refs, value)
    at = layout.values

    def value_at(params: Floats) -> Floats:
        return equations(relation, layout, Measures.of(layout, params)).residual

    step = 1e-6
    numeric = np.stack(
        [(value_at(at + step * e) - value_at(at - step * e)) / (2 * step) for e in np.eye(layout.size)], axis=1
    )
    assert np.abs(numeric - equations(relation, layout, Measures.of(layout, at)).rows).max() < 1e-7


def test_derivatives_of_the_gauge() -> None:
    layout = Parameters(MANY)
    found = gauge(layout, Measures.of(layout, layout.values))
    assert found.residual.shape == (9,)
    assert np.abs(found.residual).max() == 0
    moved = layout.values + 1e-3 * np.random.default_rng(0).standard_normal(layout.size)
    expected = found.rows @ (moved - layout.values)
    assert np.allclose(gauge(layout, Measures.of(layout, moved)).residual, expected, atol=1e-12)


def test_every_kind_has_a_derivative_test() -> None:
    assert {kind for kind, _, _ in EXAMPLES} == set(WRITERS)


def test_implied_equations_take_no_parameter() -> None:
    """Once two sides are level, that they are parallel says nothing new; that they are upright contradicts."""
    layout = Parameters(rectangle())
    spread = Measures.of(layout, layout.values).taken_to(evidence(layout, layout.values, 0.01).spread(layout))
    belief = Belief.nothing(layout.size)
    for k in (0, 2):
        verdict = belief.verdict(equations(Relation("horizontal", ((0, k),)), layout, spread), 0.0)
        assert verdict is not None
        assert verdict.rank == 1
        belief.believe(verdict)
    implied = belief.verdict(equations(Relation("parallel", ((0, 0), (0, 2))), layout, spread), 0.0)
    assert implied is not None
    assert implied.rank == 0
    assert belief.verdict(equations(Relation("perpendicular", ((0, 0), (0, 2))), layout, spread), 0.0) is None


def test_names_of_sizes() -> None:
    sketch = Sketch.from_loops(
        [
            Loop(
                ((1, 0), (9, 0), (10, 1), (10, 6), (0, 6), (0, 1)),
                (0.0, tan(pi / 8), 0.0, 0.0, 0.0, tan(pi / 8)),
            ),
            Circle((3, 3), 1.0).loop(),
            Circle((7, 3), 0.5).loop(),
        ]
    )
    found = snap(sketch, 0.001)
    names = {d.name: d for d in found.sketch.dimensions}
    assert names["corner_radius"].refs == ((0, 1), (0, 5))
    assert names["hole_diameter_1"].value == pytest.approx(2, abs=0.01)
    assert names["hole_diameter_2"].value == pytest.approx(1, abs=0.01)
    assert all(isinstance(d, Dimension) for d in names.values())
