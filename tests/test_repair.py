"""Repair: the region stays, the loops become well-formed, and no defect of the published repair (SPEC 3.6) is ours."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import atan, cos, inf, nan, pi, sin, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.ndimage import sum as sum_of

from d4cad.canvas import Canvas
from d4cad.edges import windings
from d4cad.errors import GrammarError
from d4cad.grammars.arc_line import ArcLine, Structure
from d4cad.program import Program
from d4cad.shapes import generate
from d4cad.sketch import Loop

CANVAS = Canvas(320, 320, 1.0)
GRAMMAR = ArcLine(pixel=1.0)  # world units are pixels here
Vertex = tuple[float, float, float | None]
Shape = list[list[Vertex]]
calm = settings(max_examples=60, deadline=None)  # a loaded machine is no failure


def program(loops: Sequence[Sequence[Vertex]]) -> Program[Structure]:
    """Loops of vertices (x, y, bulge of the edge from there, None for a line)."""
    flat = [vertex for loop in loops for vertex in loop]
    arcs = tuple(b is not None for _, _, b in flat)
    numbers = [value for x, y, _ in flat for value in (x, y)] + [b for _, _, b in flat if b is not None]
    return Program(Structure(tuple(map(len, loops)), arcs), np.array(numbers, dtype=np.float64))


def lines(*points: tuple[float, float]) -> list[Vertex]:
    return [(x, y, None) for x, y in points]


def box(x0: float, y0: float, x1: float, y1: float) -> list[Vertex]:
    """Counter-clockwise for x0 < x1 and y0 < y1."""
    return lines((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def disc(x: float, y: float, r: float, turn: int = 1, parts: int = 2, start: float = 0.3) -> list[Vertex]:
    """A circle of equal arcs, counter-clockwise for turn = 1."""
    angles = [start + turn * 2 * pi * k / parts for k in range(parts)]
    return [(x + r * cos(a), y + r * sin(a), turn * tan(pi / 2 / parts)) for a in angles]


def back(loop: list[Vertex]) -> list[Vertex]:
    """The same curve travelled the other way."""
    before = [loop[-1], *loop[:-1]]
    turned = [(x, y, None if b is None else -b) for (x, y, _), (_, _, b) in zip(loop, before, strict=True)]
    return turned[::-1]


def loops_of(found: Program[Structure]) -> list[Loop]:
    n, starts = len(found.structure.arcs), np.cumsum((0, *found.structure.sizes))
    points, b = found.params[: 2 * n].reshape(-1, 2), np.zeros(n)
    b[found.structure.layout.arc_edges] = found.params[2 * n :]
    return [Loop.from_arrays(points[a:z], b[a:z]) for a, z in pairwise(starts)]


def region(found: Program[Structure]) -> NDArray[np.bool_]:
    """Where the winding number is not zero, by the raster's scan lines; no simple line meets the pixels' centres."""
    inside = np.zeros(CANVAS.shape, np.bool_)
    params = found.params.copy()
    params[: 2 * len(found.structure.arcs)] += np.resize([0.1379, 0.2917], 2 * len(found.structure.arcs))
    for row, first, last in GRAMMAR.rasterize(found.moved(params), CANVAS).spans:
        inside[row, first:last] = True
    return inside


def largest_change(before: Program[Structure], after: Program[Structure]) -> float:
    """Pixels of the largest connected part in which the regions differ."""
    parts, count = label(region(before) != region(after), np.ones((3, 3)))
    return max(sum_of(parts > 0, parts, range(1, count + 1)), default=0.0)


def area(found: Program[Structure]) -> float:
    return GRAMMAR.outline(found).area


def repaired(loops: Shape | Program[Structure], change: float = 1.0) -> Program[Structure]:
    """The shape after repair, which keeps every promise: checked by other formulas than the repair's own."""
    before = loops if isinstance(loops, Program) else program(loops)
    edit = GRAMMAR.repair(before)
    after = edit.program
    assert edit.origin.shape == after.params.shape
    assert GRAMMAR.repair(after).program is after
    assert largest_change(before, after) <= change
    found = loops_of(after)
    points = np.random.default_rng(0).uniform(-150, 150, (300, 2)) @ np.array([1, 1j])
    turns = sum((windings(loop.edges, points) for loop in found), np.zeros(points.size, np.int64))
    assert set(turns.tolist()) <= {0, 1}
    sketch = GRAMMAR.outline(after)  # refuses loops that cross or touch
    assert sketch.area == pytest.approx(sum(loop.area for loop in found))  # the inside is left of every loop
    return after


def kinds(found: Program[Structure]) -> list[str]:
    """The loops as words, sorted, each from its alphabetically first vertex on."""
    return sorted(min(word[k:] + word[:k] for k in range(len(word))) for word in GRAMMAR.encode(found.structure))


def lens_area(r: float, gap: float) -> float:
    """Of the intersection of two discs of radius r whose centres are ``gap`` apart."""
    half = np.arccos(gap / 2 / r)
    return float(r * r * (2 * half - sin(2 * half)))


# Defects of the published repair, SPEC 3.5 and 3.6


def test_overlapping_discs_become_their_union_without_a_hole() -> None:
    after = repaired([disc(-20, 0, 40), disc(20, 0, 40)])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(2 * pi * 1600 - lens_area(40, 40), rel=1e-9)


def test_overlapping_squares_become_their_union_without_a_hole() -> None:
    after = repaired([box(-50, -50, 10, 10), box(-10, -10, 50, 50)])
    assert kinds(after) == ["L" * 8]
    assert area(after) == pytest.approx(2 * 3600 - 400)


def test_a_doubly_wound_loop_is_covered_once() -> None:
    """A loop that goes round twice: the inner turn separates two inside regions."""
    spiral = lines((-60, -60), (60, -60), (60, 60), (-30, 60), (-30, -30), (30, -30), (30, 30), (-60, 30))
    after = repaired([spiral])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(120 * 120 - 30 * 30)


@pytest.mark.parametrize("corners", [3, 4, 5])
def test_nesting_is_decided_inside_and_not_at_vertices(corners: int) -> None:
    """A hole with one vertex beyond the rim: what is out there is wound -1 times and counts as material."""
    hole = [(30 * cos(2 * pi * k / corners), 30 * sin(2 * pi * k / corners)) for k in range(corners)]
    moved = [(x + 35, y) for x, y in hole[::-1]]
    after = repaired([box(-50, -50, 50, 50), lines(*moved)])
    inner = area(program([lines(*[(x + 35, y) for x, y in hole])]))
    outer = tip(moved, 50.0)
    assert area(after) == pytest.approx(10000 - (inner - outer) + outer, abs=0.5)
    after = repaired([box(-60, -60, 60, 60), lines(*[(x, y) for x, y in hole[::-1]])])
    assert area(after) == pytest.approx(14400 - inner)


def tip(points: list[tuple[float, float]], x: float) -> float:
    """Area of the triangle that a convex polygon with one vertex right of x has there."""
    k = max(range(len(points)), key=lambda i: points[i][0])
    px, py = points[k]
    ys = [
        py + (qy - py) * (px - x) / (px - qx)
        for qx, qy in (points[k - 1], points[(k + 1) % len(points)])
    ]  # fmt: skip
    return (px - x) * abs(ys[0] - ys[1]) / 2


@pytest.mark.parametrize("share", [0.1, 0.25, 0.4, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("bulge", [0.35, 0.62, 1.0, 3.0])
def test_crossings_beyond_the_naive_box_of_an_oblique_arc_are_seen(share: float, bulge: float) -> None:
    """A small square on the arc's top, at a share of its sweep: mostly outside the box of its ends and sagitta."""
    sweep = 4 * atan(bulge)
    heading = pi - share * sweep  # of the tangent at the start; at the top it is level, to the left
    half_chord = 30 * np.exp(1j * (heading + sweep / 2))
    radius = 30 / abs(sin(sweep / 2))
    middle = 1j * np.exp(1j * heading) * radius - half_chord
    x, y = float(middle.real), float(middle.imag) + radius
    segment: list[Vertex] = [
        (-half_chord.real, -half_chord.imag, bulge),
        (half_chord.real, half_chord.imag, None),
    ]
    after = repaired([segment, box(x - 2, y - 2, x + 2, y + 2)])
    assert len(after.structure.sizes) == 1


@pytest.mark.parametrize("bulge", [0.0, 1e-300, 1e-16, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, -1e-12, -1e-6, -1e-3])
def test_a_line_meets_an_arc_of_tiny_bulge_where_it_is(bulge: float) -> None:
    """The top of the low box is an arc from (60, 0) to (-60, 0); the tall box stands across it."""
    low: list[Vertex] = [(-60, -40, None), (60, -40, None), (60, 0, bulge), (-60, 0, None)]
    after = repaired([low, box(-10, -20, 20, 30)])
    assert kinds(after) == [min("LLALLLAL"[k:] + "LLALLLAL"[:k] for k in range(8))]
    points = after.params[: 2 * len(after.structure.arcs)].reshape(-1, 2)
    for x in (-10.0, 20.0):
        crossing = points[(np.abs(points[:, 0] - x) < 1e-9) & (points[:, 1] < 20)]
        height = 60 * bulge - bulge * x * x / 60  # of the parabola, good to bulge^3
        assert crossing[:, 1] == pytest.approx([height], abs=1e-6)


@pytest.mark.parametrize("parts", [1.0, 1.0 - 1e-9, 1.0 + 1e-9, 1.0 + 1e-7])
def test_discs_that_touch_from_outside_stay_two(parts: float) -> None:
    after = repaired([disc(-30, 0, 30 * parts), disc(30, 0, 30 * parts, start=pi / 2)])
    assert area(after) == pytest.approx(2 * pi * 900, rel=1e-3)
    assert min(min(loop.lengths) for loop in loops_of(after)) > 0.1


@pytest.mark.parametrize("start", [0.0, 0.3, pi / 2])
def test_a_hole_that_touches_the_rim_from_inside(start: float) -> None:
    after = repaired([disc(0, 0, 60), disc(30, 0, 30, -1, start=start)])
    assert area(after) == pytest.approx(pi * 2700, rel=1e-3)
    assert min(min(loop.lengths) for loop in loops_of(after)) > 0.1


@pytest.mark.parametrize("start", [0.0, 0.3, pi / 2, -pi / 2])
def test_a_disc_that_rests_on_a_line(start: float) -> None:
    after = repaired([box(-60, -40, 60, 0), disc(7, 20, 20, start=start)])
    assert area(after) == pytest.approx(4800 + pi * 400, rel=1e-3)


@pytest.mark.parametrize("start", [0.0, 0.3, pi / 2, -pi / 2])
def test_a_hole_that_touches_a_line(start: float) -> None:
    after = repaired([box(-60, 0, 60, 80), disc(7, 20, 20, -1, start=start)])
    assert area(after) == pytest.approx(9600 - pi * 400, rel=1e-3)


@pytest.mark.parametrize("start", [0.3, 1.0])
@pytest.mark.parametrize("parts", [2, 3])
def test_one_circle_twice_is_one_circle(start: float, parts: int) -> None:
    after = repaired([disc(0, 0, 40), disc(0, 0, 40, parts=parts, start=start)])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(pi * 1600)


def test_concentric_circles() -> None:
    assert kinds(repaired([disc(0, 0, 40), disc(0, 0, 30)])) == ["AA"]
    ring = program([disc(0, 0, 40), disc(0, 0, 30, -1)])
    assert repaired(ring) is ring


def test_arcs_of_one_circle_that_overlap() -> None:
    """Two half discs, one turned by a right angle: three quarters of the disc."""
    left: list[Vertex] = [(0, 40, 1.0), (0, -40, None)]
    lower: list[Vertex] = [(-40, 0, 1.0), (40, 0, None)]
    after = repaired([left, lower])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(0.75 * pi * 1600, rel=1e-6)


def test_half_discs_back_to_back_are_a_disc() -> None:
    left: list[Vertex] = [(0, 40, 1.0), (0, -40, None)]
    right: list[Vertex] = [(0, -40, 1.0), (0, 40, None)]
    after = repaired([left, right])
    assert kinds(after) == ["AA"]
    assert area(after) == pytest.approx(pi * 1600)


@pytest.mark.parametrize("high", [(-20, 40), (-30, 50), (0, 40), (10, 30), (0, 60), (-20, 20)])
def test_squares_side_by_side_are_joined(high: tuple[float, float]) -> None:
    """They share part of a side, in opposite directions."""
    low, top = high
    after = repaired([box(-40, 0, 0, 40), box(0, low, 40, top)])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(1600 + 40 * (top - low))


@pytest.mark.parametrize("right", [0.0, 20.0, 60.0])
def test_squares_on_one_base_line_are_joined(right: float) -> None:
    """Their bases lie on one line and overlap in the same direction."""
    after = repaired([box(-40, 0, 20, 40), box(right - 60, 0, right, 20)])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(60 * 40 + 20 * (max(right - 20, 0) + max(-40 - right + 60, 0)))


@pytest.mark.parametrize("tip", [(110.0, 10.0), (50.0, 80.0), (20.0, 10.0), (50.5, 10.0), (49.8, 10.0)])
def test_a_spike_of_no_width_goes(tip: tuple[float, float]) -> None:
    """Outwards or inwards, square to its side or not."""
    root = (50.0, 10.0)
    after = repaired([lines((-50, -50), (50, -50), root, tip, root, (50, 50), (-50, 50))])
    assert area(after) == pytest.approx(10000)
    assert GRAMMAR.primitives(after) <= 5


def test_a_spike_longer_than_its_neighbour_goes() -> None:
    """Out to x = 90 and back beyond where it began."""
    after = repaired([lines((-50, -50), (90, -50), (50, -50), (50, 50), (-50, 50))])
    assert area(after) == pytest.approx(10000)
    assert kinds(after) == ["LLLL"]


def test_an_arc_there_and_back_goes() -> None:
    loop: list[Vertex] = [*lines((-50, -50)), (50, -50, None), (50, 0, 0.5), (90, 40, -0.5), *lines((50, 0), (50, 50))]
    after = repaired([[*loop, (-50, 50, None)]])
    assert area(after) == pytest.approx(10000)


@pytest.mark.parametrize("near", [1e-2, 1e-3, 1e-4, 1e-5])
def test_close_ends_do_not_hide_a_crossing(near: float) -> None:
    """Long lines cross while two of their ends are ``near`` each other."""
    bow = lines((-60, -40), (60, 40), (60 + near, 40 - near), (60, -40), (-60 - near, 40))
    after = repaired([bow])
    assert len(after.structure.sizes) == 2


@pytest.mark.parametrize("aside", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, -1e-12, -1e-9, -1e-7, -1e-5, -1e-3])
def test_an_edge_through_a_vertex(aside: float) -> None:
    """The left corner of a diamond on the square's right side, or nearly so: it crosses both or neither neighbour."""
    after = repaired([box(-60, -60, 0, 60), lines((aside, 0), (40, -40), (80, 0), (40, 40))])
    assert area(after) == pytest.approx(7200 + 3200, rel=1e-3)
    across = repaired([box(-60, -60, 0, 60), lines((-40, 0), (aside, -40), (40, 0), (aside, 40))])
    assert len(across.structure.sizes) == 1
    assert area(across) == pytest.approx(7200 + 1600, rel=1e-3)


@pytest.mark.parametrize("aside", [0.0, 1e-9, 1e-5])
def test_loops_that_cross_in_common_vertices(aside: float) -> None:
    after = repaired([lines((-40, 0), (0, -40), (40, 0), (0, 40)), lines((0, -40 + aside), (70, 0), (0, 40 - aside))])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(1600 + 40 * 70, rel=1e-3)


def test_many_edges_through_one_point() -> None:
    fans = [
        lines((0, 0), (50 * cos(a), 50 * sin(a)), (50 * cos(a + 0.4), 50 * sin(a + 0.4))) for a in np.arange(7) * 0.9
    ]
    after = repaired(fans)
    assert len(after.structure.sizes) == 7
    star = [(60 * cos(4 * pi * k / 5), 60 * sin(4 * pi * k / 5)) for k in range(5)]
    assert kinds(repaired([lines(*star)])) == ["L" * 10]


def test_the_result_does_not_depend_on_order() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        shape = heavy(rng)
        first = repaired(shape, 8.0)
        turned = [loop[k:] + loop[:k] for loop in shape for k in [int(rng.integers(len(loop)))]]
        order = rng.permutation(len(shape))
        second = repaired([turned[k] for k in order], 8.0)
        assert kinds(first) == kinds(second)
        one, two = (np.sort(found.params[: 2 * len(found.structure.arcs)]) for found in (first, second))
        assert one == pytest.approx(two, abs=1e-6)


def test_a_figure_eight_of_no_signed_area_stays() -> None:
    """Two lobes that cancel in the signed area."""
    after = repaired([lines((-60, -30), (60, 30), (60, -30), (-60, 30))])
    assert kinds(after) == ["LLL", "LLL"]
    assert area(after) == pytest.approx(2 * 60 * 30, rel=1e-3)
    round_lobes: list[Vertex] = [(-50, 20, None), (50, -20, 1.5), (50, 20, None), (-50, -20, -1.5)]
    assert len(repaired([round_lobes]).structure.sizes) == 2


def test_fragments_of_a_crossing_go_in_the_same_call() -> None:
    """The tip that crosses over is a triangle of 0.5 square pixels."""
    after = repaired([lines((-50, -50), (50, -50), (50, 50), (-50, 50), (-50, 1), (-51, 0), (-50, -0.001))])
    assert len(after.structure.sizes) == 1
    crossed = repaired([lines((-50, -50), (50, -50), (49, 50), (50, 50), (-50, 49.9))], change=30.0)
    assert len(crossed.structure.sizes) == 1


def test_a_loop_of_two_lines_goes() -> None:
    after = repaired([box(-50, -50, 50, 50), lines((60, 0), (90, 20)), lines((-20, 0), (20, 10))])
    assert kinds(after) == ["LLLL"]


def test_two_lines_across_a_shape_change_nothing_of_it() -> None:
    after = repaired([box(-50, -50, 50, 50), lines((-90, 0), (90, 20))])
    assert area(after) == pytest.approx(10000)
    assert GRAMMAR.primitives(after) <= 6


def test_no_number_of_crossings_is_too_large() -> None:
    teeth = np.arange(-60, 60, 10.0)
    upright = [box(x, -80, x + 5, 80) for x in teeth]
    level = [box(-80, y, 80, y + 5) for y in teeth]
    after = repaired([*upright, *level])
    assert len(after.structure.sizes) == 1 + 11 * 11
    assert area(after) == pytest.approx(2 * 12 * 5 * 160 - 144 * 25)


@pytest.mark.parametrize("chord", [1.0, 1e-2, 1e-4])
def test_a_nearly_full_circle_in_one_edge(chord: float) -> None:
    """Its bulge is 2 R / chord and more: no sagitta blows up."""
    bulge = tan((2 * pi - 2 * np.arcsin(chord / 80)) / 4)
    after = repaired([[(40, -chord / 2, None), (40, chord / 2, bulge)], box(-80, -10, 80, 10)])
    assert len(after.structure.sizes) == 1
    assert area(after) == pytest.approx(
        pi * 1600 + 3200 - 1600 * (2 * np.arcsin(0.25) + sin(2 * np.arcsin(0.25))), rel=2e-3
    )


def test_a_short_edge_goes_and_the_arc_beside_it_keeps_its_size() -> None:
    loop: list[Vertex] = [(40, -0.1, None), (40, -0.03, None), (40, 0.1, tan((2 * pi - 2 * np.arcsin(0.1 / 40)) / 4))]
    after = repaired([loop])
    assert GRAMMAR.primitives(after) == 2
    assert area(after) == pytest.approx(pi * 1600, rel=1e-3)


def test_a_new_loop_of_the_paper_stays() -> None:
    """It has 3.14e-4 world units squared; the least area must leave it a margin."""
    grammar = ArcLine()
    loop = [(0.01 * x, 0.01 * y, b) for x, y, b in disc(30, 20, 1.0, parts=4)]
    start = program([[(-1, -1, None), (1, -1, None), (1, 1, None), (-1, 1, None)], [(x + 1, y, b) for x, y, b in loop]])
    assert grammar.repair(start).program is start


# What else repair promises


def test_a_valid_program_comes_back_as_itself() -> None:
    for seed in range(20):
        sketch = generate(np.random.default_rng(seed), 8 if seed < 16 else 40).scaled(100)
        valid = program([
            [(x, y, b or None) for (x, y), b in zip(loop.points, loop.bulges, strict=True)] for loop in sketch.loops
        ])  # fmt: skip
        edit = GRAMMAR.repair(valid)
        assert edit.program is valid
        assert edit.origin.tolist() == list(range(valid.params.size))


@pytest.mark.parametrize("loop", [box(-50, -40, 50, 40), disc(0, 0, 40), [(-40.0, 0.0, 0.5), (40.0, 0.0, None)]])
def test_the_wrong_way_round_is_turned(loop: list[Vertex]) -> None:
    after = repaired([back(loop)])
    assert area(after) == pytest.approx(area(program([loop])))
    inside = repaired([box(-80, -80, 80, 80), back(loop)])
    assert len(inside.structure.sizes) == 2
    assert kinds(repaired([box(-80, -80, 80, 80), loop])) == ["LLLL"]


def test_loops_of_little_area_and_short_edges_go() -> None:
    after = repaired([box(-50, -50, 50, 50), disc(80, 0, 0.7), disc(0, 0, 0.7, -1), box(80, 60, 81.4, 61.4)], 4.0)
    assert kinds(after) == ["LLLL"]
    after = repaired([lines((-50, -50), (50, -50), (50.05, -50), (50, 50), (-50, 50), (-50.01, 50.02))])
    assert kinds(after) == ["LLLL"]


NOTHING: list[Shape] = [
    [lines((0, 0), (40, 20))],
    [[(0.0, 0.0, 0.5), (40.0, 20.0, -0.5)]],
    [box(0, 0, 40, 40), back(box(0, 0, 40, 40))],
    [lines((0, 0), (40, 20), (80, 40))],
    [lines((5, 5), (5, 5), (5, 5))],
]


@pytest.mark.parametrize("loops", NOTHING)
def test_a_shape_of_which_nothing_would_remain_comes_back_as_it_was(loops: Shape) -> None:
    start = program(loops)
    assert GRAMMAR.repair(start).program is start


def test_of_small_loops_alone_the_largest_stays() -> None:
    assert kinds(repaired([box(0, 0, 1, 1), box(5, 0, 6.2, 1), box(9, 0, 9.5, 1)], 2.0)) == ["LLLL"]


def test_origin_follows_what_repair_left_alone() -> None:
    """Of two squares that overlap six corners stay; an arc that nothing crosses keeps its bulge."""
    start = program([[(-50, -50, 0.2), (10, -50, None), (10, 10, None), (-50, 10, None)], box(-10, -10, 50, 50)])
    edit = GRAMMAR.repair(start)
    kept = edit.origin >= 0
    assert kept.sum() == 2 * 6 + 1
    assert edit.program.params[kept] == pytest.approx(start.params[edit.origin[kept]], abs=1e-12)


@pytest.mark.parametrize("wrong", [nan, inf, -inf])
@pytest.mark.parametrize("place", [0, 8])
def test_numbers_that_are_not_finite_are_refused(wrong: float, place: int) -> None:
    start = program([[(-50, -50, 0.2), *box(-50, -50, 50, 50)[1:]]])
    with pytest.raises(GrammarError, match="finite"):
        GRAMMAR.repair(start.moved(np.where(np.arange(9) == place, wrong, start.params)))


def heavy(rng: np.random.Generator) -> Shape:
    """One to three loops that cross themselves and each other many times."""
    shape: Shape = []
    for _ in range(int(rng.integers(1, 4))):
        n = int(rng.integers(3, 9))
        points = rng.normal(0, 40, (n, 2)).tolist()
        bulges = np.where(rng.random(n) < 0.5, rng.normal(0, 0.7, n), nan).tolist()
        shape.append([(x, y, None if b != b else b) for (x, y), b in zip(points, bulges, strict=True)])
    return shape


def degenerate(rng: np.random.Generator, noise: float) -> Shape:
    """Loops on a coarse grid: vertices on edges, overlaps, tangencies, slits and spikes abound."""
    choice = [None, None, None, 1.0, -1.0, tan(pi / 8), -tan(pi / 8), 0.5, -0.5]
    shape: Shape = []
    for _ in range(int(rng.integers(1, 4))):
        n = int(rng.integers(2, 9))
        points = (rng.integers(-4, 5, (n, 2)) * 20 + rng.normal(0, noise, (n, 2))).tolist()
        shape.append([(x, y, choice[int(rng.integers(len(choice)))]) for x, y in points])
    return shape


def test_random_loops_keep_their_region() -> None:
    for seed in range(250):
        repaired(heavy(np.random.default_rng(seed)), change=8.0)


def test_degenerate_loops_keep_their_region() -> None:
    for seed in range(300):
        rng = np.random.default_rng(seed)
        start = program(degenerate(rng, 0.0 if seed < 150 else 10 ** rng.uniform(-9, -1)))
        if GRAMMAR.repair(start).program is not start:
            repaired(start, change=8.0)


@st.composite
def shapes(draw: st.DrawFn) -> Shape:
    place = st.one_of(st.integers(-5, 5).map(lambda v: 20.0 * v), st.floats(-120, 120, width=32))
    bulge = st.one_of(st.none(), st.sampled_from([1.0, -1.0, 0.5]), st.floats(-3, 3), st.floats(-1e-6, 1e-6))
    vertex = st.tuples(place, place, bulge)
    return draw(st.lists(st.lists(vertex, min_size=2, max_size=7), min_size=1, max_size=3))


@given(shapes())
@calm
def test_any_loops_keep_their_region(loops: Shape) -> None:
    start = program(loops)
    if GRAMMAR.repair(start).program is not start:
        repaired(start, change=8.0)


@given(st.lists(st.tuples(st.floats(-90, 90), st.floats(-90, 90), st.floats(5, 50)), min_size=1, max_size=6))
@calm
def test_the_union_of_discs_has_the_area_of_their_pixels(discs: list[tuple[float, float, float]]) -> None:
    after = repaired([disc(*numbers) for numbers in discs], change=8.0)
    rows, cols = np.mgrid[-160:160, -160:160] + 0.5
    covered = np.any([np.hypot(cols - x, rows - y) < r for x, y, r in discs], axis=0)
    around = sum(2 * pi * r for _, _, r in discs)
    assert area(after) == pytest.approx(covered.sum(), abs=0.2 * around + 5)
