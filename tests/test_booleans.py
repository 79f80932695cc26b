"""Booleans on lines and arcs: known answers, identities, and agreement with manifold3d and with the repair."""

from __future__ import annotations

import json
from importlib import import_module
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from d4cad import booleans
from d4cad.arrangement import APART, regions
from d4cad.booleans import difference, intersection, symmetric_difference, union
from d4cad.cli import app
from d4cad.cutting import near_pairs
from d4cad.errors import GeometryError
from d4cad.exporters import occ
from d4cad.grammars.arc_line import ArcLine, Structure
from d4cad.program import Program
from d4cad.programs import load_program
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

calm = settings(max_examples=15, deadline=None)


def part(*loops: Loop) -> Sketch:
    return Sketch.from_loops(loops, "mm")


def square(x: float, y: float, side: float) -> Loop:
    return Loop.polyline([(x, y), (x + side, y), (x + side, y + side), (x, y + side)])


def disc(x: float, y: float, r: float) -> Loop:
    return Circle((x, y), r).loop()


def turned(sketch: Sketch, angle: float, dx: float, dy: float) -> Sketch:
    """The sketch rotated about the origin, then moved."""
    loops = []
    for loop in sketch.loops:
        z = loop.edges.z0 * np.exp(1j * angle) + complex(dx, dy)
        loops.append(Loop.from_arrays(np.stack([z.real, z.imag], axis=1), loop.edges.b))
    return Sketch.from_loops(loops, sketch.unit)


def census(sketch: Sketch) -> tuple[int, int, int]:
    """Faces, holes, edges."""
    return len(sketch.faces), sum(len(face.holes) for face in sketch.faces), sketch.primitives


LENS = 2 * pi / 3 - sqrt(3) / 2
"""Of unit discs whose centres are 1 apart."""

KNOWN: list[tuple[str, Sketch, Sketch, float, tuple[int, int, int]]] = [
    ("union", part(square(0, 0, 2)), part(square(1, 1, 2)), 7.0, (1, 0, 8)),
    ("difference", part(square(0, 0, 2)), part(square(1, 1, 2)), 3.0, (1, 0, 6)),
    ("intersection", part(square(0, 0, 2)), part(square(1, 1, 2)), 1.0, (1, 0, 4)),
    # one edge in common, the same and the other way round
    ("union", part(square(0, 0, 2)), part(square(2, 0, 2)), 8.0, (1, 0, 4)),
    ("intersection", part(square(0, 0, 2)), part(square(2, 0, 2)), 0.0, (0, 0, 0)),
    ("difference", part(square(0, 0, 2)), part(square(2, 0, 2)), 4.0, (1, 0, 4)),
    ("difference", part(square(0, 0, 2)), part(square(0, 0, 1)), 3.0, (1, 0, 6)),
    ("union", part(square(0, 0, 2)), part(square(0, 0, 1)), 4.0, (1, 0, 4)),
    # the same twice
    ("union", part(square(0, 0, 2)), part(square(0, 0, 2)), 4.0, (1, 0, 4)),
    ("difference", part(square(0, 0, 2)), part(square(0, 0, 2)), 0.0, (0, 0, 0)),
    ("symmetric_difference", part(disc(0, 0, 2)), part(disc(0, 0, 2)), 0.0, (0, 0, 0)),
    # holes and islands
    ("difference", part(square(0, 0, 4)), part(disc(2, 2, 1)), 16 - pi, (1, 1, 6)),
    ("union", part(square(0, 0, 9), square(2, 2, 5)), part(square(4, 4, 1)), 57.0, (2, 1, 12)),
    ("union", part(square(0, 0, 9), square(2, 2, 5)), part(square(2, 2, 5)), 81.0, (1, 0, 4)),
    ("intersection", part(square(0, 0, 9), square(2, 2, 5)), part(square(4, 4, 1)), 0.0, (0, 0, 0)),
    # arcs
    ("union", part(disc(0, 0, 1)), part(disc(1, 0, 1)), 2 * pi - LENS, (1, 0, 4)),
    ("intersection", part(disc(0, 0, 1)), part(disc(1, 0, 1)), LENS, (1, 0, 4)),
    ("symmetric_difference", part(disc(0, 0, 2)), part(disc(0, 0, 1)), 3 * pi, (1, 1, 4)),
    # parts of one circle that go on are one arc: two semicircular plates
    ("union", part(Loop(((1, 0), (-1, 0)), (1, 0))), part(Loop(((-1, 0), (1, 0)), (1, 0))), pi, (1, 0, 2)),
    # tangent discs, whose common point holds nothing together; one inside the other; a disc that fills a square
    ("union", part(disc(0, 0, 1)), part(disc(2, 0, 1)), 2 * pi, (2, 0, 4)),
    ("intersection", part(disc(0, 0, 1)), part(disc(2, 0, 1)), 0.0, (0, 0, 0)),
    ("difference", part(disc(0, 0, 1)), part(disc(0.5, 0, 0.5)), 0.75 * pi, (1, 0, 4)),
    ("difference", part(disc(0, 0, 1)), part(disc(0.3, 0.4, 0.5)), 0.75 * pi, (1, 0, 5)),
    ("union", part(disc(0, 0, 1)), part(disc(0.3, 0.4, 0.5)), pi, (1, 0, 2)),
    ("difference", part(square(-1, -1, 2)), part(disc(0, 0, 1)), 4 - pi, (4, 0, 12)),
    # corners that touch: of two parts, and of a hole and its outer loop
    ("union", part(square(0, 0, 2)), part(square(2, 2, 2)), 8.0, (2, 0, 8)),
    ("difference", part(square(0, 0, 4)), part(Loop.polyline([(0, 2), (1, 1), (2, 2), (1, 3)])), 14.0, (1, 0, 9)),
]


@pytest.mark.parametrize(("operation", "a", "b", "area", "kind"), KNOWN)
def test_known_answers(operation: str, a: Sketch, b: Sketch, area: float, kind: tuple[int, int, int]) -> None:
    found = getattr(booleans, operation)(a, b)
    touching = census(found)[:2] != (1, 0) or area in (0.75 * pi, 14.0)
    assert found.area == pytest.approx(area, abs=50 * APART if touching else 1e-12)
    if kind != (1, 0, 5):  # a vertex of the circle may or may not be where they touch
        assert census(found) == kind
    assert found.unit == "mm"


@pytest.mark.parametrize(("operation", "a", "b"), [case[:3] for case in KNOWN if case[3] > 0])
def test_results_are_solids_to_the_cad_kernel(operation: str, a: Sketch, b: Sketch) -> None:
    """Those with cusps and drawn-back corners too."""
    found = getattr(booleans, operation)(a, b).scaled(25)
    bodies = occ.solids(found, 2.0)
    assert all(occ.is_valid(body) for body in bodies)
    assert sum(occ.volume(body) for body in bodies) == pytest.approx(2 * found.area, rel=1e-9)


def test_any_number_of_parts() -> None:
    row = [part(square(2 * k, 0, 2)) for k in range(10)]
    assert census(union(*row)) == (1, 0, 4)
    assert union(*row).area == pytest.approx(40)
    assert union().faces == ()
    assert union(part(square(0, 0, 1)), Sketch((), "world")).unit == "mm"


def test_untouched_edges_come_back_as_they_are() -> None:
    a, b = generate(np.random.default_rng(3), 40), generate(np.random.default_rng(4), 8).translated(10, 0)
    assert sorted(loop.points for loop in union(a, b).loops) == sorted(loop.points for loop in (*a.loops, *b.loops))
    assert difference(a, b) == a
    keyhole = part(Loop(((-0.5, -2), (0.5, -2), (0.5, 0), (-0.5, 0)), (0, 0, 2.5, 0)))
    (loop,) = union(keyhole, keyhole).loops
    assert sorted(loop.bulges) == [0, 0, 0, 2.5]


def test_corners_that_touch_are_drawn_back() -> None:
    """Into their own material, far enough for every kernel to tell them apart."""
    found = union(part(square(0, 0, 2)), part(square(2, 2, 2)))
    a, b = found.faces
    gap = min(abs(complex(*p) - complex(*q)) for p in a.outer.points for q in b.outer.points)
    assert gap == pytest.approx(2 * 4 * APART)


def test_units_must_agree() -> None:
    with pytest.raises(GeometryError, match="one unit, got mm and world"):
        union(part(square(0, 0, 1)), Sketch.from_loops([square(0, 0, 1)]))


@st.composite
def pairs(draw: Any) -> tuple[Sketch, Sketch]:
    """Generated shapes, the second turned and moved: freely, or so that edges fall on edges of the first."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    a = generate(rng, draw(st.sampled_from([6, 12, 25])))
    b = a if draw(st.booleans()) else generate(rng, draw(st.sampled_from([6, 12])))
    if draw(st.booleans()):
        angle, dx, dy = draw(st.integers(0, 3)) * pi / 2, *(draw(st.sampled_from([0, 0.1, 0.4])) for _ in range(2))
    else:
        angle, dx, dy = rng.uniform(0, 7), *rng.uniform(-0.6, 0.6, 2)
    return a, turned(b, angle, dx, dy)


@calm
@given(pairs())
def test_areas_add_up(shapes: tuple[Sketch, Sketch]) -> None:
    a, b = shapes
    both, either = intersection(a, b), union(a, b)
    total = a.area + b.area
    assert both.area + either.area == pytest.approx(total, rel=1e-9)
    assert difference(a, b).area == pytest.approx(a.area - both.area, abs=1e-9 * total)
    assert difference(b, a).area == pytest.approx(b.area - both.area, abs=1e-9 * total)
    assert symmetric_difference(a, b).area == pytest.approx(either.area - both.area, abs=1e-4)  # drawn back corners
    assert union(b, a).area == pytest.approx(either.area, rel=1e-12)
    assert intersection(b, a).area == pytest.approx(both.area, abs=1e-12)


@calm
@given(pairs())
def test_doing_it_again_changes_nothing(shapes: tuple[Sketch, Sketch]) -> None:
    a, b = shapes
    both, either = intersection(a, b), union(a, b)
    assert union(either, either) == either
    assert union(either, a).area == pytest.approx(either.area, rel=1e-9)
    assert intersection(either, a).area == pytest.approx(a.area, rel=1e-9)
    assert intersection(both, b).area == pytest.approx(both.area, abs=1e-9)
    assert union(difference(a, b), both).area == pytest.approx(a.area, rel=1e-9)


@calm
@given(pairs())
def test_agrees_with_manifold3d(shapes: tuple[Sketch, Sketch]) -> None:
    manifold3d = import_module("manifold3d")
    a, b = shapes
    tolerance = 1e-6
    p, q = (manifold3d.CrossSection(s.polygon(tolerance), manifold3d.FillRule.EvenOdd) for s in shapes)
    slack = 2 * tolerance * (a.length + b.length)
    assert union(a, b).area == pytest.approx((p + q).area(), abs=slack)
    assert intersection(a, b).area == pytest.approx((p ^ q).area(), abs=slack)
    assert difference(a, b).area == pytest.approx((p - q).area(), abs=slack)


@calm
@given(pairs())
def test_agrees_with_the_repair_of_the_grammar(shapes: tuple[Sketch, Sketch]) -> None:
    """The non-zero region of the loops of both is their union; that code works on pixels, with its own formulas."""
    loops = [loop.scaled(3000) for shape in shapes for loop in shape.loops]
    arcs = tuple(b != 0 for loop in loops for b in loop.bulges)
    numbers = [x for loop in loops for point in loop.points for x in point]
    numbers += [b for loop in loops for b in loop.bulges if b != 0]
    program = Program(Structure(tuple(len(loop.points) for loop in loops), arcs), np.array(numbers))
    grammar = ArcLine(pixel=1.0)
    repaired = grammar.outline(grammar.repair(program).program)
    either = union(*shapes).scaled(3000)
    # the repair drops edges under a tenth of a pixel, and loops of less than 2 square pixels
    assert either.area == pytest.approx(repaired.area, abs=0.05 * either.length + 2.0 * len(either.loops))


def test_loops_that_wind_more_than_once() -> None:
    """A bowtie keeps its counter-clockwise half, a doubled loop is there once."""
    (found,) = regions([Loop.polyline([(0, 0), (2, 2), (2, 0), (0, 2)])])
    assert found.area == pytest.approx(1)
    again = square(0, 0, 1)
    (found,) = regions([again, again])
    assert found == again
    assert regions([again, again], lambda winding: winding >= 3) == []


def test_near_pairs_are_those_of_all_pairs() -> None:
    rng = np.random.default_rng(0)
    low = rng.uniform(0, 1, (60, 2))
    box = np.hstack([low, low + rng.uniform(0, 0.2, (60, 2))])
    found = {frozenset(p) for p in zip(*(x.tolist() for x in near_pairs(box, 0.01)), strict=True)}
    near = {
        frozenset((i, j))
        for i in range(60)
        for j in range(i)
        if all(box[i, k] <= box[j, k + 2] + 0.01 and box[j, k] <= box[i, k + 2] + 0.01 for k in (0, 1))
    }
    assert found == near


def program_file(path: Path, sketch: Sketch) -> str:
    """A program file whose outline is the sketch."""
    document = {
        "format": "d4cad-program", "version": 1, "grammar": "arc-line", "structure": [], "params": [],
        "canvas": {"width": 9, "height": 9, "pixel": 1.0, "ramp": 0.5}, "settings": {"placement": {"thickness": 4}},
        "history": [], "stop": "converged", "psnr": 99.0, "primitives": 4, "unit": "mm", "loops": sketch.to_neutral(),
    }  # fmt: skip
    path.write_text(json.dumps(document))
    return str(path)


def test_command(tmp_path: Path) -> None:
    a = program_file(tmp_path / "a.json", part(square(0, 0, 20)))
    b = program_file(tmp_path / "b.json", part(disc(10, 10, 5)))
    run = CliRunner().invoke
    args = ["combine", a, "difference", b, "--at", "10,0", "-o", str(tmp_path / "out.svg"), "--json"]
    result = run(app, [*args, "-o", str(tmp_path / "out.stl")])
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert facts["area_mm2"] == pytest.approx(400 - 12.5 * pi)
    mesh = import_module("trimesh").load_mesh(tmp_path / "out.stl")
    assert mesh.volume == pytest.approx(4 * (400 - 12.5 * pi), rel=1e-3)
    drawing, program = str(tmp_path / "out.svg"), str(tmp_path / "out.json")
    result = run(app, ["combine", drawing, "intersection", b, "--at", "1,0", "-o", program, "--json"])
    assert result.exit_code == 0, result.output
    assert load_program(program).sketch().area == pytest.approx(json.loads(result.stdout)["area_mm2"], rel=1e-9)
    out = ["-o", str(tmp_path / "none.svg")]
    for bad, sentence in (
        (["combine", a, "intersection", b, "--at", "100,0", *out], "nothing is left"),
        (["combine", a, "union", b, "--at", "1;0", *out], "--at must be two numbers"),
        (["combine", a, "union", b], "nothing to write"),
        (["combine", a, "union", b, "-o", str(tmp_path / "none.png")], "a preview needs the picture"),
        (["combine", a, "union", str(tmp_path / "absent.json"), *out], "no program file"),
    ):
        result = run(app, bad)
        assert result.exit_code == 2
        assert sentence in result.stderr
    assert not list(tmp_path.glob("none.*"))
