"""What regularisation has found, as parameters of editable source: changed, they change the part as their names say."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from math import cos, hypot, pi, sin, tan
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.exporters import occ
from d4cad.exporters.source import DIALECTS, PYTHON, source
from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.words import contours
from d4cad.fitting import fit_image
from d4cad.placement import Placement
from d4cad.regularize.naming import named_dimensions
from d4cad.relations import Dimension, Ref, Relation
from d4cad.sketch import Circle, Loop, Sketch

ROOT = Path(__file__).parent.parent
Q = tan(pi / 8)
LIBRARY = {"build123d": "build123d", "build123d-algebra": "build123d", "cadquery": "cadquery"}


def dialects(names: Iterable[str]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(
        "dialect",
        [
            pytest.param(
                name, marks=pytest.mark.skipif(find_spec(LIBRARY[name]) is None, reason=f"needs {LIBRARY[name]}")
            )
            if name in LIBRARY
            else name
            for name in names
        ],
    )


def related(loops: list[Loop], relations: list[Relation]) -> Sketch:
    sketch = replace(Sketch.from_loops(loops, "mm"), relations=tuple(relations))
    return replace(sketch, dimensions=named_dimensions(sketch))


def each(kind: str, *edges: int, loop: int = 0) -> list[Relation]:
    return [Relation(kind, ((loop, edge),)) for edge in edges]


def pairs(kind: str, *refs: tuple[Ref, Ref], value: float | None = None) -> list[Relation]:
    return [Relation(kind, ref, value) for ref in refs]


def plate() -> Sketch:
    """100 x 60 mm: a step, two fillets, a chamfer, an open slot from above, four bolt holes, and one about a fillet."""
    outline = Loop(
        (
            *((8.0, 0.0), (80.0, 0.0), (80.0, 20.0), (100.0, 20.0), (100.0, 50.0), (90.0, 60.0), (60.0, 60.0)),
            *((60.0, 45.0), (50.0, 45.0), (50.0, 60.0), (10.0, 60.0), (0.0, 50.0), (0.0, 8.0)),
        ),
        (0, 0, 0, 0, Q, 0, 0, -1, 0, 0, Q, 0, 0),
    )
    holes = [Circle(center, 2.5).loop() for center in ((20.0, 20.0), (70.0, 20.0), (20.0, 30.0), (70.0, 30.0))]
    return related(
        [outline, *holes, Circle((10.0, 50.0), 4.0).loop()],
        [
            *(Relation("width", (), 100.0), Relation("height", (), 60.0)),
            *each("horizontal", 0, 2, 5, 9),
            *each("vertical", 1, 3, 6, 8, 11),
            *pairs("horizontal", ((1, 0), (2, 0)), ((3, 0), (4, 0))),
            *pairs("vertical", ((1, 0), (3, 0)), ((2, 0), (4, 0))),
            *pairs("tangent", *(((0, k), (0, k + 1)) for k in (3, 4, 6, 7, 9, 10))),
            *pairs("equal_radius", ((0, 4), (0, 10)), ((1, 0), (2, 0)), ((2, 0), (3, 0)), ((2, 0), (4, 0))),
            *pairs("concentric", ((0, 10), (5, 0))),
            Relation("radius", ((0, 4),), 10.0),
            Relation("distance", ((1, 0), (2, 0)), 50.0),
        ],
    )


def frame() -> Sketch:
    """A contour whose length and distance of two lines are given, with a round notch and a slanted side."""
    outline = Loop(((0, 0), (40, 0), (40, 12), (25, 12), (25, 30), (10, 30)), (0, 0, 0, 0, 0, 0.25))
    notch = Loop(((12, 5), (16, 5), (16, 9), (12, 9)), (0.5, 0, 0, 0))
    return related(
        [outline, notch],
        [
            *each("horizontal", 0, 2, 4),
            *each("vertical", 1, 3),
            *each("horizontal", 1, loop=1),
            *each("vertical", 0, 2, loop=1),
            *pairs("parallel", ((0, 0), (1, 1))),
            Relation("length", ((0, 2),), 15.0),
            Relation("length", ((0, 4),), 15.0),
            Relation("distance", ((0, 0), (0, 2)), 12.0),
        ],
    )


def flange() -> Sketch:
    """A disc with five holes evenly about its centre, one of which has a boss with a bore in it."""
    turns = [2 * pi * k / 5 + pi / 2 for k in range(5)]
    holes = [Circle((30 + 20 * cos(turn), 25 + 20 * sin(turn)), 3.0).loop() for turn in turns]
    return related(
        [Circle((30.0, 25.0), 28.0).loop(), *holes, Circle((30.0, 25.0), 8.0).loop(), Circle((30.0, 45.0), 1.0).loop()],
        [
            Relation("polar", tuple((k, 0) for k in range(1, 6))),
            *pairs("equal_radius", *(((k, 0), (k + 1, 0)) for k in range(1, 5))),
            *pairs("concentric", ((0, 0), (6, 0)), ((1, 0), (7, 0))),
            *pairs("horizontal", ((2, 0), (5, 0)), ((3, 0), (4, 0))),
        ],
    )


def tab() -> Sketch:
    """A tab with a round end and a hole about it; a corner is cut out by a circle about it."""
    outline = Loop(((0, 0), (20, 0), (20, 12), (4, 12), (0, 8)), (0, 1, 0, -Q, 0))
    return related(
        [outline, Circle((20.0, 6.0), 2.0).loop()],
        [
            *each("horizontal", 0, 2),
            *each("vertical", 4),
            *pairs("tangent", ((0, 0), (0, 1)), ((0, 1), (0, 2))),
            *pairs("concentric", ((0, 1), (1, 0))),
            Relation("radius", ((0, 1),), 6.0),
        ],
    )


SKETCHES: dict[str, Callable[[], Sketch]] = {"plate": plate, "frame": frame, "flange": flange, "tab": tab}


def assigned(text: str) -> list[str]:
    """The names that are assigned above the part."""
    return re.findall(r"^(\w+) = ", re.split(r"^(?:def at|linear_extrude)", text, flags=re.MULTILINE)[0], re.MULTILINE)


def changed(text: str, values: Mapping[str, float]) -> str:
    for name, value in values.items():
        text, found = re.subn(rf"^{name} = [-\d.]+", f"{name} = {value}", text, flags=re.MULTILINE)
        assert found == 1, name
    return text


def area(text: str, dialect: str, folder: Path) -> float:
    """Of the part that a script makes, 3 mm thick."""
    if dialect == "openscad":
        return read_openscad(text)
    path = folder / "part_made.py"
    path.write_text(text, encoding="utf-8")
    result = runpy.run_path(str(path))["result"]
    shape = result.wrapped if hasattr(result, "wrapped") else result.val().wrapped
    assert occ.is_valid(shape)
    return float(occ.volume(shape)) / 3


def read_openscad(text: str) -> float:
    """By our own reading of what OpenSCAD would do with exact arcs: outer contours less holes."""
    known: dict[str, Any] = {"arc": lambda start, _, bulge: [(*start, bulge)]}
    for name, formula in re.findall(r"^(\w+) = (.*?);", text, flags=re.MULTILINE):
        known[name] = eval(formula, {}, known)
    total = 0.0
    for role, body in re.findall(r"^module (\w+)_\d+\(\) \{\n(.*?)^\}", text, flags=re.MULTILINE | re.DOTALL):
        diameter = re.search(r"circle\(d = (\w+),", body)
        if diameter:
            size = pi / 4 * known[diameter[1]] ** 2
        else:
            (points,) = re.findall(r"polygon\((?:concat\()?(.*?)\)?\);", body, flags=re.DOTALL)
            found = eval(f"({points},)", {}, known)
            corners = [point for part in found for point in part]
            loop = Loop(
                tuple((float(x), float(y)) for x, y, *_ in corners),
                tuple(float(bulge[0]) if bulge else 0.0 for _, _, *bulge in corners),
            )
            size = abs(loop.area)
        total += size if role == "outer" else -size
    return total


@dialects(DIALECTS)
@pytest.mark.parametrize("name", SKETCHES)
def test_executed_it_is_the_same_part(name: str, dialect: str, tmp_path: Path) -> None:
    sketch = SKETCHES[name]()
    text = source(sketch, dialect=dialect, thickness=3.0)
    assert area(text, dialect, tmp_path) == pytest.approx(sketch.area, rel=1e-9)


def test_names() -> None:
    text = source(plate(), thickness=3.0)
    assert assigned(text) == [
        *("thickness", "scale", "left", "width", "bottom", "height", "x_1", "x_3", "y_1", "y_2", "corner_radius"),
        *("chamfer", "end_radius", "hole_x_1", "hole_y_1", "hole_y_2", "distance", "hole_diameter", "hole_5_diameter"),
        *("right", "top", "x_2", "hole_x_2"),
    ]
    assert "\nright = left + width\ntop = bottom + height\n" in text
    assert "\nhole_x_2 = hole_x_1 + distance  # of holes 2 and 4\n" in text
    assert "at(left + corner_radius, top - corner_radius)" in text  # the hole about the fillet
    assert "    # 4 horizontal, 5 vertical, 6 tangent and 1 equal radius\n" in text
    assert "\n# outer 1 and hole 5: concentric\n" in text
    assert "def middle(" not in text
    assert "def middle(" in source(frame(), thickness=3.0)
    assert "\nlength = 15.0  # of the sides at y_2 and top\ndistance = 12.0  # from bottom to y_2\n" in source(
        frame(), thickness=3.0
    )
    assert "# outer 1 and hole 1: parallel" in source(frame(), thickness=3.0)


PLATE: dict[str, tuple[float, float]] = {
    "thickness": (3, 0),
    "corner_radius": (12, -2 * (1 - pi / 4) * (12**2 - 10**2)),
    "chamfer": (6, (8**2 - 6**2) / 2),
    "width": (110, 10 * 40),
    "height": (70, 10 * 90),
    "left": (-5, 5 * 60 - 5 * 40),
    "bottom": (2, -2 * 80 + 2 * 90),  # the top moves with it
    "x_3": (75, -5 * 20),
    "y_1": (25, -5 * 20),
    "y_2": (40, -5 * 10),
    "x_1": (45, 0),
    "end_radius": (6, -(2 * 15 + pi / 2 * (6**2 - 5**2))),
    "distance": (52, 0),
    "hole_diameter": (6, -4 * pi / 4 * (6**2 - 5**2)),
    "hole_5_diameter": (6, pi / 4 * (8**2 - 6**2)),
}


@dialects(DIALECTS)
def test_parameters_do_as_their_names_say(dialect: str, tmp_path: Path) -> None:
    text = source(plate(), dialect=dialect, thickness=3.0)
    for name, (value, more) in PLATE.items():
        made = area(changed(text, {name: value}), dialect, tmp_path)
        assert made == pytest.approx(plate().area + more, rel=1e-9), name
    together = {"corner_radius": 4, "width": 120, "y_1": 10}
    more = 2 * (1 - pi / 4) * (10**2 - 4**2) + 20 * 40 + 40 * 10
    assert area(changed(text, together), dialect, tmp_path) == pytest.approx(plate().area + more, rel=1e-9)


@dialects(DIALECTS)
def test_a_length_and_a_distance(dialect: str, tmp_path: Path) -> None:
    text = source(frame(), dialect=dialect, thickness=3.0)
    assert "x_3 = right - length" in text
    assert area(changed(text, {"distance": 10}), dialect, tmp_path) == pytest.approx(frame().area - 2 * 15, rel=1e-9)
    deeper = area(changed(text, {"y_1": 10}), dialect, tmp_path)  # the notch
    assert deeper == pytest.approx(frame().area - 4, rel=1e-9)
    shorter = area(changed(text, {"length": 14}), dialect, tmp_path)  # both sides; the round one follows with its sweep
    outline = ((0, 0), (40, 0), (40, 12), (26, 12), (26, 30), (12, 30)), (0, 0, 0, 0, 0, 0.25)
    assert shorter == pytest.approx(Loop(*outline).area + frame().loops[1].area, rel=1e-9)


def places(text: str) -> list[tuple[float, float]]:
    """The centres of circles in an OpenSCAD script."""
    known: dict[str, Any] = {}
    for name, formula in re.findall(r"^(\w+) = (.*?);", text, flags=re.MULTILINE):
        known[name] = eval(formula, {}, known)
    return [eval(place, {}, known) for place in re.findall(r"translate\((.*?)\)\n", text)]


def test_a_bolt_circle() -> None:
    text = source(flange(), dialect="openscad", thickness=3.0)
    assert {"bolt_circle_x", "bolt_circle_y", "bolt_circle_radius"} <= set(assigned(text))
    assert not re.search(r"^(hole|outer)_\d_center", text, flags=re.MULTILINE)
    wide = changed(text, {"bolt_circle_radius": 21, "bolt_circle_x": 40})
    for script, x, radius in ((text, 30, 20), (wide, 40, 21)):
        found = sorted(round(hypot(px - x, py - 25), 7) for px, py in places(script))
        assert found == [0, 0, *[radius] * 6]
    assert text.count("[bolt_circle_x, bolt_circle_y + bolt_circle_radius]") == 2  # the hole above, and the boss in it


@dialects(DIALECTS)
def test_a_round_end(dialect: str, tmp_path: Path) -> None:
    text = source(tab(), dialect=dialect, thickness=3.0)
    assert "top = bottom + 2 * end_radius" in text
    if dialect == "openscad":
        assert places(changed(text, {"end_radius": 7})) == [pytest.approx([20, 7])]
    more = 20 * 2 + pi / 2 * (7**2 - 6**2)
    assert area(changed(text, {"end_radius": 7}), dialect, tmp_path) == pytest.approx(tab().area + more, rel=1e-9)
    assert area(changed(text, {"x_1": 23}), dialect, tmp_path) == pytest.approx(tab().area + 3 * 12, rel=1e-9)
    cut = -pi / 4 * (5**2 - 4**2)
    assert area(changed(text, {"arc_radius": 5}), dialect, tmp_path) == pytest.approx(tab().area + cut, rel=1e-9)


@pytest.mark.skipif(find_spec("cadquery") is None, reason="needs cadquery")
@dialects(PYTHON)
def test_cqgi_finds_and_changes_parameters(dialect: str, capsys: pytest.CaptureFixture[str]) -> None:
    cqgi = import_module("cadquery.cqgi")
    text = source(plate(), dialect=dialect, thickness=3.0)
    script = text if dialect == "cadquery" else f"{text}\nshow_object(result)\n"
    known = cqgi.parse(script).metadata.parameters
    assert set(PLATE) <= set(known)
    assert not {"right", "top"} & set(known)  # they follow
    for name in ("width", "corner_radius", "hole_diameter"):
        value, more = PLATE[name]
        built = cqgi.parse(script).build({name: value})
        assert built.exception is None
        shape = built.results[0].shape
        shape = shape.wrapped if hasattr(shape, "wrapped") else shape.val().wrapped
        assert occ.volume(shape) == pytest.approx(3 * (plate().area + more), rel=1e-9)
    assert capsys.readouterr().out == ""  # where it says what it cannot handle


@pytest.mark.parametrize("dialect", DIALECTS)
def test_without_relations_nothing_changes(dialect: str) -> None:
    bare = replace(plate(), relations=(), dimensions=())
    text = source(bare, dialect=dialect, thickness=3.0)
    assert text == source(replace(plate(), relations=()), dialect=dialect, thickness=3.0)
    assert not {"left", "width", "corner_radius", "x_1", "hole_x_1"} & set(assigned(text))
    assert "hole_1_center" in assigned(text)


def test_what_does_not_hold_is_passed_over(tmp_path: Path) -> None:
    sketch = plate()
    wrong = [
        *each("horizontal", 1, 12),
        *each("vertical", 0),
        *pairs("horizontal", ((1, 0), (4, 0))),
        *pairs("concentric", ((0, 4), (1, 0))),
        Relation("tangent", ((0, 12), (0, 0))),
    ]
    odd = (
        Dimension("width", "width", (), 101.0, round=True),
        Dimension("corner_radius", "radius", ((0, 4), (0, 10)), 9.0),
        Dimension("length", "length", ((0, 3),), 31.0, round=True),
    )
    text = source(
        replace(sketch, relations=(*sketch.relations, *wrong), dimensions=odd), dialect="openscad", thickness=3.0
    )
    assert not {"width", "corner_radius", "length"} & set(assigned(text))
    assert area(text, "openscad", tmp_path) == pytest.approx(sketch.area, rel=1e-9)


@pytest.mark.parametrize("name", ["scale", "at", "extrude", "x", "lambda", "ärea_radius", "left", "print"])
def test_no_other_names_than_those_of_regularisation(name: str, tmp_path: Path) -> None:
    sketch = plate()
    dimensions = tuple(replace(d, name=name) if d.name == "corner_radius" else d for d in sketch.dimensions)
    text = source(replace(sketch, dimensions=dimensions), dialect="openscad", thickness=3.0)
    plain = source(replace(sketch, dimensions=tuple(d for d in sketch.dimensions if d.name != "corner_radius")),
                   dialect="openscad", thickness=3.0)  # fmt: skip
    assert text == plain
    assert area(text, "openscad", tmp_path) == pytest.approx(sketch.area, rel=1e-9)


@pytest.mark.parametrize("name", SKETCHES)
def test_layout_is_that_of_ruff(name: str, tmp_path: Path) -> None:
    for dialect in PYTHON:
        text = source(SKETCHES[name](), dialect=dialect, thickness=3.0)
        (tmp_path / f"{dialect.replace('-', '_')}.py").write_text(text, encoding="utf-8")
    for command in (["format", "--check"], ["check", "--select", "E4,E7,E9,F,W,I,UP,B,PIE"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--isolated", "--no-cache", str(tmp_path)],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(("dx", "dy", "scale"), [(0.0, 0.0, 0.01), (-1234.5, 77.25, 1.0), (3.1, -4.7, 25.4)])
def test_any_size_and_place(dx: float, dy: float, scale: float, tmp_path: Path) -> None:
    sketch = plate().translated(dx, dy).scaled(scale)
    text = source(sketch, dialect="openscad", thickness=3.0)
    assert {"width", "corner_radius", "chamfer"} <= set(assigned(text))
    assert area(text, "openscad", tmp_path) == pytest.approx(sketch.area, rel=1e-8)
    wider = area(changed(text, {"width": 110 * scale}), "openscad", tmp_path)
    assert wider == pytest.approx(sketch.area + 400 * scale**2, rel=1e-7)


def test_linear_texts() -> None:
    a, b = Linear.of("a"), Linear.of("b")
    assert str(a - b + Linear(2)) == "a + 2 - b"
    assert str(b.times(-1)) == "-b"
    assert str(a - a) == "0"
    assert str(Linear(-1.5)) == "-1.5"
    assert str((a + b).times(0.5)) == "a / 2 + b / 2"
    assert str(b.times(2) + Linear(1e-13)) == "2 * b"
    assert contours(["outer_1", "hole_4", "hole_2"]) == "outer 1 and holes 2 and 4"


@settings(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from("abc"), st.floats(-3, 3)), max_size=6), st.floats(-9, 9), st.data())
def test_a_text_has_the_value(terms: list[tuple[str, float]], constant: float, data: st.DataObject) -> None:
    total = sum((Linear.of(name, factor) for name, factor in terms), Linear(constant))
    values = {name: data.draw(st.floats(-9, 9)) for name in "abc"}
    assert eval(str(total), {}, values) == pytest.approx(total.value(values), abs=1e-8)
    formula = Linear.of("b", 0.5) + Linear(1)
    known = values | {"a": formula.value(values)}
    assert total.substituted({"a": formula}).value(values) == pytest.approx(total.value(known), abs=1e-9)


def without_digits(text: str) -> str:
    """The last of nine decimals depend on the machine, and so does a size that is only just not round."""
    return re.sub(r"\d+\.\d+", "_", text)


@dialects(["cadquery"])
def test_a_fitted_picture_has_its_sizes_by_name(dialect: str, tmp_path: Path) -> None:
    """The example of the page: the picture's bracket, 79.2 mm wide."""
    fit = fit_image(ROOT / "examples" / "pictures" / "bracket.png", size=Placement(width=79.2))
    sketch = Placement(width=79.2).place(fit.outline, fit.canvas)
    text = source(sketch, dialect=dialect, thickness=3.0)
    page = (ROOT / "docs" / "editable-source.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"^## Relations.*?```python\n(.*?)```", page, flags=re.MULTILINE | re.DOTALL)
    for block in re.split(r"^(?=# outer 1)", shown, flags=re.MULTILINE):
        assert without_digits(block.rstrip()) in without_digits(text)
    assert area(text, dialect, tmp_path) == pytest.approx(sketch.area, rel=1e-8)
    wider = area(changed(text, {"width": 89.2}), dialect, tmp_path)
    (tall,) = (float(y) for y in re.findall(r"^y_1 = ([\d.]+)", text, re.MULTILINE))
    assert wider == pytest.approx(sketch.area + 10 * tall, rel=1e-8)
