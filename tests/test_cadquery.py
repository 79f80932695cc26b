"""CadQuery sketches: measured, placed, and exchanged with build123d."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d4cad.errors import InputError
from d4cad.exporters import write
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

pytestmark = pytest.mark.kernel

cq: Any = pytest.importorskip("cadquery", reason="CadQuery is not installed")
ours: Any = import_module("d4cad.exporters.cadquery")


def shape(seed: int) -> Sketch:
    """A generated part of some 60 mm."""
    return generate(np.random.default_rng(100 + seed), (8, 20, 40)[seed % 3]).scaled(30.0)


def washers() -> Sketch:
    """Two washers, an island in one of them: 3 faces, 5 circles."""
    circles = [Circle((x, 0.0), r).loop() for x, r in ((0, 5), (0, 4), (0, 1), (11, 5), (11, 2))]
    return Sketch.from_loops(circles, "mm")


def square() -> Sketch:
    """10 x 10 mm from the origin."""
    return Sketch.from_loops([Loop.polyline([(0, 0), (10, 0), (10, 10), (0, 10)])], "mm")


@pytest.mark.parametrize("seed", range(12))
def test_extruded_shapes_are_valid_and_exact(seed: int) -> None:
    sketch = shape(seed)
    made = ours.to_cadquery(sketch)
    assert type(made) is cq.Sketch
    faces = list(made)
    assert len(faces) == len(sketch.faces)
    assert {edge.geomType() for face in faces for edge in face.Edges()} <= {"LINE", "CIRCLE"}
    part = cq.Workplane().placeSketch(made).extrude(4.0)
    assert part.val().isValid()
    assert part.val().Volume() == pytest.approx(4 * sketch.area, rel=1e-9)
    assert part.solids().size() == len(sketch.faces)
    found = part.val().BoundingBox()
    assert (found.zmin, found.zmax) == pytest.approx((0, 4), abs=1e-6)
    assert (found.xmin, found.ymin, found.xmax, found.ymax) == pytest.approx(sketch.bounds, abs=1e-6)


def test_a_full_circle_is_one_edge_and_its_wall_one_cylinder() -> None:
    made = ours.to_cadquery(washers())
    assert [edge.geomType() for face in made for edge in face.Edges()] == ["CIRCLE"] * 5
    part = cq.Workplane().placeSketch(made).extrude(1)
    assert part.faces("%CYLINDER").size() == 5
    assert part.faces("%PLANE").size() == 6


def test_place_sketch_at_several_points_of_several_planes() -> None:
    sketch = shape(4)
    made = ours.to_cadquery(sketch)
    spread = cq.Workplane("XZ").rarray(90, 80, 2, 2).placeSketch(made).extrude(2)
    assert spread.solids().size() == 4 * len(sketch.faces)
    assert spread.val().Volume() == pytest.approx(8 * sketch.area, rel=1e-9)
    plate = cq.Workplane().box(300, 300, 10)
    pocketed = plate.faces(">Z").workplane().pushPoints([(-70, 0), (70, 10)]).placeSketch(made).cutBlind(-2)
    assert pocketed.val().isValid()
    assert pocketed.val().Volume() == pytest.approx(9e5 - 4 * sketch.area, rel=1e-12)
    raised = plate.faces(">Z").workplane().placeSketch(made.moved(cq.Location(5, 0, 0))).extrude(2)
    assert raised.val().Volume() == pytest.approx(9e5 + 2 * sketch.area, rel=1e-12)


def test_it_goes_on_as_a_sketch() -> None:
    made = ours.to_cadquery(square()).vertices().fillet(2).reset().push([(5, 5)]).circle(1, mode="s")
    part = cq.Workplane().placeSketch(made).extrude(1)
    assert part.val().Volume() == pytest.approx(100 - (4 - pi) * 4 - pi)


def test_what_cannot_be_used_is_told_in_one_sentence(tmp_path: Path) -> None:
    for part, message in (
        (Sketch(square().faces), "in 'world' units"),
        (Sketch((), "mm"), "no faces"),
        (tmp_path / "missing.json", "there is no program file"),
    ):
        with pytest.raises(InputError, match=message):
            ours.to_cadquery(part)


def test_without_cadquery_one_sentence_says_what_to_install() -> None:
    for module in ("d4cad.exporters.cadquery", "d4cad.cadquery"):
        code = f"import sys; sys.modules['cadquery'] = None; import {module}"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        assert done.returncode == 1
        assert done.stderr.strip().splitlines()[-1] == (
            "d4cad.errors.ExportError: d4cad.exporters.cadquery needs cadquery: pip install 'd4cad[cadquery]'"
        )


@pytest.mark.parametrize("seed", [0, 4, 8])
def test_shapes_cross_to_build123d_and_back(seed: int) -> None:
    bd: Any = pytest.importorskip("build123d", reason="build123d is not installed")
    theirs: Any = import_module("d4cad.exporters.build123d")
    sketch = shape(seed)
    part = bd.extrude(theirs.to_build123d(sketch), 3)
    there = cq.Workplane(obj=cq.Shape.cast(part.wrapped))
    assert there.val().isValid()
    assert there.val().Volume() == pytest.approx(3 * sketch.area, rel=1e-9)
    solids = cq.Workplane().placeSketch(ours.to_cadquery(sketch)).extrude(3).solids().vals()
    back = [bd.Solid(solid.wrapped) for solid in solids]
    assert sum(solid.volume for solid in back) == pytest.approx(3 * sketch.area, rel=1e-9)
    faces = [bd.Face(face.wrapped) for face in ours.to_cadquery(sketch)]
    assert sum(face.area for face in faces) == pytest.approx(sketch.area, rel=1e-9)


def test_step_of_each_is_read_by_the_other(tmp_path: Path) -> None:
    bd: Any = pytest.importorskip("build123d", reason="build123d is not installed")
    theirs: Any = import_module("d4cad.exporters.build123d")
    sketch = shape(5)
    bd.export_step(bd.extrude(theirs.to_build123d(sketch), 3), tmp_path / "b.step")
    cq.exporters.export(cq.Workplane().placeSketch(ours.to_cadquery(sketch)).extrude(3), str(tmp_path / "c.step"))
    write(sketch, tmp_path / "d.step", thickness=3)
    for name in "bcd":
        path = str(tmp_path / f"{name}.step")
        assert bd.import_step(path).volume == pytest.approx(3 * sketch.area, rel=1e-8)
        assert sum(s.Volume() for s in cq.importers.importStep(path).vals()) == pytest.approx(3 * sketch.area, rel=1e-8)
