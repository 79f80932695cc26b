"""The fewest lines and arcs: known answers, noise, and what holds for every curve."""

from __future__ import annotations

from math import pi, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.deviation import deviation, drawn_apart
from d4cad.edges import Edges, Floats, distances, lengths, points_along
from d4cad.errors import GeometryError
from d4cad.loop import Circle, Loop
from d4cad.runs import distance, farthest, fitted
from d4cad.segmentation import segment, segment_chain
from d4cad.shapes import generate
from d4cad.simplification import simplified, simplified_loop, simplified_loops
from d4cad.sketch import Sketch
from d4cad.skyline import step

QUARTER = tan(pi / 8)
ROUNDED = Loop(
    ((2, 0), (18, 0), (20, 2), (20, 8), (18, 10), (2, 10), (0, 8), (0, 2)),
    (0, QUARTER, 0, QUARTER, 0, QUARTER, 0, QUARTER),
)
"""A rectangle of 20 x 10 with corners of radius 2."""


def along(loop: Loop, n: int) -> Floats:
    """n points (n, 2) evenly along a loop; its vertices are not among them."""
    e = loop.edges
    ends = np.concatenate([[0.0], np.cumsum(lengths(e))])
    place = (np.arange(n) + 0.37) / n * ends[-1]
    edge = np.searchsorted(ends, place, side="right") - 1
    z = points_along(e.take(edge), (place - ends[edge]) / lengths(e)[edge])
    return np.stack([z.real, z.imag], axis=1)


def noisy(points: Floats, by: float, seed: int = 0) -> Floats:
    """Points moved at random by at most ``by``."""
    rng = np.random.default_rng(seed)
    angle, size = rng.uniform(0, 2 * pi, len(points)), by * rng.uniform(0, 1, len(points))
    return points + np.stack([size * np.cos(angle), size * np.sin(angle)], axis=1)


def kinds(loop: Loop) -> str:
    """L and A for the edges, from the rotation that comes first in the alphabet."""
    word = "".join("A" if b else "L" for b in loop.bulges)
    return min(word[k:] + word[:k] for k in range(len(word)))


def polygon(points: Floats) -> Loop:
    return Loop.from_arrays(points, np.zeros(len(points)))


def to_vertices(found: Loop, true: Loop) -> float:
    """Largest distance of a vertex from the nearest true one."""
    gaps = np.array(found.points)[:, None] - np.array(true.points)[None]
    return float(np.hypot(gaps[..., 0], gaps[..., 1]).min(axis=1).max())


def test_a_flattened_rounded_rectangle_is_four_lines_and_four_arcs() -> None:
    flat = ROUNDED.polygon(6e-5)
    assert len(flat) > 380
    found = segment(flat, 0.01)
    assert kinds(found) == "AL" * 4
    assert to_vertices(found, ROUNDED) < 1e-9
    assert found.area == pytest.approx(ROUNDED.area, rel=1e-12)


@pytest.mark.parametrize("n", [400, 2000])
@pytest.mark.parametrize("noise", [0.0, 0.3, 0.6])
def test_noise_adds_no_primitives(n: int, noise: float) -> None:
    given = noisy(along(ROUNDED, n), noise * 0.02)
    found = segment(given, 0.02)
    assert len(found.points) == 8
    assert deviation(found, polygon(given)) <= 0.02
    assert deviation(found, ROUNDED) < 0.01


def test_a_flattened_circle_is_two_semicircles() -> None:
    flat = Circle((3.0, -2.0), 5.0).loop(clockwise=True).polygon(0.001)
    found = segment(flat, 0.01)
    assert found.bulges == (-1.0, -1.0)
    assert found.circle is not None
    assert found.circle.radius == pytest.approx(5, abs=1e-9)
    assert found.circle.center == pytest.approx((3, -2), abs=1e-9)


def test_a_polygon_stays_one() -> None:
    """No arc may run through the corners of an octagon: its sides are further from it than the tolerance."""
    angle = np.arange(8) * pi / 4
    octagon = 10 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = segment(octagon, 0.05)
    assert kinds(found) == "L" * 8
    assert to_vertices(found, polygon(octagon)) < 1e-12


def test_corners_are_kept() -> None:
    points = np.array([[0.0, 0.0], [5.0, 0.004], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    assert len(segment(points, 0.01).points) == 4
    found = segment(points, 0.01, corners=[1])
    assert len(found.points) == 5
    assert (5.0, 0.004) in found.points


def test_an_open_chain_keeps_its_ends() -> None:
    t = np.linspace(0, pi / 2, 300)
    points = np.stack([10 * np.cos(t), 5 * np.sin(t)], axis=1)
    vertices, bulges = segment_chain(points, 0.01)
    assert np.array_equal(vertices[[0, -1]], points[[0, -1]])
    assert len(bulges) == 4
    assert len(vertices) == 5
    z = np.ascontiguousarray(vertices).view(np.complex128).ravel()
    e = Edges(z[:-1, None], z[1:, None], bulges[:, None])
    q = (points @ np.array([1, 1j]))[None, :]
    assert distances(e, q).min(axis=0).max() <= 0.01


def test_coarser_is_never_more() -> None:
    t = np.linspace(0, 2 * pi, 500, endpoint=False)
    points = np.stack([10 * np.cos(t), 6 * np.sin(t)], axis=1)
    counts = [len(segment(points, tolerance).points) for tolerance in (0.001, 0.01, 0.1, 1.0)]
    assert counts == sorted(counts, reverse=True)
    assert counts[1] <= 20


@pytest.mark.parametrize("primitives", [8, 40, 90])
def test_generated_shapes_come_back_from_polygons(primitives: int) -> None:
    true = generate(np.random.default_rng(primitives), primitives).scaled(30)
    flat = Sketch.from_loops([polygon(p) for p in true.polygon(0.002)], "mm")
    found = simplified(flat, 0.02)
    assert found.primitives == true.primitives
    assert drawn_apart(found.loops, true.loops) < 1e-6
    assert found.area == pytest.approx(true.area, rel=1e-7)
    assert [len(face.holes) for face in found.faces] == [len(face.holes) for face in true.faces]


def test_thin_walls_are_not_crossed() -> None:
    """Two outlines closer than the tolerance would touch when simplified: they keep what vertices they need."""
    t = np.linspace(0, 2 * pi, 240, endpoint=False)
    wave = 10 + 0.3 * np.cos(12 * t)
    inner = polygon(np.stack([wave * np.cos(t), wave * np.sin(t)], axis=1))
    outer = polygon(np.stack([(wave + 0.05) * np.cos(t), (wave + 0.05) * np.sin(t)], axis=1))
    ring = Sketch.from_loops([outer, inner], "mm")
    found = simplified(ring, 0.5)
    again = Sketch.from_loops(found.loops, "mm")
    assert len(again.faces) == 1
    assert len(again.faces[0].holes) == 1
    assert drawn_apart(found.loops, ring.loops) <= 0.5


def test_loops_keep_their_order_and_orientation() -> None:
    loops = [Circle((0.0, 0.0), 5.0).loop(), Circle((20.0, 0.0), 3.0).loop(clockwise=True)]
    flat = [polygon(loop.polygon(0.001)) for loop in loops]
    found = simplified_loops(flat, 0.01)
    assert [loop.circle for loop in found] == [
        Circle((pytest.approx(0, abs=1e-9), pytest.approx(0, abs=1e-9)), pytest.approx(5)),  # type: ignore[arg-type]
        Circle((pytest.approx(20), pytest.approx(0, abs=1e-9)), pytest.approx(3)),  # type: ignore[arg-type]
    ]
    assert [loop.area > 0 for loop in found] == [True, False]


@settings(max_examples=40, deadline=None)
@given(
    radii=st.lists(st.floats(3, 10), min_size=3, max_size=24),
    bulges=st.lists(st.floats(-0.15, 0.15), min_size=24, max_size=24),
    tolerance=st.sampled_from([0.003, 0.05, 0.4]),
    flat=st.booleans(),
)
def test_what_holds_for_every_loop(radii: list[float], bulges: list[float], tolerance: float, flat: bool) -> None:
    n = len(radii)
    angle = 2 * pi * np.arange(n) / n
    points = np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    loop = Loop.from_arrays(points, np.array(bulges[:n]))
    if flat:
        loop = polygon(loop.polygon(tolerance / 4))
    try:
        Sketch.from_loops([loop])
    except GeometryError:
        return  # bowed sides may cross at sharp corners
    found = simplified_loop(loop, tolerance)
    assert len(found.points) <= len(loop.points)
    assert deviation(found, loop) <= tolerance
    assert found.area > 0
    Sketch.from_loops([found])
    assert simplified_loop(loop, tolerance) == found


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(-1.2, 1.2), st.integers(2, 40))
def test_the_arc_of_a_run_is_within_the_tolerance(seed: int, half: float, n: int) -> None:
    """Points within half the tolerance of an arc have an arc within it, and every one it finds is."""
    tolerance, rng = 0.05, np.random.default_rng(seed)
    e = Edges(np.array([0j]), np.array([10 + 0j]), np.array([tan(half / 2)]))
    z = points_along(e, np.arange(n + 1) / n) + tolerance * rng.uniform(-0.3, 0.3, n + 1)
    z[0], z[-1] = 0, 10
    found, error = fitted(z.real.copy(), z.imag.copy(), np.ones(n + 1), 0, n, 1, tolerance)
    assert np.isfinite(error)
    assert distances(Edges(e.z0, e.z1, np.array([tan(found / 2)])), z).max() <= tolerance * (1 + 1e-9)


def test_no_arc_is_found_where_there_is_none() -> None:
    z = np.array([0, 2 + 1j, 5 - 1j, 8 + 1j, 10])
    _, error = fitted(z.real.copy(), z.imag.copy(), np.ones(5), 0, 4, 1, 0.5)
    assert error == np.inf


@settings(max_examples=60, deadline=None)
@given(st.floats(-3, 3), st.floats(-20, 20), st.floats(-20, 20))
def test_the_compiled_distance_is_that_of_edges(bulge: float, x: float, y: float) -> None:
    e = Edges(np.array([-1 + 2j]), np.array([4 - 1j]), np.array([bulge]))
    true = float(distances(e, np.array([x + 1j * y]))[0])
    assert distance(x, y, -1.0, 2.0, 4.0, -1.0, bulge) == pytest.approx(true, abs=1e-9)


def test_the_farthest_point() -> None:
    rng = np.random.default_rng(0)
    true = generate(rng, 30)
    e = Edges(*(np.concatenate([loop.edges[k] for loop in true.loops]) for k in range(3)))
    q = rng.uniform(-1.2, 1.2, 200) + 1j * rng.uniform(-1.2, 1.2, 200)
    parts = [np.ascontiguousarray(a) for a in (q.real, q.imag, e.z0.real, e.z0.imag, e.z1.real, e.z1.imag, e.b)]
    worst, where = farthest(*parts)
    each = distances(e.take((slice(None), None)), q[None, :]).min(axis=0)
    assert worst == pytest.approx(each.max(), abs=1e-12)
    assert where == each.argmax()


def test_the_step_solves_the_normal_equations() -> None:
    rng = np.random.default_rng(1)
    rows, size = 60, 17
    column = (np.arange(rows)[:, None] * size // rows + np.arange(5)) % size
    column[rng.random(column.shape) < 0.1] = -1
    value, d = rng.normal(size=column.shape), rng.normal(size=rows)
    dense = np.zeros((rows, size + 1))
    for k in range(5):
        dense[np.arange(rows), column[:, k]] += value[:, k]
    dense = dense[:, :size]
    true = np.linalg.solve(dense.T @ dense + 0.01 * np.eye(size), -dense.T @ d)
    assert step(column, value, d, size, 0.01) == pytest.approx(true, abs=1e-10)


@pytest.mark.parametrize(
    ("points", "tolerance", "message"),
    [
        ([[0, 0], [1, 0], [0, 1]], 0.0, "must be positive, got 0"),
        ([[0, 0], [1, 0], [0, 1]], float("nan"), "must be positive, got nan"),
        ([[0, 0], [1, float("inf")], [0, 1]], 0.1, "point 1 is not finite"),
        ([[0, 0], [1, 0], [1, 0]], 0.1, "at least 3 different points, got 2"),
        ([[0, 0, 0]], 0.1, r"shape \(n, 2\), got \(1, 3\)"),
        ([], 0.1, r"shape \(n, 2\), got \(0,\)"),
    ],
)
def test_points_that_cannot_be_used(points: list[list[float]], tolerance: float, message: str) -> None:
    with pytest.raises(GeometryError, match=message):
        segment(np.array(points, dtype=np.float64), tolerance)


def test_a_corner_must_be_one_of_the_points() -> None:
    with pytest.raises(GeometryError, match="corners from 0 to 2, got 3"):
        segment(np.array([[0.0, 0], [1, 0], [0, 1]]), 0.1, corners=[3])


def test_deviation_is_the_hausdorff_distance() -> None:
    square = Loop.polyline([(0, 0), (4, 0), (4, 4), (0, 4)])
    spiked = Loop.polyline([(0, 0), (4, 0), (4, 4), (2, 5), (0, 4)])
    assert deviation(square, spiked) == pytest.approx(1.0, abs=0.01)
    assert deviation(spiked, square) == deviation(square, spiked)
    circle = Circle((0.0, 0.0), 3.0).loop()
    turned = Loop(((0.0, 3.0), (0.0, -3.0)), (1.0, 1.0))
    assert deviation(circle, turned) < 1e-12
