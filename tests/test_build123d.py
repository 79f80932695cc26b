"""build123d sketches: measured, placed and combined as build123d's own objects are."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from importlib import import_module
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d4cad import io
from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.shapes import generate
from d4cad.sketch import Circle, Face, Loop, Sketch

pytestmark = pytest.mark.kernel

bd: Any = pytest.importorskip("build123d", reason="build123d is not installed")
ours: Any = import_module("d4cad.exporters.build123d")


def shape(seed: int) -> Sketch:
    """A generated part of some 60 mm."""
    return generate(np.random.default_rng(seed), (8, 20, 40)[seed % 3]).scaled(30.0)


def washers() -> Sketch:
    """Two washers, an island in one of them: 3 faces, 5 circles."""
    circles = [Circle((x, 0.0), r).loop() for x, r in ((0, 5), (0, 4), (0, 1), (11, 5), (11, 2))]
    return Sketch.from_loops(circles, "mm")


def ell() -> Sketch:
    """An L of 30 x 20 mm in the first quadrant, its corner at the origin, 300 mm^2."""
    return Sketch.from_loops([Loop.polyline([(0, 0), (30, 0), (30, 5), (10, 5), (10, 20), (0, 20)])], "mm")


def box(shape: Any) -> list[float]:
    """xmin, ymin, xmax, ymax of a build123d shape."""
    found = shape.bounding_box()
    return [found.min.X, found.min.Y, found.max.X, found.max.Y]


@pytest.mark.parametrize("seed", range(12))
def test_extruded_shapes_are_valid_and_exact(seed: int) -> None:
    sketch = shape(seed)
    made = ours.to_build123d(sketch)
    assert type(made) is bd.Sketch
    assert made.area == pytest.approx(sketch.area, rel=1e-9)
    assert len(made.faces()) == len(sketch.faces)
    assert {edge.geom_type for edge in made.edges()} <= {bd.GeomType.LINE, bd.GeomType.CIRCLE}
    solid = bd.extrude(made, 4.0)
    assert solid.is_valid
    assert solid.volume == pytest.approx(4 * sketch.area, rel=1e-9)
    assert len(solid.solids()) == len(sketch.faces)
    assert abs(solid.bounding_box().min.Z) < 1e-6, "a face looked down"
    assert box(made) == pytest.approx(list(sketch.bounds), abs=1e-6)


def test_a_full_circle_is_one_edge_and_its_wall_one_cylinder() -> None:
    made = ours.to_build123d(washers())
    assert [len(face.inner_wires()) for face in made.faces()] == [1, 0, 1]
    assert [edge.geom_type for edge in made.edges()] == [bd.GeomType.CIRCLE] * 5
    walls = [face for face in bd.extrude(made, 1).faces() if face.geom_type == bd.GeomType.CYLINDER]
    assert len(walls) == 5


def test_neighbouring_edges_share_their_vertex() -> None:
    made = ours.to_build123d(ell())
    assert len(made.vertices()) == len(made.edges()) == 6


def test_wart_a_corner_that_the_kernel_wrongly_calls_a_crossing_is_valid_here_too() -> None:
    loop = Loop(((-34.0, 8.0), (20.0, -40.0), (11.0, -6.0)), (2.2577989835235553e-05, -0.04, 0.0))
    sketch = Sketch.from_loops([loop], "mm")
    made = bd.extrude(ours.to_build123d(sketch), 3)
    assert made.is_valid
    assert made.volume == pytest.approx(3 * sketch.area, rel=1e-4)


def test_in_a_builder_it_is_added_at_every_location() -> None:
    sketch = shape(1)
    with bd.BuildPart() as plates:
        with bd.BuildSketch() as outlines, bd.GridLocations(90, 80, 2, 3):
            ours.ProgramSketch(sketch)
        bd.extrude(amount=2)
    assert len(outlines.sketch.faces()) == 6 * len(sketch.faces)
    assert plates.part.volume == pytest.approx(12 * sketch.area, rel=1e-9)
    assert plates.part.is_valid


def test_modes() -> None:
    with bd.BuildSketch() as cut:
        bd.Rectangle(100, 100)
        ours.ProgramSketch(ell(), mode=bd.Mode.SUBTRACT)
    assert cut.sketch.area == pytest.approx(1e4 - ell().area, rel=1e-12)
    with bd.BuildSketch() as common:
        bd.Rectangle(20, 20)
        ours.ProgramSketch(ell(), mode=bd.Mode.INTERSECT)
    assert common.sketch.area == pytest.approx(100, rel=1e-12)
    with bd.BuildSketch() as private:
        bd.Rectangle(1, 1)
        assert ours.ProgramSketch(ell(), mode=bd.Mode.PRIVATE).area == pytest.approx(ell().area)
    assert private.sketch.area == pytest.approx(1)


def test_algebra_mode() -> None:
    lid = bd.Rectangle(100, 100) - bd.Pos(3, 4) * ours.ProgramSketch(ell())
    assert lid.area == pytest.approx(1e4 - ell().area, rel=1e-12)
    assert (ours.ProgramSketch(ell()) + bd.Pos(-50, 0) * bd.Circle(2)).area == pytest.approx(ell().area + 4 * pi)
    raised = bd.extrude(bd.Plane.XZ * ours.ProgramSketch(ell()), 2)
    assert raised.volume == pytest.approx(2 * ell().area, rel=1e-12)
    assert abs(raised.bounding_box().max.Z - 20) < 1e-6


def test_rotation_is_in_degrees_counter_clockwise() -> None:
    turned = ours.ProgramSketch(ell(), rotation=90)
    assert box(turned) == pytest.approx([-20, 0, 0, 30], abs=1e-6)
    assert ours.ProgramSketch(ell(), 33).area == pytest.approx(ell().area, rel=1e-12)


@pytest.mark.parametrize(
    ("align", "expected"),
    [
        ("none", [0, 0, 30, 20]),
        ("CENTER", [-15, -10, 15, 10]),
        (("MAX", "CENTER"), [-30, -10, 0, 10]),
        (("MIN", "MAX"), [0, -20, 30, 0]),
    ],
)
def test_align(align: str | tuple[str, str], expected: list[float]) -> None:
    """None keeps the sketch's own origin."""
    if align == "none":
        wanted = None
    else:
        wanted = bd.Align[align] if isinstance(align, str) else tuple(bd.Align[a] for a in align)
    made = ours.ProgramSketch(ell(), align=wanted)
    assert box(made) == pytest.approx(expected, abs=1e-6)
    assert box(ours.ProgramSketch(ell().translated(7, 9), align=bd.Align.MIN)) == pytest.approx(
        [0, 0, 30, 20], abs=1e-6
    )


def test_it_belongs_in_a_sketch_builder_only() -> None:
    with bd.BuildLine(), pytest.raises(RuntimeError, match="ProgramSketch applies to"):
        ours.ProgramSketch(ell())


@dataclass(frozen=True)
class Placed:
    """Stands in for a fit: it can give its sketch."""

    outline: Sketch

    def sketch(self) -> Sketch:
        return self.outline


def write_program(path: Path, sketch: Sketch) -> Path:
    """A program file that states a sketch as its outline; its program is of no concern here."""
    canvas = Canvas.square(32)
    file = io.ProgramFile("arc-line", {}, (), canvas, {}, (), "stalled", 50.0, 6, sketch.unit, sketch.to_neutral())
    io.write(path, file)
    return path


def test_fits_and_program_files_are_parts_too(tmp_path: Path) -> None:
    path = write_program(tmp_path / "ell.json", ell())
    for part in (Placed(ell()), path, str(path)):
        assert box(ours.ProgramSketch(part)) == pytest.approx([0, 0, 30, 20], abs=1e-6)
        assert ours.to_build123d(part).area == pytest.approx(ell().area, rel=1e-12)


def test_sketches_are_wrapped_for_viewers() -> None:
    assert bd.Face(ell().wrapped).area == pytest.approx(300)
    assert bd.Compound(washers().wrapped).area == pytest.approx(washers().area)
    assert len(bd.Compound(washers().wrapped).faces()) == 3
    with pytest.raises(InputError, match="in 'world' units"):
        Sketch(ell().faces).wrapped  # noqa: B018


def test_what_cannot_be_used_is_told_in_one_sentence(tmp_path: Path) -> None:
    world = Sketch(ell().faces)
    crossing = Face(Loop.polyline([(0, 0), (9, 0), (0, 9), (7, 9)]))
    bowtie = write_program(tmp_path / "bowtie.json", Sketch((crossing,), "mm"))
    for part, message in (
        (world, "in 'world' units"),
        (Sketch((), "mm"), "no faces"),
        (tmp_path / "missing.json", "there is no program file"),
        (bowtie, r"bowtie\.json is not a usable program file: loop 0 crosses"),
        (write_program(tmp_path / "a.json", world), r"a\.json states no size: use d4cad\.load_program"),
    ):
        with pytest.raises(InputError, match=message):
            ours.ProgramSketch(part)


def told(code: str, path: Path) -> str:
    """The last line that a script of its own process says on standard error; modules in ``path`` come first."""
    head = f"import sys; sys.path.insert(0, {str(path)!r})\n"
    done = subprocess.run([sys.executable, "-c", head + code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    return done.stderr.strip().splitlines()[-1]


def test_without_build123d_one_sentence_says_what_to_install(tmp_path: Path) -> None:
    code = "sys.modules['build123d'] = None; from d4cad.exporters.build123d import to_build123d"
    assert told(code, tmp_path) == (
        "d4cad.errors.ExportError: d4cad.exporters.build123d needs build123d: pip install 'd4cad[build123d]'"
    )


def test_a_broken_build123d_is_not_called_missing(tmp_path: Path) -> None:
    (tmp_path / "build123d.py").write_text("import OCP_that_is_gone")
    assert told("import d4cad.exporters.build123d", tmp_path).endswith(
        "build123d is installed but cannot be imported (No module named 'OCP_that_is_gone'): "
        "`d4cad doctor` says how to mend it"
    )
