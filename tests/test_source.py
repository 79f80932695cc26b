"""Editable source: executed, measured, changed by its parameters, and laid out as by hand."""

from __future__ import annotations

import ast
import re
import runpy
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from math import atan, pi, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad import __version__, exporters
from d4cad.errors import ExportError, GeometryError, InputError
from d4cad.exporters import occ
from d4cad.exporters.source import DIALECTS, PYTHON, source, write_source
from d4cad.exporters.source.words import number, plain, ranges
from d4cad.features import Feature, Rectangle, RegularPolygon, RoundedRectangle, Slot
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

ROOT = Path(__file__).parent.parent
Q = tan(pi / 8)
LIBRARY = {"build123d": "build123d", "build123d-algebra": "build123d", "cadquery": "cadquery"}


def library(dialect: str) -> Any:
    return pytest.param(
        dialect, marks=pytest.mark.skipif(find_spec(LIBRARY[dialect]) is None, reason=f"needs {LIBRARY[dialect]}")
    )


python = pytest.mark.parametrize("dialect", [library(dialect) for dialect in PYTHON])
needs_cadquery = pytest.mark.skipif(find_spec("cadquery") is None, reason="needs cadquery")


def plate() -> Sketch:
    """60 x 40 mm: four bolt holes and a larger one, a slot, a hexagon, and two cutouts of edges."""
    outline = Loop(
        ((4, 0), (60, 0), (60, 34), (54, 40), (40, 40), (20, 40), (0, 40), (0, 4)), (0, 0, Q, 0, -0.5, 0, 0, Q)
    )
    bolts = [Circle((x, y), 2.1).loop() for x, y in ((6, 6), (54, 6), (6, 20), (54, 20))]
    keyhole = Loop(((28, 5.0), (30, 5.0), (30, 9.0), (28, 9.0)), (0, 0.4, 0, 2.0))
    cutout = Loop.polyline([(40, 10), (48, 10), (48, 14), (44, 14), (44, 18), (40, 18)])
    named: list[Feature] = [Slot((15, 12), 12, 5, pi / 6), RegularPolygon((15, 26), 4, 6, 0.3), Circle((46, 28), 4)]
    return Sketch.from_loops([outline, *bolts, keyhole, cutout, *(shape.loop() for shape in named)], "mm")


def islands() -> Sketch:
    """A ring of a rounded rectangle with a rounded hole; in it a square with a round hole; beside it two discs."""
    shapes: list[Feature] = [
        RoundedRectangle((20, 15), 40, 30, 4),
        RoundedRectangle((20, 15), 32, 22, 2),
        Rectangle((20, 15), 9, 9, 0.2),
    ]
    discs: list[Feature] = [Circle((20, 15), 3), Circle((50, 10), 5), Circle((50, 22), 5)]
    every = [discs[0], *shapes[::-1], *discs[1:]]
    return Sketch.from_loops([shape.loop() for shape in every], "mm")


def flat_arcs() -> Sketch:
    """Arcs of 2 m to 10 km radius beside lines, and one that a kernel takes for a line."""
    return Sketch.from_loops([Loop(((0, 0), (50, 0), (50, 30), (0, 30)), (0.006, 1e-9, -1.25e-6, 1e-5))], "mm")


def tiny() -> Sketch:
    return plate().scaled(1e-4)


def rounds() -> Sketch:
    """Nothing but a turned slot with a triangle in it, left of and below the origin."""
    return Sketch.from_loops([Slot((-30, -40), 30, 12, 2.0).loop(), RegularPolygon((-30, -40), 4, 3).loop()], "mm")


def bare() -> Sketch:
    """A cutout of edges in an outline of edges: nothing has a name."""
    outer = Loop.polyline([(0, 0), (90, 0), (80, 50), (0, 50)])
    return Sketch.from_loops([outer, Loop(((20, 20), (60, 20), (40, 30)), (0, 0, 0.3))], "mm")


def half() -> Sketch:
    return Sketch.from_loops([Loop(((0, 0), (20, 0)), (0, 1))], "mm")


def disc() -> Sketch:
    return Sketch.from_loops([Circle((3, 4), 5).loop()], "mm")


def generated(seed: int) -> Sketch:
    return generate(np.random.default_rng(seed), (8, 40)[seed % 2]).scaled(40)


SKETCHES: dict[str, Callable[[], Sketch]] = {
    "plate": plate,
    "islands": islands,
    "flat arcs": flat_arcs,
    "tiny": tiny,
    "rounds": rounds,
    "bare": bare,
    "half": half,
    "disc": disc,
    **{f"generated {k}": partial(generated, k) for k in range(4)},
}


def executed(text: str, folder: Path) -> Any:
    """The OCP shape of the script's ``result``, the script run as a file."""
    path = folder / "part_made.py"
    path.write_text(text, encoding="utf-8")
    result = runpy.run_path(str(path))["result"]
    return result.wrapped if hasattr(result, "wrapped") else result.val().wrapped


def changed(text: str, **values: float) -> str:
    """The script with parameters assigned other values, each found exactly once at its top level."""
    for name, value in values.items():
        text, found = re.subn(rf"^{name} = \S+", f"{name} = {value}", text, flags=re.MULTILINE)
        assert found == 1
    return text


def moments(shape: Any) -> list[float]:
    properties = import_module("OCP.GProp").GProp_GProps()
    import_module("OCP.BRepGProp").BRepGProp.VolumeProperties_s(shape, properties)
    point = properties.CentreOfMass()
    return [point.X(), point.Y(), point.Z()]


def census(shape: Any) -> dict[str, int]:
    """How many edges of each kind of curve, and how many solids and faces."""
    kinds, topods = import_module("OCP.TopAbs").TopAbs_ShapeEnum, import_module("OCP.TopoDS")
    cast = getattr(topods, "TopoDS", topods)
    to_edge = getattr(cast, "Edge_s", None) or cast.Edge
    found: dict[str, int] = {}
    for kind in ("SOLID", "FACE", "EDGE"):
        explorer = import_module("OCP.TopExp").TopExp_Explorer(shape, getattr(kinds, f"TopAbs_{kind}"))
        while explorer.More():
            name = kind
            if kind == "EDGE":
                curve = import_module("OCP.BRepAdaptor").BRepAdaptor_Curve(to_edge(explorer.Current()))
                name = str(curve.GetType()).rpartition("_")[2]
            found[name] = found.get(name, 0) + 1
            explorer.Next()
    return found


@python
@pytest.mark.parametrize("name", SKETCHES)
def test_executed_it_is_the_same_solid(name: str, dialect: str, tmp_path: Path) -> None:
    sketch = SKETCHES[name]()
    truth = occ.compound(occ.solids(sketch, 3.0))
    shape = executed(source(sketch, dialect=dialect, thickness=3.0, name=name), tmp_path)
    assert occ.is_valid(shape)
    assert occ.volume(shape) == pytest.approx(occ.volume(truth), rel=1e-9)
    assert occ.volume(shape) == pytest.approx(3 * sketch.area, rel=1e-8)  # a line for the arc of 1e-9 included
    xmin, _, xmax, _ = sketch.bounds
    assert moments(shape) == pytest.approx(moments(truth), abs=1e-8 * (xmax - xmin) + 1e-12)
    assert census(shape) == census(truth)


@python
def test_parameters_do_as_their_names_say(dialect: str, tmp_path: Path) -> None:
    text = source(plate(), dialect=dialect, thickness=3.0)
    area = plate().area

    def volume(**values: float) -> float:
        return occ.volume(executed(changed(text, **values), tmp_path))

    assert volume(thickness=6) == pytest.approx(6 * area, rel=1e-9)
    assert volume(scale=2.5) == pytest.approx(3 * 2.5**2 * area, rel=1e-9)
    assert volume(hole_diameter=5) == pytest.approx(3 * (area - 4 * pi / 4 * (5**2 - 4.2**2)), rel=1e-9)
    assert volume(hole_9_diameter=6) == pytest.approx(3 * (area - pi / 4 * (6**2 - 8**2)), rel=1e-9)
    assert volume(hole_7_length=14) == pytest.approx(3 * (area - 2 * 5), rel=1e-9)
    assert volume(hole_7_angle=90) == pytest.approx(3 * area, rel=1e-9)
    assert volume(hole_8_radius=2) == pytest.approx(3 * (area + 1.5 * 3**0.5 * (4**2 - 2**2)), rel=1e-9)


@python
def test_places_and_sizes_of_named_outlines(dialect: str, tmp_path: Path) -> None:
    sketch = islands()
    text = source(sketch, dialect=dialect, thickness=1.0)

    def measured(**values: float) -> Any:
        return executed(changed(text, **values), tmp_path)

    assert occ.volume(measured(outer_diameter=8)) == pytest.approx(sketch.area - 2 * pi * (25 - 16), rel=1e-9)
    assert occ.volume(measured(outer_1_radius=5)) == pytest.approx(sketch.area - (4 - pi) * (25 - 16), rel=1e-9)
    assert occ.volume(measured(outer_1_width=44)) == pytest.approx(sketch.area + 4 * 30, rel=1e-9)
    moved = executed(re.sub(r"outer_2_center = .*", "outer_2_center = (20, 19)", text), tmp_path)
    discs = re.findall(r"^(outer_\d)_center = \(50, 10\)", text, flags=re.MULTILINE)
    assert len(discs) == 1
    assert occ.volume(moved) > 0


def test_scale_may_be_given(tmp_path: Path) -> None:
    text = source(plate(), dialect="build123d", thickness=2.0, scale=0.5)
    assert "\nscale = 0.5  #" in text
    if find_spec("build123d") is not None:
        assert occ.volume(executed(text, tmp_path)) == pytest.approx(plate().area / 4 * 2, rel=1e-9)


@needs_cadquery
@python
def test_cqgi_finds_and_changes_parameters(dialect: str) -> None:
    cqgi = import_module("cadquery.cqgi")
    text = source(plate(), dialect=dialect, thickness=3.0)
    script = text if dialect == "cadquery" else f"{text}\nshow_object(result)\n"
    known = cqgi.parse(script).metadata.parameters
    assert {"thickness", "scale", "hole_diameter", "hole_1_center", "hole_7_length"} <= set(known)
    assert known["hole_diameter"].default_value == 4.2
    for parameters, volume in (({}, 3.0), ({"thickness": 10}, 10.0), ({"scale": 2.0}, 12.0)):
        built = cqgi.parse(script).build(parameters)
        assert built.exception is None
        assert built.success
        (shown,) = built.results
        shape = shown.shape.wrapped if hasattr(shown.shape, "wrapped") else shown.shape.val().wrapped
        assert occ.volume(shape) == pytest.approx(volume * plate().area, rel=1e-9)


@pytest.mark.parametrize("name", SKETCHES)
def test_layout_is_that_of_ruff(name: str, tmp_path: Path) -> None:
    for dialect in PYTHON:
        (tmp_path / f"{dialect.replace('-', '_')}.py").write_text(
            source(SKETCHES[name](), dialect=dialect, thickness=3.0, name=name), encoding="utf-8"
        )
    for command in (["format", "--check"], ["check", "--select", "E4,E7,E9,F,W,I,UP,B,PIE"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--isolated", "--no-cache", str(tmp_path)],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("dialect", DIALECTS)
def test_text(dialect: str) -> None:
    sketch = plate()
    text = source(sketch, dialect=dialect, thickness=3, name="plate.png")
    assert text == source(plate(), dialect=dialect, thickness=3.0, name="plate.png")
    assert f"Made by d4cad {__version__} from plate.png: 21 lines, 7 arcs and 5 full circles." in text.splitlines()[0]
    assert text.endswith("\n")
    assert not text.endswith("\n\n")
    assert all(line == line.rstrip() for line in text.splitlines())
    mark = "//" if dialect == "openscad" else "#"
    for comment in (
        "outer 1: contour, 60 x 40 mm at (30, 20), 5 lines and 3 arcs",
        "hole 5: contour, 6.8 x 5 mm at (27.4, 7), 2 lines and 2 arcs",
        "hole 7: slot, 12 x 5 mm at (15, 12), 2 lines and 2 arcs",
    ):
        assert f"{mark} {comment}\n" in text
    assert not re.search(r"-0[,)\]]", text)
    assert not re.search(r"\d\.\d{10,}", text.replace("0.414213562373", ""))


def test_numbers_and_words() -> None:
    assert [number(x, 9) for x in (2.0, -0.0, -1e-12, 0.1 + 0.2, 1 / 3, -7.25)] == [
        *("2", "0", "0", "0.3", "0.333333333", "-7.25")
    ]
    assert ranges([4]) == "4"
    assert ranges([1, 2, 4, 5, 6, 9]) == "1, 2, 4 to 6 and 9"


def test_sizes_that_are_equal_share_a_parameter() -> None:
    circles = [Circle((10.0 * k, 0), r).loop() for k, r in enumerate((2, 2 + 1e-6, 3, 3, 3.1, 2), 1)]
    frame = Loop.polyline([(0, -10), (80, -10), (80, 10), (0, 10)])
    text = source(Sketch.from_loops([frame, *circles], "mm"), thickness=1.0)
    assert re.findall(r"^(\w+_diameter) = (\S+)(.*)", text, flags=re.MULTILINE) == [
        ("hole_1_diameter", "4.000000667", "  # of holes 1, 2 and 6"),
        ("hole_3_diameter", "6.0", "  # of holes 3 and 4"),
        ("hole_5_diameter", "6.2", ""),
    ]


NAMES = (
    'a"""\nimport os\n"""',
    "coding: latin-1\\",
    "# x\r\nimport os #",
    "tail'",
    'tail"',
    "\\",
    "\u202eevil\u2028line\x00\x0c\ud800",
    "über café 東京.png",
    "*/ // x */",
    "{name!r} %s {{",
    "",
)


@pytest.mark.parametrize("name", NAMES)
def test_a_name_stays_in_its_comment(name: str) -> None:
    harmless = [source(disc(), dialect=dialect, thickness=1.0, name="x") for dialect in DIALECTS]
    for dialect, expected in zip(DIALECTS, harmless, strict=True):
        text = source(disc(), dialect=dialect, thickness=1.0, name=name)
        assert text.splitlines()[1:] == expected.splitlines()[1:]
        text.encode("utf-8")
        if dialect != "openscad":
            ours, theirs = ast.parse(text.encode("utf-8")), ast.parse(expected)
            assert ast.dump(ast.Module(ours.body[1:], [])) == ast.dump(ast.Module(theirs.body[1:], []))
            assert plain(name) in str(ast.get_docstring(ours))


@given(st.text(max_size=200))
def test_any_name(name: str) -> None:
    kept = plain(name)
    assert len(kept) <= 80
    assert kept.isprintable()
    assert not set(kept) & {'"', "\\"}
    compile(f'"""Made from {kept}: x."""\n', "x", "exec")


@settings(max_examples=60)
@given(st.lists(st.floats(0.05, 1.0), min_size=4, max_size=9), st.data())
def test_facets_and_coordinates_are_the_sketch(reach: list[float], data: st.DataObject) -> None:
    """The OpenSCAD polygon, evaluated here: vertices to 9 decimals, every facet within the tolerance of the arc."""
    n = len(reach)
    z = [30 * r * np.exp(2j * pi * k / n) for k, r in enumerate(reach)]
    bulges = data.draw(st.lists(st.sampled_from([0.0, 0.0, 0.05, -0.03, 0.2]), min_size=n, max_size=n))
    loop = Loop(tuple((float(p.real), float(p.imag)) for p in z), tuple(bulges))
    try:
        sketch = Sketch.from_loops([loop], "mm")
    except GeometryError:
        return
    text = source(sketch, dialect="openscad", thickness=1.0, tolerance=0.01)
    if "contour," not in text:
        return  # it has a name
    (polygon,) = polygons(text, 0.01)
    area = sum(a[0] * b[1] - a[1] * b[0] for a, b in pairwise([*polygon, polygon[0]])) / 2
    assert area == pytest.approx(sketch.area, abs=0.01 * loop.length)
    assert len(polygon) >= len(loop.points)
    for point in loop.points:
        assert min(np.hypot(point[0] - x, point[1] - y) for x, y in polygon) < 1e-8


VECTOR = r"\[(-?[\d.e-]+), (-?[\d.e-]+)\]"
POINTS = re.compile(rf"arc\({VECTOR}, {VECTOR}, (-?[\d.e-]+)\)|{VECTOR}")
"""A call of arc, or a point by itself."""


def polygons(text: str, tolerance: float) -> list[list[tuple[float, float]]]:
    """The points of each `polygon` of an OpenSCAD script of scale 1, by our own reading of it."""
    found = []
    for body in re.findall(r"polygon\((.*?)\);", text, flags=re.DOTALL):
        points: list[tuple[float, float]] = []
        for match in POINTS.finditer(body):
            if match[5] is None:
                points.append((float(match[6]), float(match[7])))
                continue
            x0, y0, x1, y1, bulge = (float(match[k]) for k in range(1, 6))
            p0, chord = complex(x0, y0), complex(x1 - x0, y1 - y0)
            center = p0 + chord / 2 + (1 - bulge**2) / (4 * bulge) * chord * 1j
            radius = abs(p0 - center)
            facets = 4 * np.ceil(pi / 4 / np.arccos(1 - min(tolerance / radius, 0.29)))
            n = int(np.ceil(facets * 4 * atan(abs(bulge)) / (2 * pi)))
            assert radius * (1 - np.cos(2 * atan(abs(bulge)) / n)) <= tolerance
            turned = [center + (p0 - center) * np.exp(4j * atan(bulge) * k / n) for k in range(n)]
            points += [(float(p.real), float(p.imag)) for p in turned]
        found.append(points)
    return found


@pytest.mark.skipif(shutil.which("openscad") is None, reason="needs the openscad program")
@pytest.mark.parametrize("name", ["plate", "islands", "rounds", "disc", "generated 1"])
def test_openscad_makes_the_same_solid(name: str, tmp_path: Path) -> None:
    sketch = SKETCHES[name]()
    for scale in (1.0, 3.0):
        path = tmp_path / "part.scad"
        write_source(sketch, path, dialect="openscad", thickness=3.0, scale=scale, tolerance=0.001)
        subprocess.run(["openscad", "-o", "part.stl", "part.scad"], cwd=tmp_path, check=True, capture_output=True)
        mesh = trimesh.load(tmp_path / "part.stl")
        assert mesh.is_watertight
        assert len(mesh.split()) == len(sketch.faces)
        area = sketch.area * scale**2
        assert mesh.volume == pytest.approx(3 * area, abs=3 * 0.001 * scale * sketch.length + 1e-5 * area)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_page_shows_what_is_written(dialect: str) -> None:
    outline = Loop(((5, 0), (50, 0), (50, 15), (35, 30), (0, 30), (0, 5)), (0, 0, Q, 0, 0, Q))
    openings: list[Feature] = [Circle((8, 8), 2.1), Circle((42, 8), 2.1), Slot((20, 20), 16, 6, pi / 6)]
    sketch = Sketch.from_loops([outline, *(opening.loop() for opening in openings)], "mm")
    page = (ROOT / "docs" / "editable-source.md").read_text(encoding="utf-8")
    (shown,) = re.findall(rf"^## {dialect}\n\n```\w+\n(.*?)```$", page, flags=re.MULTILINE | re.DOTALL)
    text = source(sketch, dialect=dialect, thickness=3.0, name="bracket.png")
    assert re.sub(r"d4cad [\d.]+", "d4cad", shown) == re.sub(r"d4cad [\d.]+", "d4cad", text)


@pytest.mark.parametrize("extension", [".py", ".scad"])
def test_files(extension: str, tmp_path: Path) -> None:
    path = tmp_path / f"part{extension}"
    exporters.write(plate(), path, thickness=4, name="plate.png")
    assert "from plate.png: 21 lines" in path.read_text(encoding="utf-8")
    assert re.search(r"^thickness = 4", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    exporters.write(plate(), path, thickness=4)
    assert "from part: 21 lines" in path.read_text(encoding="utf-8")
    assert list(tmp_path.iterdir()) == [path]


def test_bad_input(tmp_path: Path) -> None:
    path = tmp_path / "part.py"
    known = "known are build123d, build123d-algebra, cadquery, openscad"
    with pytest.raises(InputError, match=f"unknown dialect 'x': {known}"):
        source(plate(), dialect="x", thickness=1.0)
    with pytest.raises(InputError, match="unknown dialect 'x'"):
        exporters.Options(dialect="x")
    with pytest.raises(InputError, match=r"a \.py file cannot be in the dialect openscad, only in build123d"):
        exporters.write(plate(), path, thickness=1.0, dialect="openscad")
    for thickness in (0.0, -1.0, float("nan"), None):
        with pytest.raises(InputError, match="positive, finite thickness"):
            exporters.write(plate(), path, thickness=thickness)
    with pytest.raises(InputError, match="in mm but this sketch is in 'world' units"):
        source(Sketch.from_loops([Circle((0, 0), 1).loop()]), thickness=1.0)
    with pytest.raises(InputError, match="empty sketch"):
        source(Sketch((), "mm"), thickness=1.0)
    for scale in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(GeometryError, match="scale of a sketch must be positive"):
            source(plate(), thickness=1.0, scale=scale)
    with pytest.raises(InputError, match=r"must be from 0\.0001 to 1e\+07 mm"):
        source(plate(), thickness=1.0, scale=1e-7)
    with pytest.raises(InputError, match="chord tolerance of a mesh must be positive"):
        source(plate(), dialect="openscad", thickness=1.0, tolerance=0.0)
    with pytest.raises(ExportError, match="cannot write"):
        write_source(plate(), tmp_path / "nowhere" / "part.py", thickness=1.0)
    assert list(tmp_path.iterdir()) == []
