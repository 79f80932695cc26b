"""Exact geometry: conventions, areas, nesting, joining, and every way in which loops can be bad."""

from __future__ import annotations

from math import atan, cos, hypot, inf, isclose, nan, pi, sin, sqrt, tan
from random import Random
from time import process_time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.edges import Bools, Edges, Floats, distances, meetings
from d4cad.errors import GeometryError
from d4cad.sketch import Circle, Face, Loop, Sketch

SQUARE = Loop.polyline([(0, 0), (4, 0), (4, 4), (0, 4)])
SLOT = Loop(((0, 0), (3, 0), (3, 2), (0, 2)), (0.0, 1.0, 0.0, 1.0))


calm = settings(max_examples=60, deadline=None)  # a loaded machine is no failure


def dense(loop: Loop, per_edge: int = 400) -> Floats:
    """Points (m, 2) on the loop from centre, radius and angle: another formula than the code's."""
    out = []
    ends = (*loop.points[1:], loop.points[0])
    for (x0, y0), (x1, y1), b in zip(loop.points, ends, loop.bulges, strict=True):
        t = np.arange(per_edge) / per_edge
        if b == 0:
            out.append(np.stack([x0 + (x1 - x0) * t, y0 + (y1 - y0) * t], axis=1))
            continue
        sweep = 4 * atan(b)
        chord = complex(x1 - x0, y1 - y0)
        center = complex(x0, y0) + chord / 2 + 1j * chord / (2 * tan(sweep / 2))
        z = center + (complex(x0, y0) - center) * np.exp(1j * sweep * t)
        out.append(np.stack([z.real, z.imag], axis=1))
    return np.concatenate(out)


def polygon_area(p: Floats) -> float:
    q = np.roll(p, -1, axis=0)
    return float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]) / 2)


def gap(points: Floats, loop: Loop) -> float:
    """Largest distance of points (k, 2) from the loop."""
    e = loop.edges
    z = points[:, 0] + 1j * points[:, 1]
    return float(distances(Edges(e.z0[None], e.z1[None], e.b[None]), z[:, None]).min(axis=1).max())


def rotated(loop: Loop, k: int) -> Loop:
    """The same loop from its k-th vertex on."""
    k %= len(loop.points)
    return Loop(loop.points[k:] + loop.points[:k], loop.bulges[k:] + loop.bulges[:k])


def split(loop: Loop, i: int, fraction: float) -> Loop:
    """The same curve with edge i cut at a fraction of its sweep."""
    (x0, y0), (x1, y1), b = loop.points[i], loop.points[(i + 1) % len(loop.points)], loop.bulges[i]
    chord, half = complex(x1 - x0, y1 - y0), 2 * atan(b)
    # inscribed angle: the cut is seen from the start under (1 - fraction) x sweep / 2 off the chord
    z = chord * fraction if b == 0 else chord * sin(half * fraction) / sin(half) * np.exp(-1j * half * (1 - fraction))
    points = (*loop.points[: i + 1], (x0 + float(z.real), y0 + float(z.imag)), *loop.points[i + 1 :])
    parts = (tan(half * fraction / 2), tan(half * (1 - fraction) / 2))
    return Loop(points, loop.bulges[:i] + parts + loop.bulges[i + 1 :])


@st.composite
def stars(draw: st.DrawFn) -> Loop:
    """Simple loops of lines and arcs around the origin."""
    n = draw(st.integers(3, 9))
    radii = draw(st.lists(st.floats(0.8, 1.3), min_size=n, max_size=n))
    bulge = st.one_of(st.just(0.0), st.floats(0.001, 0.12), st.floats(-0.12, -0.001))
    bulges = draw(st.lists(bulge, min_size=n, max_size=n))
    turn = draw(st.floats(0, 6))
    points = [(r * cos(turn + 2 * pi * i / n), r * sin(turn + 2 * pi * i / n)) for i, r in enumerate(radii)]
    return Loop(tuple(points), tuple(bulges))


def test_convention_positive_bulge_is_counter_clockwise_and_bulges_right_of_travel() -> None:
    half_disc = Loop(((0, 0), (2, 0)), (1.0, 0.0))  # travelling +x: the arc passes below
    assert half_disc.bounds == pytest.approx((0, -1, 2, 0))
    assert half_disc.area == pytest.approx(pi / 2)
    assert Loop.polyline([(0, 0), (1, 0), (0, 1)]).area == 0.5


def test_convention_faces_have_counter_clockwise_outer_and_clockwise_holes() -> None:
    hole = Circle((2, 2), 1).loop()
    for outer in (SQUARE, SQUARE.reversed()):
        for inner in (hole, hole.reversed()):
            (face,) = Sketch.from_loops([inner, outer]).faces
            assert face.outer.area == 16
            assert [loop.area for loop in face.holes] == pytest.approx([-pi])


@pytest.mark.parametrize("bulge", [1e-9, 1e-4, 0.02, 0.049, 0.051, 0.4, 1.0, 3.0, 40.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_area_length_and_bounds_of_one_arc_against_closed_forms(bulge: float, sign: int) -> None:
    sweep = 4 * atan(bulge)
    radius = 2 / (2 * sin(sweep / 2))
    loop = Loop(((1, 1), (3, 1), (2, 9)), (sign * bulge, 0.0, 0.0))
    segment = radius**2 * (sweep - sin(sweep)) / 2 if bulge > 1e-3 else 2 * 2 * bulge / 3 * (1 + bulge**2 / 5)
    assert loop.area == pytest.approx(8 + sign * segment, rel=1e-12)
    assert loop.lengths[0] == pytest.approx(radius * sweep, rel=1e-12)
    sagitta = bulge  # chord / 2 = 1
    if sign > 0:
        wide = radius if bulge > 1 else 1.0
        assert loop.bounds == pytest.approx((2 - wide, 1 - sagitta, 2 + wide, 9), rel=1e-12)


def test_area_keeps_its_digits_far_from_the_origin() -> None:
    assert Circle((1e6, -1e6), 1).loop().area == pytest.approx(pi, rel=1e-9)


@calm
@given(stars(), st.integers(0, 8))
def test_measures_agree_with_sampling_and_do_not_depend_on_the_first_vertex(loop: Loop, k: int) -> None:
    points = dense(loop)
    assert loop.area == pytest.approx(polygon_area(points), rel=1e-4)
    xmin, ymin, xmax, ymax = loop.bounds
    assert (xmin, ymin) == pytest.approx(points.min(axis=0), abs=1e-4)
    assert (xmax, ymax) == pytest.approx(points.max(axis=0), abs=1e-4)
    assert np.all(points >= np.array([xmin, ymin]) - 1e-12)
    assert np.all(points <= np.array([xmax, ymax]) + 1e-12)
    assert gap(points, loop) < 1e-12
    other = rotated(loop, k)
    assert other.area == pytest.approx(loop.area, rel=1e-12)
    assert other.bounds == pytest.approx(loop.bounds, abs=1e-14)
    assert loop.reversed().area == pytest.approx(-loop.area, rel=1e-12)
    assert loop.reversed().reversed() == loop
    assert sum(loop.lengths) == pytest.approx(loop.length)


@calm
@given(stars(), st.integers(0, 2**32 - 1))
def test_contains_agrees_with_the_winding_of_a_fine_polygon(loop: Loop, seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-1.6, 1.6, (60, 2))
    fine = dense(loop, 100)
    z = (fine[:, 0] + 1j * fine[:, 1])[None, :] - (points[:, 0] + 1j * points[:, 1])[:, None]
    winding = np.angle(np.roll(z, -1, axis=1) / z).sum(axis=1)
    clear = np.array([gap(p[None], loop) > 1e-3 for p in points])
    assert np.array_equal(loop.contains(points)[clear], (np.abs(winding) > 3)[clear])


@pytest.mark.parametrize("loop", [SLOT, Loop(((0, 0), (1, 0)), (4.0, 0.0)), Circle((1, 1), 1).loop(), SQUARE])
def test_contains_at_the_heights_of_vertices_and_on_chords(loop: Loop) -> None:
    """Points level with vertices, and on the chord of an arc, where a ray test meets its ties."""
    xs = np.linspace(-1.93, 5.01, 70)
    ys = sorted({y for _, y in loop.points})
    points = np.array([(x, y) for x in xs for y in ys])
    fine = dense(loop)
    z = (fine[:, 0] + 1j * fine[:, 1])[None, :] - (points[:, 0] + 1j * points[:, 1])[:, None]
    winding = np.angle(np.roll(z, -1, axis=1) / z).sum(axis=1)
    clear = np.array([gap(p[None], loop) > 1e-2 for p in points])
    assert np.array_equal(loop.contains(points)[clear], (np.abs(winding) > 3)[clear])
    assert np.array_equal(loop.reversed().contains(points)[clear], (np.abs(winding) > 3)[clear])


@calm
@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=7), st.randoms(use_true_random=False))
def test_nested_circles_and_rectangles_alternate_between_faces_and_holes(
    kinds: list[tuple[bool, bool]], random: Random
) -> None:
    loops = []
    for k, (round_, backwards) in enumerate(kinds):
        size = 2.0**-k  # a square of half-side 0.65 fits the disc of radius 1 and holds the disc of radius 0.5
        r = 0.65 * size
        loop = Circle((0, 0), size).loop() if round_ else Loop.polyline([(-r, -r), (r, -r), (r, r), (-r, r)])
        loops.append(loop.reversed() if backwards else loop)
    areas = [abs(loop.area) for loop in loops]
    shuffled = list(loops)
    random.shuffle(shuffled)
    sketch = Sketch.from_loops(shuffled)
    assert len(sketch.faces) == (len(loops) + 1) // 2
    assert sum(len(face.holes) for face in sketch.faces) == len(loops) // 2
    assert sketch.area == pytest.approx(sum(a * (-1) ** k for k, a in enumerate(areas)))
    assert all(face.outer.area > 0 and all(h.area < 0 for h in face.holes) for face in sketch.faces)


def test_islands_lie_in_their_own_holes() -> None:
    left, right = Circle((2, 5), 1.5).loop(), Circle((7, 5), 1.5).loop()
    islands = [Circle((2, 5), 1).loop(), Circle((7, 5), 1).loop()]
    plate = Loop.polyline([(0, 0), (10, 0), (10, 10), (0, 10)])
    sketch = Sketch.from_loops([islands[0], left, plate, right, islands[1], Circle((20, 20), 1).loop()])
    assert sorted(len(face.holes) for face in sketch.faces) == [0, 0, 0, 2]
    assert sketch.area == pytest.approx(100 - 2 * 2.25 * pi + 3 * pi)


def test_a_hole_between_an_arc_and_its_chord_is_found() -> None:
    """The hole lies outside the polygon of the chords: only an arc-aware test sees that it is inside."""
    lens = Loop(((-1, 0), (1, 0)), (0.9, 0.9))
    (face,) = Sketch.from_loops([Circle((0, 0.7), 0.1).loop(), lens]).faces
    assert len(face.holes) == 1
    bite = Loop(((-2, 2), (-2, -2), (2, -2), (2, 2)), (0.0, 0.0, 0.0, -0.9))  # an island in the bite is no hole
    assert len(Sketch.from_loops([bite, Circle((0, 1.5), 0.2).loop()]).faces) == 2


@calm
@given(stars(), st.lists(st.tuples(st.integers(0, 50), st.floats(0.15, 0.85)), max_size=8), st.integers(0, 20))
def test_joining_after_random_splitting_gives_the_original(
    loop: Loop, cuts: list[tuple[int, float]], first: int
) -> None:
    whole = Sketch.from_loops([loop]).simplified(1e-7)
    pieces = loop
    for i, fraction in cuts:
        pieces = split(pieces, i % len(pieces.points), fraction)
    again = Sketch.from_loops([rotated(pieces, first)]).simplified(1e-7)
    assert again.primitives == whole.primitives
    assert again.area == pytest.approx(whole.area, rel=1e-6)
    assert gap(dense(again.loops[0], 30), loop) < 1e-7


@calm
@given(stars(), st.integers(0, 2**32 - 1), st.floats(1e-3, 0.05))
def test_simplified_stays_within_its_tolerance_both_ways(loop: Loop, seed: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    pieces = loop
    for _ in range(6):
        pieces = split(pieces, int(rng.integers(len(pieces.points))), float(rng.uniform(0.2, 0.8)))
    noisy = Loop.from_arrays(np.array(pieces.points) + rng.normal(0, tolerance / 4, (len(pieces.points), 2)),
                             np.array(pieces.bulges))  # fmt: skip
    simple = Sketch((Face(noisy),)).simplified(tolerance).loops[0]
    assert len(simple.points) <= len(noisy.points)
    assert gap(dense(noisy, 60), simple) <= tolerance
    assert gap(dense(simple, 60), noisy) <= 1.01 * tolerance


@pytest.mark.parametrize("pieces", [2, 3, 4, 7, 1000])
def test_a_circle_in_pieces_becomes_two_equal_semicircles(pieces: int) -> None:
    rng = np.random.default_rng(pieces)
    cut = np.arange(pieces) / pieces + rng.uniform(0, 0.5 / pieces, pieces)
    bulges = np.tan(np.diff(np.append(cut, cut[0] + 1)) * pi / 2)
    points = np.stack([3 + 2 * np.cos(2 * pi * cut), -1 + 2 * np.sin(2 * pi * cut)], axis=1)
    for loop in (Loop.from_arrays(points, bulges), Loop.from_arrays(points, bulges).reversed()):
        assert loop.circle is not None
        simple = Sketch((Face(loop),)).simplified(1e-3).loops[0]
        assert np.abs(simple.bulges).tolist() == [1.0, 1.0]
        assert np.sign(simple.bulges[0]) == np.sign(loop.bulges[0])
        assert simple.circle is not None
        assert simple.circle.center == pytest.approx((3, -1))
        assert simple.circle.radius == pytest.approx(2)


@pytest.mark.parametrize(
    ("name", "start", "edges", "arcs"),
    [
        ("collinear across the first vertex", Loop.polyline([(2, 0), (4, 0), (4, 4), (0, 4), (0, 0)]), 4, 0),
        ("a fold back is not joined", Loop.polyline([(0, 0), (2, 0), (1, 0), (1, 3)]), 4, 0),
        ("sagitta below the tolerance", Loop(SQUARE.points, (1e-5, -1e-5, 0.0, 1e-5)), 4, 0),
        ("zero-length edges", Loop.polyline([(0, 0), (0, 0), (4, 0), (4, 4), (4, 4), (0, 4)]), 4, 0),
        ("a major arc in three", Loop(((1, 0), (0, 1), (-1, 0), (0, -1)), (tan(pi / 8),) * 3 + (0.0,)), 2, 1),
        ("arc and tangent line stay two", Loop(((0, 0), (3, 0), (3, 2), (0, 2)), (0.0, 1.0, 0.0, 1.0)), 4, 2),
        ("arcs that turn in other directions", Loop(((0, 0), (1, 0), (2, 0), (1, 5)), (0.3, -0.3, 0.0, 0.0)), 4, 2),
        ("two arcs of other radii", Loop(((0, 0), (2, 0), (3, 0), (2, 5)), (0.4, 0.4, 0.0, 0.0)), 4, 2),
    ],
)  # fmt: skip
def test_joining(name: str, start: Loop, edges: int, arcs: int) -> None:
    simple = Sketch((Face(start),)).simplified(1e-4)
    assert (simple.primitives, sum(b != 0 for b in simple.loops[0].bulges)) == (edges, arcs), name


def test_joined_arc_keeps_its_ends_and_bulge() -> None:
    loop = (
        Sketch((Face(Loop(((1, 0), (0, 1), (-1, 0), (0, -1)), (tan(pi / 8),) * 3 + (0.0,))),)).simplified(1e-6).loops[0]
    )
    arc = loop.bulges.index(max(loop.bulges))
    assert loop.points[arc] == (1, 0)
    assert loop.bulges[arc] == pytest.approx(tan(3 * pi / 8))


@calm
@given(stars(), st.floats(1e-4, 0.3))
def test_polygon_has_its_corners_on_the_loop_and_its_sides_near(loop: Loop, tolerance: float) -> None:
    (polygon,) = Sketch.from_loops([loop]).polygon(tolerance)
    assert gap(polygon, loop) < 1e-12
    assert gap(dense(Loop.polyline([(x, y) for x, y in polygon]), 20), loop) <= 1.0001 * tolerance
    assert gap(dense(loop, 50), Loop.polyline([(x, y) for x, y in polygon])) <= 1.0001 * tolerance


@pytest.mark.parametrize("bulge", [0.0, 1e-3, -1e-3])
@pytest.mark.parametrize("clockwise", [False, True])
def test_a_circle_with_a_short_flat_is_a_circle(bulge: float, clockwise: bool) -> None:
    half = 0.05  # radians: the flat is 0.00125 from the circle
    ends = tuple((np.cos(a), np.sin(a)) for a in (-half, half))
    loop = Loop(ends, (bulge, np.tan((2 * np.pi - 2 * half) / 4)))
    for part in (loop, Loop(ends[::-1], loop.bulges[::-1])):
        turned = part.reversed() if clockwise else part
        simple = Sketch((Face(turned),)).simplified(0.002).loops[0]
        assert simple.circle is not None
        assert simple.circle.radius == pytest.approx(1, abs=1e-3)
        assert (simple.area < 0) == clockwise
        assert Sketch((Face(turned),)).simplified(0.0005).loops[0].circle is None


def test_polygon_of_a_major_arc_and_of_a_circle_coarser_than_itself() -> None:
    drop = Loop(((0, 0), (1, 0)), (10.0, 0.0))
    assert abs(polygon_area(drop.polygon(1e-5)) - drop.area) < 1e-3 * drop.area
    assert len(Circle((0, 0), 1).loop().polygon(100)) == 6
    with pytest.raises(GeometryError, match="tolerance"):
        drop.polygon(0)


@calm
@given(stars())
def test_neutral_round_trip_is_exact(loop: Loop) -> None:
    sketch = Sketch.from_loops([loop, Circle((0, 0), 0.3).loop()], "mm")
    neutral = sketch.to_neutral()
    assert Sketch.from_neutral(neutral, "mm") == sketch
    for edge in (edge for part in neutral for edge in part if edge["type"] == "arc"):
        (x0, y0), (x1, y1) = edge["start"], edge["end"]
        edge["bulge_height"] = edge.pop("bulge") * hypot(x1 - x0, y1 - y0) / 2
    assert Sketch.from_neutral(neutral).area == pytest.approx(sketch.area, rel=1e-12)


def test_scaling_and_moving() -> None:
    sketch = Sketch.from_loops([SLOT, Circle((1, 1), 0.5).loop()])
    moved = sketch.scaled(10).translated(1, -2)
    assert (sketch.unit, moved.unit) == ("world", "mm")
    assert moved.area == pytest.approx(100 * sketch.area)
    assert moved.length == pytest.approx(10 * sketch.length)
    assert moved.bounds == pytest.approx((-9, -2, 41, 18))
    assert moved.primitives == 6
    for factor in (0, -1, nan, inf):
        with pytest.raises(GeometryError, match="scale"):
            sketch.scaled(factor)


def test_circle_is_told_from_what_is_not_one() -> None:
    assert Circle((1, 2), 3).loop(clockwise=True).circle == Circle((1, 2), 3)
    assert SQUARE.circle is None
    assert SLOT.circle is None
    assert Loop(((0, 0), (2, 0)), (1.0, 0.9)).circle is None
    assert Loop(((0, 0), (1, 0), (2, 0), (3, 0)), (0.5, -0.5, 1.0, 1.0)).circle is None
    whole = Loop(((1, 0), (cos(1), sin(1))), (tan(0.25), tan((2 * pi - 1) / 4)))  # one minor, one major arc
    assert whole.circle is not None
    assert isclose(whole.circle.radius, 1)


BOW = Loop.polyline([(0, 0), (4, 4), (4, 0), (0, 2)])
BAD: list[tuple[str, list[Loop], str]] = [
    ("crossing itself", [BOW], r"loop 0 crosses or touches itself at \(1\.33333, 1\.33333\)"),
    ("crossing another", [Circle((0, 0), 1).loop(), Circle((1, 0), 1).loop()], r"loop 0 .* loop 1 at \(0\.5, "),
    ("tangent circles", [Circle((0, 0), 1).loop(), Circle((2, 0), 1).loop()], r"loop 1 at \(1, 0\)"),
    ("tangent from inside", [Circle((0, 0), 1).loop(), Circle((0, 0.5), 0.5).loop()], "touches loop 1"),
    ("arc tangent to a line", [SQUARE, Circle((2, 5), 1).loop()], r"loop 1 at \(2, 4\)"),
    ("vertex on an edge", [SQUARE, Loop.polyline([(4, 2), (5, 1), (5, 3)])], r"\(4, 2\)"),
    ("shared vertex", [SQUARE, SQUARE.translated(4, 4)], r"\(4, 4\)"),
    ("the same loop twice", [SLOT, SLOT], "loop 0 crosses or touches loop 1"),
    ("overlapping walls", [SQUARE, SQUARE.translated(4, 1)], "touches loop 1"),
    ("folded back on itself", [Loop.polyline([(0, 0), (2, 0), (1, 0), (1, 3)])], r"itself at \(1, 0\)"),
    ("pinched at a vertex", [Loop.polyline([(0, 0), (1, 1), (2, 0), (2, 2), (1, 1), (0, 2)])], r"\(1, 1\)"),
    ("neighbours that cross", [Loop(((0, 0), (4, 0), (0, 0.5), (-1, 5)), (-0.5, 0.0, 0.0, 0.0))], "itself"),
    ("no area", [Loop.polyline([(0, 0), (1, 1), (2, 2)])], r"loop 0 encloses no area at \(0, 0\)"),
    ("an arc there and back", [Loop(((0, 0), (1, 0)), (0.7, -0.7))], "no area"),
    ("one point", [Loop.polyline([(1, 2), (1, 2), (1, 2)])], r"loop 0 has 0 edges of any length at \(1, 2\)"),
    ("not a number", [SQUARE, Loop.polyline([(0, 0), (nan, 1), (1, 0)])], r"loop 1 is not finite at vertex 1"),
    ("infinite bulge", [Loop(((0, 0), (1, 0)), (inf, 0.0))], "not finite at vertex 0"),
    ("a full turn in one edge", [Loop(((0, 0), (1e-12, 0), (5, 5), (3, -3)), (1e12, 0.0, 0.0, 0.0))], "full turn"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "loops", "message"), BAD, ids=[name for name, _, _ in BAD])
def test_bad_loops_are_refused_in_one_sentence(name: str, loops: list[Loop], message: str) -> None:
    with pytest.raises(GeometryError, match=message) as caught:
        Sketch.from_loops(loops)
    assert "\n" not in str(caught.value)


def test_nearly_touching_loops_are_accepted() -> None:
    assert len(Sketch.from_loops([Circle((0, 0), 1).loop(), Circle((2 + 1e-6, 0), 1).loop()]).faces) == 2
    assert len(Sketch.from_loops([SQUARE, SQUARE.translated(4 + 1e-6, 0)]).faces) == 2
    assert len(Sketch.from_loops([SQUARE, Circle((2, 2), 2 - 1e-6).loop()]).faces[0].holes) == 1


def test_short_loops_and_bad_neutral_edges_are_refused() -> None:
    line = {"type": "line", "start": [0, 0], "end": [1, 0]}
    back = {"type": "line", "start": [1, 0], "end": [0, 0]}
    with pytest.raises(GeometryError, match="at least 2 edges"):
        Loop(((0, 0),), (0.0,))
    with pytest.raises(GeometryError, match="one bulge per vertex"):
        Loop(((0, 0), (1, 0)), (0.0,))
    for edges, message in (
        ([line], "loop 0 needs at least 2 edges, got 1"),
        ([line, {**back, "start": [1, 1]}], r"loop 0 is open at \(1, 0\): edge 0 ends 1 from"),
        ([line, {**back, "end": [0, 0.5]}], r"open at \(0, 0.5\): edge 1"),
        ([line, {**back, "type": "bezier"}], "bezier"),
        ([line, {"type": "line", "start": [1, 0]}], "end"),
        ([line, {**back, "type": "arc"}], "bulge_height"),
        ([line, {**back, "end": [0, "x"]}], "not a line or arc"),
        ([line, 3], "not a line or arc"),
    ):
        with pytest.raises(GeometryError, match=message):
            Sketch.from_neutral([edges])  # type: ignore[list-item]


def test_an_empty_sketch_is_a_sketch() -> None:
    empty = Sketch.from_loops([])
    assert (empty.faces, empty.area, empty.primitives, empty.to_neutral()) == ((), 0, 0, [])
    with pytest.raises(GeometryError, match="empty"):
        _ = empty.bounds


def test_meetings_agree_with_fine_polylines() -> None:
    """Random pairs of lines and arcs, major ones too, against the crossing of chains of short chords."""
    rng = np.random.default_rng(1)
    pairs, n = 500, 200
    z = rng.normal(size=(4, pairs)) + 1j * rng.normal(size=(4, pairs))
    b = np.where(rng.random((2, pairs)) < 0.3, 0, rng.normal(size=(2, pairs)) * 10.0 ** rng.integers(-6, 1, (2, pairs)))
    met, where = meetings(Edges(z[0], z[1], b[0]), Edges(z[2], z[3], b[1]), 1e-9)
    first, second = Edges(z[0], z[1], b[0]), Edges(z[2], z[3], b[1])
    wrong = 0
    for k in range(pairs):
        p = dense(Loop(((z[0, k].real, z[0, k].imag), (z[1, k].real, z[1, k].imag)), (b[0, k], 0.0)), n)[: n + 1]
        q = dense(Loop(((z[2, k].real, z[2, k].imag), (z[3, k].real, z[3, k].imag)), (b[1, k], 0.0)), n)[: n + 1]
        near = distances(second.take(slice(k, k + 1)), p[:, 0] + 1j * p[:, 1])
        crossing = bool(np.any(_segments_cross(p, q)))
        margin = 3e-3 * (1 + np.abs(p).max() + np.abs(q).max())
        wrong += (crossing and not met[k] and _clear(p, q, margin)) or (met[k] and near.min() > margin)
    assert wrong == 0
    assert 0.2 < met.mean() < 0.8
    assert np.all(distances(first, where)[met] < 2e-9)
    assert np.all(distances(second, where)[met] < 2e-9)


def _segments_cross(p: Floats, q: Floats) -> Bools:
    def side(a: Floats, b: Floats, c: Floats) -> Floats:
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])

    p0, p1, q0, q1 = p[:-1, None], p[1:, None], q[None, :-1], q[None, 1:]
    return (side(p0, p1, q0) * side(p0, p1, q1) < 0) & (side(q0, q1, p0) * side(q0, q1, p1) < 0)


def _clear(p: Floats, q: Floats, margin: float) -> bool:
    """Whether the ends of both chains are far from the other chain, so that a crossing is not a matter of chords."""
    ends = [(p[[0, -1]], q), (q[[0, -1]], p)]
    return all(np.abs(a[:, None] - b[None]).max(axis=2).min() > margin for a, b in ends)


def test_four_hundred_edges_are_checked_fast() -> None:
    n = 400
    a = np.arange(n) * 2 * pi / n
    r = np.where(np.arange(n) % 2, 1, 1.2)
    gear = Loop.from_arrays(np.stack([r * np.cos(a), r * np.sin(a)], axis=1), np.full(n, 0.02))
    Sketch.from_loops([gear])
    best = inf
    for _ in range(5):
        start = process_time()
        Sketch.from_loops([gear])
        best = min(best, process_time() - start)
    assert best < 0.05


def test_wart_a_flat_arc_is_as_exact_as_a_line() -> None:
    """Centres and radii would lose the sagitta of such arcs to rounding; nothing here forms them."""
    loop = Loop(((0, 0), (100, 0), (100, 50), (0, 50)), (1e-9, 0.0, 0.0, 0.0))
    assert loop.bounds[1] == pytest.approx(-5e-8, rel=1e-6)
    assert loop.area - 5000 == pytest.approx(2 / 3 * 100 * 5e-8, rel=1e-3)
    assert sqrt(2) * 50 < Sketch.from_loops([loop]).length
