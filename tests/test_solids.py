"""Solids beyond the plain extrude: known volumes, valid topology, closed meshes, one sentence where nothing fits."""

from __future__ import annotations

import json
from collections import Counter
from importlib import import_module
from math import cos, inf, nan, pi, radians, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from d4cad import exporters
from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.edges import points_along
from d4cad.errors import GeometryError, InputError
from d4cad.exporters import occ
from d4cad.exporters.form import Chamfer, Emboss, Engrave, Fillet, Form, Pocket, Revolve, Shell
from d4cad.exporters.form_mesh import form_mesh
from d4cad.exporters.inset import inset
from d4cad.exporters.occ import explored
from d4cad.exporters.revolve import swept_volume
from d4cad.exporters.solids import solids_of
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage
from d4cad.sketch import Circle, Loop, Sketch

H = 6.0


def rectangle(width: float, height: float, x: float = 0.0, y: float = 0.0) -> Loop:
    return Loop.polyline([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])


def sketch(*loops: Loop) -> Sketch:
    return Sketch.from_loops(loops, "mm")


def disc(radius: float, x: float = 0.0) -> Sketch:
    return sketch(Circle((x, 0.0), radius).loop())


def plate() -> Sketch:
    """40 x 30 mm: a bore of radius 6 with an island of radius 3 in it, and a hole of radius 4."""
    return sketch(
        rectangle(40, 30), Circle((10, 15), 6.0).loop(), Circle((10, 15), 3.0).loop(), Circle((30, 15), 4.0).loop()
    )


def corner() -> Sketch:
    """An L with one reflex corner, 20 mm long and 8 mm wide."""
    return sketch(Loop.polyline([(0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20)]))


def rounded(width: float = 40, height: float = 20, r: float = 5) -> Sketch:
    q, w, h = tan(pi / 8), width, height
    points = ((r, 0), (w - r, 0), (w, r), (w, h - r), (w - r, h), (r, h), (0, h - r), (0, r))
    return sketch(Loop(points, (0, q, 0, q, 0, q, 0, q)))


def volume(shape: Sketch, form: Form, thickness: float = H) -> float:
    found = solids_of(shape, thickness, form)
    assert all(occ.is_valid(solid) for solid in found)
    return sum(occ.volume(solid) for solid in found)


def census(shape: Sketch, form: Form) -> Counter[str]:
    """Kinds of surfaces of the faces."""
    adaptor = import_module("OCP.BRepAdaptor").BRepAdaptor_Surface
    faces = [face for solid in solids_of(shape, H, form) for face in explored(solid, "FACE")]
    return Counter(str(adaptor(face).GetType()).rpartition("_")[2] for face in faces)


def frustum(bottom: float, top: float, height: float) -> float:
    return pi * height / 3 * (bottom**2 + bottom * top + top**2)


# Fillets of a disc's edge, by Pappus: the square less the quarter disc, whose centroids are known.
def filleted_edge(radius: float, r: float) -> float:
    """Volume that a fillet r takes off the edge of a disc of a radius."""
    square = r * r * (radius - r / 2)
    quarter = pi * r * r / 4 * (radius - r + 4 * r / (3 * pi))
    return 2 * pi * (square - quarter)


TURN = radians(3)
LEAN = H * tan(TURN)
KNOWN: dict[str, tuple[Sketch, Form, float]] = {
    "pocket": (plate(), Form([Pocket(1.5, 2)]), plate().area * H + pi * 16 * (H - 1.5)),
    "all pockets": (
        plate(),
        Form([Pocket(1.5), Pocket(4.0, 2)]),
        1200 * H - pi * (36 - 9) * 1.5 - pi * 16 * 4.0,
    ),
    "draft of a square": (
        sketch(rectangle(10, 10)),
        Form(draft=TURN),
        H / 3 * (100 + (10 - 2 * LEAN) ** 2 + 10 * (10 - 2 * LEAN)),
    ),
    "draft of a disc": (disc(5), Form(draft=TURN), frustum(5, 5 - LEAN, H)),
    "draft outwards": (disc(5), Form(draft=-TURN), frustum(5, 5 + LEAN, H)),
    "draft of a ring": (
        sketch(Circle((0, 0), 9.0).loop(), Circle((0, 0), 4.0).loop()),
        Form(draft=TURN),
        frustum(9, 9 - LEAN, H) - frustum(4, 4 + LEAN, H),
    ),
    "drafted pocket": (
        sketch(Circle((0, 0), 9.0).loop(), Circle((0, 0), 4.0).loop()),
        Form([Pocket(2.0)], draft=TURN),
        frustum(9, 9 - LEAN, H) - frustum(4 + (H - 2) * tan(TURN), 4 + LEAN, 2.0),
    ),
    "chamfer of a disc": (disc(5), Form(rim=Chamfer(1.0)), pi * 25 * (H - 1) + frustum(5, 4, 1)),
    "chamfer of both": (disc(5), Form(rim=Chamfer(1.0, "both")), pi * 25 * (H - 2) + 2 * frustum(5, 4, 1)),
    "chamfer of a square": (
        sketch(rectangle(10, 10)),
        Form(rim=Chamfer(1.0, "bottom")),
        100 * (H - 1) + (100 + 64 + 80) / 3,
    ),
    "chamfer of a bore": (
        sketch(rectangle(40, 40), Circle((20, 20), 5.0).loop()),
        Form(rim=Chamfer(1.0)),
        1600 * (H - 1) + (1600 + 38**2 + 40 * 38) / 3 - pi * 25 * (H - 1) - frustum(5, 6, 1),
    ),
    "chamfered draft": (
        disc(5),
        Form(draft=TURN, rim=Chamfer(1.0)),
        frustum(5, 5 - (H - cos(TURN)) * tan(TURN), H - cos(TURN))
        + frustum(5 - (H - cos(TURN)) * tan(TURN), 4 - LEAN, cos(TURN)),
    ),
    "fillet of a disc": (disc(5), Form(rim=Fillet(1.5)), pi * 25 * H - filleted_edge(5, 1.5)),
    "fillet of both": (disc(5), Form(rim=Fillet(1.5, "both")), pi * 25 * H - 2 * filleted_edge(5, 1.5)),
    # four quarter rounds, mitred: each removes (1 - pi / 4) r^2 times a length that shrinks towards its corners
    "fillet of a square": (
        sketch(rectangle(10, 10)),
        Form(rim=Fillet(2.0)),
        100 * (H - 2) + 2 * (36 + 12 * 2 * pi / 4 * 2 + 4 * 4 * 2 / 3),
    ),
    "shell of a box": (
        sketch(rectangle(40, 30)),
        Form(shell=Shell(1.2)),
        1200 * H - (40 - 2.4) * (30 - 2.4) * (H - 1.2),
    ),
    "shell open below": (disc(8), Form(shell=Shell(1.2, "bottom")), pi * (64 * H - 6.8**2 * (H - 1.2))),
    "shell over rounds": (
        rounded(),
        Form(shell=Shell(6.0)),
        (800 - (4 - pi) * 25) * 20 - 28 * 8 * 14,
    ),
    "emboss": (disc(5), Form(relief=Emboss(1.0, base=2.0, margin=5.0)), 20 * 20 * 2 + pi * 25),
    "emboss to the edge": (sketch(rectangle(10, 8)), Form(relief=Emboss(1.0, base=2.0, margin=0.0)), 80 * 3),
    "engrave": (disc(5), Form(relief=Engrave(1.0, margin=5.0)), 20 * 20 * H - pi * 25),
    "revolve of a disc": (disc(2, 7), Form(revolve=Revolve()), 2 * pi * 7 * pi * 4),
    "revolve of a rectangle": (sketch(rectangle(3, 4, 2)), Form(revolve=Revolve(pi / 2)), pi / 4 * (25 - 4) * 4),
    "revolve about the left": (
        sketch(rectangle(3, 4, 2)),
        Form(revolve=Revolve(axis="left")),
        pi * 9 * 4,
    ),
}
THICK = {"shell over rounds": 20.0}


@pytest.mark.parametrize("name", KNOWN)
def test_known_volume(name: str) -> None:
    shape, form, wanted = KNOWN[name]
    assert volume(shape, form, THICK.get(name, H)) == pytest.approx(wanted, rel=1e-7)


@pytest.mark.parametrize("name", KNOWN)
def test_mesh_is_closed_and_as_large(name: str) -> None:
    shape, form, wanted = KNOWN[name]
    vertices, triangles = form_mesh(shape, THICK.get(name, H), 1e-3, form)
    body = trimesh.Trimesh(vertices, triangles, process=False)
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume == pytest.approx(wanted, rel=2e-3)
    low, high = body.bounds
    assert low[2] == pytest.approx(0 if form.revolve is None else shape.bounds[1], abs=1e-3)
    assert form.relief or form.revolve or high[2] == pytest.approx(THICK.get(name, H))


@pytest.mark.parametrize("tolerance", [0.1, 1e-2, 1e-3])
def test_mesh_is_within_its_tolerance(tolerance: float) -> None:
    """Every corner of the filleted disc lies on it; every facet's middle is at most the two chords further in."""
    vertices, triangles = form_mesh(disc(5), H, tolerance, Form(rim=Fillet(1.5)))
    for points, slack in ((vertices, 1e-9), (vertices[triangles].mean(axis=1), 2 * tolerance)):
        level = points[:, 2] - (H - 1.5)
        out = np.hypot(points[:, 0], points[:, 1])
        on_rim = (level > 0) & (out > 3.5 + 1e-9)
        distance = 1.5 - np.hypot(out[on_rim] - 3.5, level[on_rim])
        assert on_rim.any()
        assert distance.min() > -1e-9
        assert distance.max() < slack


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("pocket", {"Plane": (4 + 3) + 2, "Cylinder": 2 + 1}),
        ("draft of a disc", {"Plane": 2, "Cone": 1}),
        ("chamfer of a disc", {"Plane": 2, "Cylinder": 1, "Cone": 1}),
        ("fillet of a disc", {"Plane": 2, "Cylinder": 1, "Torus": 1}),
        ("fillet of a square", {"Plane": 6, "Cylinder": 4}),
        ("shell of a box", {"Plane": 11}),
        ("emboss", {"Plane": 7, "Cylinder": 1}),
        ("revolve of a disc", {"Torus": 1}),
        ("revolve of a rectangle", {"Plane": 4, "Cylinder": 2}),
    ],
)
def test_faces_are_what_a_designer_expects(name: str, kinds: dict[str, int]) -> None:
    shape, form, _ = KNOWN[name]
    assert census(shape, form) == kinds


def test_island_stands_on_its_pocket() -> None:
    """Bodies count: the island of a through bore is a body of its own, that of a pocket is not."""
    assert len(solids_of(plate(), H, Form([Pocket(1.0, 2)]))) == 2
    assert len(solids_of(plate(), H, Form([Pocket(1.0, 1)]))) == 1


@pytest.mark.parametrize(
    "shape", [corner(), rounded(), sketch(Loop(((0, 0), (20, 0), (20, 15), (0, 15)), (0.3, 0, -0.4, 0)))]
)
@pytest.mark.parametrize("rim", [Fillet(0.8), Fillet(0.8, "both"), Chamfer(0.8, "both")])
def test_rims_of_corners_agree_with_the_mesh(shape: Sketch, rim: Fillet | Chamfer) -> None:
    """Two ways that share only the outline: the kernel's rolling ball, and sections joined to a mesh."""
    vertices, triangles = form_mesh(shape, H, 1e-3, Form(rim=rim))
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert volume(shape, Form(rim=rim)) == pytest.approx(mesh.volume, rel=1e-3)


@pytest.mark.parametrize("form", [Form(draft=TURN), Form(rim=Chamfer(1.0, "both")), Form(rim=Fillet(1.0))])
@pytest.mark.parametrize("seed", range(3))
def test_nearly_tangent_edges(form: Form, seed: int) -> None:
    """Outlines from pictures: rounds that miss their tangents by 0.01 mm, and the kernel's checker is strict."""
    (loop,), rng = rounded().loops, np.random.default_rng(seed)
    shape = sketch(Loop.from_arrays(np.array(loop.points) + rng.normal(0, 0.01, (8, 2)), np.array(loop.bulges)))
    vertices, triangles = form_mesh(shape, H, 1e-3, form)
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert mesh.is_watertight
    assert volume(shape, form) == pytest.approx(mesh.volume, rel=1e-3)


@pytest.mark.parametrize("extension", [".step", ".brep", ".stl"])
def test_round_trip(extension: str, tmp_path: Path) -> None:
    path, form = tmp_path / f"part{extension}", Form([Pocket(2.0, 2)], draft=radians(1), rim=Chamfer(0.5))
    exporters.write(plate(), path, thickness=H, form=form)
    assert read_volume(path) == pytest.approx(volume(plate(), form), rel=1e-3 if extension == ".stl" else 1e-9)
    first = path.read_bytes()
    exporters.write(plate(), path, thickness=H, form=form)
    assert path.read_bytes() == first


def read_volume(path: Path) -> float:
    if path.suffix == ".stl":
        return float(trimesh.load_mesh(path).volume)
    if path.suffix == ".step":
        reader = import_module("OCP.STEPControl").STEPControl_Reader()
        assert reader.ReadFile(str(path)) == import_module("OCP.IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone
        reader.TransferRoots()
        return occ.volume(reader.OneShape())
    shape, builder = import_module("OCP.TopoDS").TopoDS_Shape(), import_module("OCP.BRep").BRep_Builder()
    assert import_module("OCP.BRepTools").BRepTools.Read_s(shape, str(path), builder)
    return occ.volume(shape)


sizes = st.floats(4.0, 60.0)
drafts = st.just(0.0) | st.floats(2e-4, 0.3) | st.floats(-0.3, -2e-4)


@settings(max_examples=15, deadline=None)
@given(sizes, sizes, st.floats(0.1, 1.9), drafts, st.sampled_from([Fillet, Chamfer]))
def test_rectangles_of_any_size(width: float, height: float, size: float, draft: float, rim: Any) -> None:
    """Prismatoids: the frustum's formula holds for any rectangle, and a rim takes less than its square all around."""
    shape, d = sketch(rectangle(width, height)), H * tan(draft)
    if 2 * d < min(width, height) - 0.1:
        top = (width - 2 * d) * (height - 2 * d)
        middle = (width - d) * (height - d)
        drafted = H / 6 * (width * height + 4 * middle + top)
        assert volume(shape, Form(draft=draft)) == pytest.approx(drafted, rel=1e-7)
    taken = width * height * H - volume(shape, Form(rim=rim(size)))
    assert 0 < taken < size * size * 2 * (width + height)


@settings(max_examples=15, deadline=None)
@given(st.floats(2.5, 40.0), st.floats(0.1, 2.4), st.floats(0.3, 2 * pi), st.floats(0.01, 20.0))
def test_discs_of_any_size(radius: float, size: float, angle: float, gap: float) -> None:
    assert volume(disc(radius), Form(rim=Fillet(size))) == pytest.approx(
        pi * radius**2 * H - filleted_edge(radius, size), rel=1e-6
    )
    turned = disc(radius, radius + gap)
    wanted = angle * (radius + gap) * pi * radius**2
    assert swept_volume(turned, angle) == pytest.approx(wanted, rel=1e-12)
    assert volume(turned, Form(revolve=Revolve(angle))) == pytest.approx(wanted, rel=1e-7)


def test_inset_of_a_bulged_corner() -> None:
    """A half disc: the corner goes to where the lifted line meets the smaller circle, (5 - sqrt(15), 1)."""
    (loop,) = inset(sketch(Loop(((0, 0), (10, 0)), (0, 1.0))), 1.0).loops
    assert loop.points[0] == pytest.approx((5 - 15**0.5, 1.0), abs=1e-12)
    assert loop.points[1] == pytest.approx((5 + 15**0.5, 1.0), abs=1e-12)
    assert 4 * np.arctan(loop.bulges[1]) == pytest.approx(pi - 2 * np.arcsin(1 / 4), abs=1e-12)


@given(st.floats(-3.0, 3.0))
def test_inset_there_and_back(distance: float) -> None:
    there = inset(rounded(), distance)
    back = inset(there, -distance)
    assert np.allclose(back.loops[0].points, rounded().loops[0].points, atol=1e-9)
    assert np.allclose(back.loops[0].bulges, rounded().loops[0].bulges, atol=1e-9)


def test_inset_refuses_what_vanishes() -> None:
    with pytest.raises(GeometryError, match="no longer meet when moved by 6"):
        inset(rounded(), 6.0)
    with pytest.raises(GeometryError, match="crosses or touches"):
        inset(sketch(rectangle(20, 20), Circle((10, 10), 8.0).loop()), 1.5)
    with pytest.raises(GeometryError, match="pass through each other"):
        inset(sketch(Circle((0, 0), 4.0).loop(), Circle((0, 0), 2.0).loop()), 1.5)


BAD = [
    (Form(rim=Fillet(3.0, "both")), "the fillet of 3 mm does not fit the thickness of 6 mm: .* less than 3 mm does"),
    (Form(rim=Chamfer(6.5)), "the chamfer of 6.5 mm does not fit the thickness of 6 mm"),
    (Form(rim=Fillet(5.0)), "does not fit: the edge at .* vanishes .*; up to about 3.99 mm fits"),
    (Form(draft=radians(50)), "the draft of 50 degrees does not fit over 6 mm: .* up to about 33.[0-9] degrees fits"),
    (Form(shell=Shell(4.5)), "the shell of 4.5 mm leaves no hollow in this outline"),
    (Form(shell=Shell(6.0)), "the shell of 6 mm leaves no hollow in a part 6 mm thick"),
    (Form(rim=Fillet(1.5), shell=Shell(1.2)), "the fillet of 1.5 mm does not fit walls of 1.2 mm: .* than 1.2 mm does"),
    (Form([Pocket(1.0)]), "a pocket needs a hole, and this part has none"),
    (Form(relief=Engrave(6.0)), "the engraving of 6 mm goes through its base plate of 6 mm"),
    (Form(revolve=Revolve()), "the profile crosses its axis: it reaches to x = -10 mm"),
]


@pytest.mark.parametrize(("form", "message"), BAD)
def test_what_does_not_fit_is_said(form: Form, message: str, tmp_path: Path) -> None:
    box = sketch(rectangle(20, 8, -10))
    for extension in (".step", ".stl"):
        with pytest.raises(InputError, match=message):
            exporters.write(box, tmp_path / f"part{extension}", thickness=H, form=form)
    assert not list(tmp_path.iterdir())


def test_pockets_that_are_none() -> None:
    with pytest.raises(InputError, match="loop 0 is no hole that could be a pocket: the holes are 1, 2"):
        solids_of(plate(), H, Form([Pocket(1.0, 0)]))
    with pytest.raises(InputError, match="loop 9 is no hole"):
        solids_of(plate(), H, Form([Pocket(1.0, 9)]))
    with pytest.raises(InputError, match="the pocket of 6 mm goes through the part of 6 mm"):
        solids_of(plate(), H, Form([Pocket(6.0)]))
    with pytest.raises(InputError, match="does not fit a pocket of 1 mm"):
        solids_of(plate(), H, Form([Pocket(1.0)], rim=Fillet(1.0)))


# (x, y) and bulges of half profiles whose arcs end on the axis, so that their tori cross themselves
HORNS: dict[str, tuple[list[tuple[float, float]], list[float]]] = {
    "one arc to the axis": ([(0, 0), (3.3, 1.3), (0, 10)], [0, 0.56, 0]),
    "a lens": ([(0, 0), (4, 5), (0, 10)], [0.2, 0.2, 0]),
    "an onion": ([(0, 0), (7, 6.7), (0, 10)], [0.53, -0.57, 0]),
    "more than half a circle": ([(0, 0), (2, 1), (0, 10)], [0, 1.3, 0]),
    "an arc that passes by": ([(1, 0), (4, 5), (1, 10)], [0.3, 0.3, 0]),
}


@pytest.mark.parametrize("name", HORNS)
@pytest.mark.parametrize("angle", [2 * pi, 5.0, pi, 1.0])
def test_steps_of_tori_that_cross_themselves(name: str, angle: float, tmp_path: Path) -> None:
    """Readers of STEP lost faces, or made the solid invalid, where such a torus was one face with its seam."""
    points, bulges = HORNS[name]
    half = sketch(Loop(tuple(points), tuple(bulges)))
    exporters.write(half, tmp_path / "part.step", thickness=1, form=Form(revolve=Revolve(angle)))
    reader = import_module("OCP.STEPControl").STEPControl_Reader()
    assert reader.ReadFile(str(tmp_path / "part.step")) == import_module("OCP.IFSelect").IFSelect_ReturnStatus(1)
    reader.TransferRoots()
    read = reader.OneShape()
    assert occ.is_valid(read)
    assert len(explored(read, "SOLID")) == 1
    assert occ.volume(read) == pytest.approx(pappus(half, angle), rel=1e-5)


def pappus(shape: Sketch, angle: float) -> float:
    """Volume of a turned shape from a fine polygon of it: angle times the integral of x over it."""
    polygon = np.concatenate(
        [points_along(shape.loops[0].edges.take(k), np.arange(2000) / 2000) for k in range(len(shape.loops[0].points))]
    )
    after = np.roll(polygon, -1)
    twice = polygon.real * after.imag - after.real * polygon.imag
    return angle * abs(float(((polygon.real + after.real) * twice).sum())) / 6


def test_pockets_named_twice() -> None:
    with pytest.raises(InputError, match="the pocket 1 is given 2 times"):
        Form([Pocket(1.0, 1), Pocket(2.0, 1)])
    with pytest.raises(InputError, match="the pocket all is given 2 times"):
        Form([Pocket(1.0), Pocket(2.0)])


def test_profiles_that_pinch_themselves_off() -> None:
    with pytest.raises(InputError, match=r"touches its axis in one point, \(0, 1\)"):
        solids_of(sketch(Loop.polyline([(0, 1), (2, 0), (2, 2)])), H, Form(revolve=Revolve()))
    with pytest.raises(InputError, match="touches its axis with an arc"):
        solids_of(sketch(Loop(((3, -3), (3, 3)), (1.0, 1.0))), H, Form(revolve=Revolve(axis="left")))


def test_draft_and_fillet_need_tame_corners() -> None:
    """Where OpenCASCADE crashes on some shapes it is not asked; the mesh has no such limit."""
    dome, form = sketch(Loop(((0, 0), (20, 0)), (0, 0.6))), Form(draft=radians(2), rim=Fillet(0.5))
    with pytest.raises(InputError, match="where an arc meets an edge at an angle"):
        solids_of(dome, H, form)
    vertices, triangles = form_mesh(dome, H, 1e-2, form)
    assert trimesh.Trimesh(vertices, triangles, process=False).is_watertight
    assert volume(rounded(), form) < volume(rounded(), Form(draft=radians(2)))


@pytest.mark.parametrize("value", [0.0, -1.0, nan, inf])
@pytest.mark.parametrize("make", [Pocket, Emboss, Engrave, Fillet, Chamfer, Shell])
def test_numbers_must_be_positive(make: Any, value: float) -> None:
    with pytest.raises(InputError, match=f"must be a positive number in mm, got {value:g}"):
        make(value)


def test_forms_that_exclude_each_other() -> None:
    with pytest.raises(InputError, match="a revolution cannot have other forms beside it, got revolve and fillet"):
        Form(revolve=Revolve(), rim=Fillet(1.0))
    with pytest.raises(InputError, match="an embossing or engraving cannot have other forms"):
        Form(relief=Emboss(1.0), draft=0.1)
    with pytest.raises(InputError, match="a shell has no pockets"):
        Form([Pocket(1.0)], shell=Shell(1.0))
    for draft in (nan, 1.2, -2.0):
        with pytest.raises(InputError, match="the draft must be from -60 to 60 degrees"):
            Form(draft=draft)
    with pytest.raises(InputError, match=r"a draft must be 0 or at least 0\.01 degrees, got 0\.001"):
        Form(draft=1e-3 * pi / 180)
    for angle in (0.0, -1.0, 7.0, nan):
        with pytest.raises(InputError, match="angle of a revolution"):
            Revolve(angle)
    with pytest.raises(InputError, match="edges of a fillet must be top, bottom or both, got 'side'"):
        Fillet(1.0, "side")
    with pytest.raises(InputError, match="the margin of a base plate must be 0 or more mm, got -1"):
        Emboss(1.0, margin=-1.0)


def test_drawings_have_no_form(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a \.svg file takes no form, only \.step \.stp \.brep \.stl"):
        exporters.write(plate(), tmp_path / "part.svg", form=Form(rim=Fillet(1.0)))
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def ring() -> Fit:
    """A fitted ring of 24 and 12 pixels radius."""
    canvas = Canvas.square(64)
    y, x = np.mgrid[:64, :64] + 0.5
    r = np.hypot(x - 32, y - 32)
    return fit_coverage(np.clip(24.5 - r, 0, 1) * np.clip(r - 11.5, 0, 1), canvas, floor=0.1)


def d4cad(*args: str) -> Any:
    return CliRunner().invoke(app, list(args))


def test_command_line(ring: Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ring.save("ring.json", width=48, thickness=5)
    rows = json.loads(d4cad("export", "ring.json", "--list-loops", "--json").stdout)["loops"]
    assert [(row["loop"], row["kind"], row["shape"]) for row in rows] == [(0, "outer", "circle"), (1, "hole", "circle")]
    big, small = (row["size_mm"][0] / 2 for row in rows)
    assert (big, small) == pytest.approx((24, 12), abs=0.2)
    table = d4cad("export", "ring.json", "--list-loops").stdout.splitlines()
    assert table[1].split()[:4] == ["0", "outer", "diameter", "48"]
    assert table[2].split()[:3] == ["1", "hole", "diameter"]
    lean = 5 * tan(radians(2))
    for options, wanted in (
        (["--pocket", "1=1.5"], pi * (big**2 * 5 - small**2 * 1.5)),
        (["--pocket", "all=1.5"], pi * (big**2 * 5 - small**2 * 1.5)),
        (["--draft", "2"], frustum(big, big - lean, 5) - frustum(small, small + lean, 5)),
        (
            ["--chamfer", "1", "--rim", "both"],
            pi * 3 * (big**2 - small**2) + 2 * frustum(big, big - 1, 1) - 2 * frustum(small, small + 1, 1),
        ),
        (["--emboss", "1", "--base", "2", "--margin", "1"], (2 * big + 2) ** 2 * 2 + pi * (big**2 - small**2)),
        (["--engrave", "1", "--margin", "1"], (2 * big + 2) ** 2 * 5 - pi * (big**2 - small**2)),
        (["--revolve", "--angle", "90", "--thickness", "1"], pi / 2 * big * pi * (big**2 - small**2)),
    ):
        if "--revolve" in options:  # about the left corner of its box a ring touches the axis with an arc
            assert "touches its axis" in refused("export", "ring.json", "-o", "part.step", *options)
            continue
        result = d4cad("export", "ring.json", "-o", "part.step", "-o", "part.stl", *options)
        assert result.exit_code == 0, result.output
        assert read_volume(Path("part.step")) == pytest.approx(wanted, rel=1e-6)
        assert read_volume(Path("part.stl")) == pytest.approx(wanted, rel=5e-3)
    ring.save("fit.step", width=48, thickness=5, form=Form(shell=Shell(1.0)))
    hollow = pi * ((big - 1) ** 2 - (small + 1) ** 2) * 4
    assert read_volume(Path("fit.step")) == pytest.approx(pi * (big**2 - small**2) * 5 - hollow, rel=1e-6)


def test_thickness_is_missed_where_it_matters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exporters.write(sketch(rectangle(20, 10)), Path("part.dxf"), thickness=1)
    for options, missed in (
        ([], True),
        (["--emboss", "1"], True),
        (["--emboss", "1", "--base", "2"], False),
        (["--revolve"], False),
        (["--revolve", "-o", "part.py"], True),  # the source is of the plain extrude
    ):
        result = d4cad("export", "part.dxf", "-o", "part.step", *options)
        assert result.exit_code == 0, result.output
        assert ("no thickness was given" in result.stdout) == missed


@pytest.mark.parametrize("option", ["--scale", "--dpi"])
def test_drawings_have_no_pixels(option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exporters.write(sketch(rectangle(20, 10)), Path("part.dxf"), thickness=1)
    assert "give --width in place of" in refused("export", "part.dxf", "-o", "part.step", option, "2")


def refused(*args: str) -> str:
    """The sentence that a refused command prints; nothing is left behind."""
    before = sorted(Path.cwd().iterdir())
    result = d4cad(*args)
    assert result.exit_code == 2, result.output
    assert sorted(Path.cwd().iterdir()) == before
    assert result.stderr.count("\n") == 1
    return str(result.stderr).strip()


def test_command_line_refuses(ring: Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ring.save("ring.json", width=48, thickness=5)
    for options, message in (
        (["--fillet", "2.5", "--rim", "both"], "the fillet of 2.5 mm does not fit the thickness of 5 mm"),
        (["--fillet", "nan"], "the radius of a fillet must be a positive number in mm, got nan"),
        (["--fillet", "0"], "must be a positive number in mm, got 0"),
        (["--fillet", "1", "--chamfer", "1"], "expected one of --fillet and --chamfer, got both"),
        (["--emboss", "1", "--engrave", "1"], "expected one of --emboss and --engrave, got both"),
        (["--draft", "59"], "the draft of 59 degrees does not fit over 5 mm"),
        (["--draft", "inf"], "the draft must be from -60 to 60 degrees, got inf"),
        (["--shell", "7"], "leaves no hollow"),
        (["--pocket", "1=5"], "the pocket of 5 mm goes through"),
        (["--pocket", "2=1"], "loop 2 is no hole that could be a pocket: the holes are 1"),
        (["--pocket", "bore"], "a pocket is LOOP=MM, as in 2=1.5 or all=1.5, got 'bore'"),
        (["--pocket", "-1=2"], "number of a loop from 0 on, got -1"),
        (["--rim", "top"], "--rim needs --fillet or --chamfer"),
        (["--base", "2"], "--base needs --emboss or --engrave"),
        (["--angle", "90"], "--angle needs --revolve"),
        (["--open", "top"], "--open needs --shell"),
        (["--revolve", "--angle", "400"], "at most 360 degrees, got 400"),
        (["--revolve", "--fillet", "1"], "a revolution cannot have other forms beside it"),
        (["--list-loops"], "--list-loops writes nothing"),
    ):
        assert message in refused("export", "ring.json", "-o", "part.step", *options)
    for flat in ("part.svg", "part.json"):
        assert "no output takes a form, only .step" in refused("export", "ring.json", "-o", flat, "--fillet", "1")
