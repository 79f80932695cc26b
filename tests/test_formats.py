"""Every format read back by a program that is not ours, and measured; options that a format holds or refuses."""

from __future__ import annotations

import json
import struct
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from functools import cache, partial
from importlib import import_module
from math import atan, hypot, inf, nan, pi, sin, tan
from pathlib import Path
from types import ModuleType
from typing import Any

import ezdxf
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from d4cad import exporters
from d4cad.cli import app
from d4cad.cli.options import Output
from d4cad.errors import ExportError, InputError
from d4cad.exporters import kerf as kerfs
from d4cad.exporters.color import hexadecimal, linear, rgb
from d4cad.exporters.dxf import write_dxf
from d4cad.exporters.names import printable
from d4cad.exporters.step import write_step
from d4cad.exporters.svg import loop_path, svg, write_svg
from d4cad.fit import fit_image
from d4cad.shapes import generate
from d4cad.sketch import Circle, Face, Loop, Sketch

SVG = "{http://www.w3.org/2000/svg}"
CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


def flange() -> Sketch:
    """60 mm across: a bore of 20, four bolt holes of 5, a slot with semicircular ends, and a washer beside it."""
    bolts = [Circle((22 * x, 22 * y), 2.5).loop() for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    slot = Loop(((12, 12), (16, 16), (14, 18), (10, 14)), (0, 1, 0, 1))
    washer = [Circle((50, 0), 8).loop(), Circle((50, 0), 4).loop()]
    return Sketch.from_loops([Circle((0, 0), 30).loop(), Circle((0, 0), 10).loop(), *bolts, slot, *washer], "mm")


@cache
def generated(seed: int) -> Sketch:
    """A part of about 60 mm from the generator, away from the origin."""
    primitives = (8, 40, 95)[seed % 3]
    return generate(np.random.default_rng(seed), primitives).scaled(27.3).translated(41.7, -1234.5)


SKETCHES: dict[str, Callable[[], Sketch]] = {
    "flange": flange,
    **{f"generated {seed}": partial(generated, seed) for seed in range(6)},
}


def inflated(sketch: Sketch, distance: float) -> Sketch:
    """What d4cad.offsets does, for loops that are circles."""
    faces = []
    for face in sketch.faces:
        loops = []
        for loop, grown in ((loop, distance if loop is face.outer else -distance) for loop in face.loops):
            circle = loop.circle
            assert circle is not None
            if circle.radius + grown > 0:
                loops.append(Circle(circle.center, circle.radius + grown).loop(clockwise=loop is not face.outer))
        faces.append(Face(loops[0], tuple(loops[1:])))
    return Sketch(tuple(faces), sketch.unit)


@pytest.fixture
def offsets(monkeypatch: pytest.MonkeyPatch) -> None:
    """The exact offset of circles in place of d4cad.offsets."""
    fake = ModuleType("d4cad.offsets")
    fake.offset = inflated  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "d4cad.offsets", fake)


def washers() -> Sketch:
    """A ring of 20 and 10 mm across and a disc of 6 mm, 1 mm apart."""
    loops = [Circle((0, 0), 10).loop(), Circle((0, 0), 5).loop(), Circle((14, 0), 3).loop()]
    return Sketch.from_loops(loops, "mm")


# DXF


def entity_area(entity: Any) -> float:
    """Area of a CIRCLE or a closed LWPOLYLINE, by the shoelace formula and the circular segments of its bulges."""
    if entity.dxftype() == "CIRCLE":
        return float(pi * entity.dxf.radius**2)
    corners = [(x, y, b) for x, y, b in entity.get_points("xyb")]
    x0, y0, _ = corners[0]
    area = 0.0
    for (xa, ya, b), (xb, yb, _) in zip(corners, corners[1:] + corners[:1], strict=True):
        area += ((xa - x0) * (yb - y0) - (xb - x0) * (ya - y0)) / 2
        if b:
            sweep = 4 * atan(b)
            radius = hypot(xb - xa, yb - ya) / (2 * sin(abs(sweep) / 2))
            area += radius**2 * (sweep - sin(sweep)) / 2
    return abs(area)


@pytest.mark.parametrize("name", SKETCHES)
def test_dxf_read_by_ezdxf(name: str, tmp_path: Path) -> None:
    sketch = SKETCHES[name]()
    path = tmp_path / "part.dxf"
    exporters.write(sketch, path)
    drawing = ezdxf.readfile(path)
    assert not drawing.audit().errors
    assert drawing.dxfversion >= "AC1024"
    assert (drawing.header["$INSUNITS"], drawing.header["$MEASUREMENT"]) == (4, 1)
    colors = {name: drawing.layers.get(name).color for name in ("OUTER", "INNER")}
    assert colors["OUTER"] != colors["INNER"]
    entities = list(drawing.modelspace())
    circles = [e for e in entities if e.dxftype() == "CIRCLE"]
    lines = [e for e in entities if e.dxftype() == "LWPOLYLINE"]
    assert len(circles) + len(lines) == len(entities) == len(sketch.loops)
    assert all(e.closed for e in lines)
    expected = [loop.circle.radius for loop in sketch.loops if loop.circle is not None]
    assert sorted(e.dxf.radius for e in circles) == pytest.approx(sorted(expected), rel=1e-12)
    assert sum(len(e) for e in lines) == sketch.primitives - 2 * len(circles)
    layers = [e.dxf.layer for e in entities]
    assert layers == [layer for face in sketch.faces for layer in (*["INNER"] * len(face.holes), "OUTER")]
    outer = sum(entity_area(e) for e in entities if e.dxf.layer == "OUTER")
    inner = sum(entity_area(e) for e in entities if e.dxf.layer == "INNER")
    assert outer - inner == pytest.approx(sketch.area, rel=1e-9)
    assert [*drawing.header["$EXTMIN"][:2], *drawing.header["$EXTMAX"][:2]] == pytest.approx(sketch.bounds)
    assert list(tmp_path.iterdir()) == [path]


def test_dxf_leaves_the_users_settings_of_ezdxf_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for setting in (False, True):
        monkeypatch.setattr(ezdxf.options, "write_fixed_meta_data_for_testing", setting)
        write_dxf(flange(), tmp_path / "part.dxf")
        assert ezdxf.options.write_fixed_meta_data_for_testing is setting


def test_a_drawing_needs_mm(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="in 'world' units"):
        exporters.write(Sketch(flange().faces), tmp_path / "part.dxf")
    with pytest.raises(InputError, match="a kerf is in mm"):
        exporters.write(Sketch(flange().faces), tmp_path / "part.svg", kerf=0.1)
    with pytest.raises(InputError, match="no faces"):
        exporters.write(Sketch((), "mm"), tmp_path / "part.dxf")
    assert not list(tmp_path.iterdir())


# Kerf


@pytest.mark.usefixtures("offsets")
def test_kerf_makes_outlines_larger_and_holes_smaller(tmp_path: Path) -> None:
    exporters.write(washers(), tmp_path / "part.dxf", kerf=0.2)
    space = ezdxf.readfile(tmp_path / "part.dxf").modelspace()
    found = [(e.dxf.layer, round(2 * e.dxf.radius, 12)) for e in space]
    assert found == [("INNER", 9.8), ("OUTER", 20.2), ("OUTER", 6.2)]
    exporters.write(washers(), tmp_path / "part.svg", kerf=0.2, style="cut")
    assert (tmp_path / "part.svg").read_text() == svg(inflated(washers(), 0.1), style="cut", name="part")


def test_no_kerf_changes_nothing(tmp_path: Path) -> None:
    for extension in (".dxf", ".svg"):
        bare, zero = tmp_path / f"bare{extension}", tmp_path / f"zero{extension}"
        name = "same" if extension == ".svg" else None
        exporters.write(flange(), bare, name=name)
        exporters.write(flange(), zero, name=name, kerf=0)
        assert bare.read_bytes() == zero.read_bytes()


@pytest.mark.usefixtures("offsets")
def test_holes_that_a_kerf_closes_are_told() -> None:
    assert kerfs.losses(washers(), 9.9) == ()
    assert kerfs.losses(washers(), 10.5) == ("a kerf of 10.5 mm closes 1 hole",)


def test_kerf_with_the_real_offset(tmp_path: Path) -> None:
    pytest.importorskip("d4cad.offsets")
    path = tmp_path / "part.dxf"
    exporters.write(flange(), path, kerf=0.3)
    space = ezdxf.readfile(path).modelspace()
    diameters = sorted(2 * e.dxf.radius for e in space if e.dxftype() == "CIRCLE")
    assert diameters == pytest.approx([4.7, 4.7, 4.7, 4.7, 7.7, 16.3, 19.7, 60.3], rel=1e-9)
    (slot,) = [e for e in space if e.dxftype() == "LWPOLYLINE"]
    width, length = 8**0.5 - 0.3, 32**0.5
    assert slot.dxf.layer == "INNER"
    assert entity_area(slot) == pytest.approx(width * length + pi * width**2 / 4, rel=1e-9)
    assert kerfs.losses(flange(), 6.5) == ("a kerf of 6.5 mm closes 5 holes",)
    assert kerfs.losses(Sketch.from_loops([Circle((x, 0), 4).loop() for x in (0, 9)], "mm"), 1.5) == (
        "a kerf of 1.5 mm makes 2 parts 1",
    )


# SVG


def path_area(path_data: str) -> float:
    """Signed area inside path data, y down turned up, by svgpathtools' centres and angles of the arcs."""
    tools = pytest.importorskip("svgpathtools")
    area = 0.0
    for piece in tools.parse_path(path_data).continuous_subpaths():
        origin = piece[0].start
        for segment in piece:
            a, b = segment.start - origin, segment.end - origin
            area += (a.conjugate() * b).imag / 2
            if isinstance(segment, tools.Arc):
                sweep = np.radians(segment.delta)
                area += segment.radius.real * segment.radius.imag * (sweep - np.sin(sweep)) / 2
    return -float(area)


@pytest.mark.parametrize("style", ["fill", "cut"])
@pytest.mark.parametrize("name", SKETCHES)
def test_svg_read_by_svgpathtools(name: str, style: str, tmp_path: Path) -> None:
    sketch = SKETCHES[name]()
    path = tmp_path / "part.svg"
    exporters.write(sketch, path, style=style)
    paths = ET.parse(path).getroot().findall(f"{SVG}g/{SVG}path")
    assert sum(path_area(p.get("d") or "") for p in paths) == pytest.approx(sketch.area, rel=1e-9)
    assert len({p.get("id") for p in paths}) == len(paths)
    arcs = sum("A" in (p.get("d") or "") for p in paths)
    assert arcs > 0


@given(
    near=st.sampled_from([0.5, 1.0, 2.0]),
    off=st.floats(-0.25, 0.25) | st.floats(-1e-9, 1e-9),
    size=st.floats(0.01, 1000),
    at=st.complex_numbers(max_magnitude=1000),
    turn=st.floats(0, 2 * pi),
)
def test_svg_arcs_of_about_half_a_turn_keep_their_digits(
    near: float, off: float, size: float, at: complex, turn: float
) -> None:
    end = at + size * complex(np.exp(1j * turn))
    loop = Loop(((at.real, at.imag), (end.real, end.imag)), (near + off, 0.3))
    assert path_area(loop_path(loop)) == pytest.approx(loop.area, rel=1e-9)


def test_svg_arcs_read_by_svgelements() -> None:
    elements = pytest.importorskip("svgelements")
    found = elements.Path(loop_path(Circle((3, 4), 5).loop()))
    assert found.bbox() == pytest.approx((-2, -9, 8, 1), rel=1e-12)
    assert found.length(error=1e-9) == pytest.approx(10 * pi, rel=1e-9)


def test_svg_for_cutting_draws_each_loop_once_and_holes_first() -> None:
    root = ET.fromstring(svg(flange(), style="cut", name="a <flange> & more\x07"))
    group = root.find(f"{SVG}g")
    assert group is not None
    assert (group.get("fill"), group.get("stroke"), group.get("stroke-width")) == ("none", "#ff0000", "0.01")
    classes = [p.get("class") for p in group]
    assert classes == ["inner"] * 6 + ["outer"] + ["inner", "outer"]
    assert [p.get("id") for p in group][6:] == ["outer-1", "inner-2-1", "outer-2"]
    assert all((p.get("d") or "").count("M") == 1 for p in group)
    assert root.findtext(f"{SVG}title") == "a <flange> & more"
    size = [float((root.get(side) or "").removesuffix("mm")) for side in ("width", "height")]
    assert size == [float(v) for v in (root.get("viewBox") or "").split()[2:]]
    assert size == pytest.approx([88.02, 60.02])


def test_svg_colors() -> None:
    assert 'fill="#4682B4"' in svg(flange(), color="steelblue")
    assert 'stroke="#0000FF"' in svg(flange(), style="cut", color="blue")


def test_svg_text_is_the_same_everywhere(tmp_path: Path) -> None:
    write_svg(flange(), tmp_path / "part.svg", name="Größe")
    assert (tmp_path / "part.svg").read_bytes() == svg(flange(), name="Größe").encode()
    assert b"\r" not in (tmp_path / "part.svg").read_bytes()


# STEP


def read_document(path: Path) -> list[tuple[str, list[tuple[float, float, float] | None]]]:
    """Name of each product and the surface colour of each of its solids, in linear light, by OpenCASCADE's XCAF."""
    text, xcaf = import_module("OCP.TCollection").TCollection_ExtendedString, import_module("OCP.XCAFDoc")
    document = import_module("OCP.TDocStd").TDocStd_Document(text("XCAF"))
    import_module("OCP.XCAFApp").XCAFApp_Application.GetApplication_s().InitDocument(document)
    reader = import_module("OCP.STEPCAFControl").STEPCAFControl_Reader()
    reader.SetColorMode(True)
    reader.SetNameMode(True)
    assert reader.ReadFile(str(path)) == import_module("OCP.IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone
    assert reader.Transfer(document)
    colors, surface = xcaf.XCAFDoc_DocumentTool.ColorTool_s(document.Main()), xcaf.XCAFDoc_ColorType.XCAFDoc_ColorSurf
    labels = import_module("OCP.TDF").TDF_ChildIterator(xcaf.XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).Label())
    found = []
    while labels.More():
        name = import_module("OCP.TDataStd").TDataStd_Name()
        assert labels.Value().FindAttribute(type(name).GetID_s(), name)
        shape = xcaf.XCAFDoc_ShapeTool.GetShape_s(labels.Value())
        solids = import_module("OCP.TopExp").TopExp_Explorer(
            shape, import_module("OCP.TopAbs").TopAbs_ShapeEnum.TopAbs_SOLID
        )
        shades: list[tuple[float, float, float] | None] = []
        while solids.More():
            color = import_module("OCP.Quantity").Quantity_Color()
            known = colors.GetColor(solids.Current(), surface, color)
            shades.append((color.Red(), color.Green(), color.Blue()) if known else None)
            solids.Next()
        found.append((name.Get().ToExtString(), shades))
        labels.Next()
    return found


@pytest.mark.parametrize("schema", ["AP214", "AP242"])
@pytest.mark.parametrize("sketch", [washers(), Sketch(washers().faces[:1], "mm")], ids=["two", "one"])
def test_step_keeps_name_and_color(schema: str, sketch: Sketch, tmp_path: Path) -> None:
    path = tmp_path / "part.step"
    exporters.write(sketch, path, thickness=2, schema=schema, color="steelblue", name="Größe")
    ((name, colors),) = read_document(path)
    assert name == "Größe"
    assert len(colors) == len(sketch.faces)
    assert all(color == pytest.approx(linear("steelblue"), abs=1e-6) for color in colors)
    assert ("AP242" in path.read_text()) == (schema == "AP242")


def test_step_without_a_color_has_none_and_a_color_only_adds_to_the_file(tmp_path: Path) -> None:
    bare, red = tmp_path / "bare.step", tmp_path / "red.step"
    write_step(washers(), bare, thickness=2)
    write_step(washers(), red, thickness=2, color="#ff0000")
    assert read_document(bare) == [("part", [None, None])]
    kept = bare.read_text().removesuffix("ENDSEC;\nEND-ISO-10303-21;\n")
    assert red.read_text().startswith(kept)
    assert "COLOUR_RGB('',1.,0.,0.)" in red.read_text()


# Meshes

MESHES = [".stl", ".3mf", ".glb"]


def read_3mf(path: Path) -> tuple[Any, ET.Element]:
    """The mesh of the only object of a 3MF file, and its model element."""
    with zipfile.ZipFile(path) as package:
        assert package.testzip() is None
        root = ET.fromstring(package.read("3D/3dmodel.model"))
    corners = [[float(v.get(k) or "") for k in "xyz"] for v in root.iter(f"{CORE}vertex")]
    facets = [[int(t.get(k) or "") for k in ("v1", "v2", "v3")] for t in root.iter(f"{CORE}triangle")]
    return trimesh.Trimesh(corners, facets), root


def read_mesh(path: Path) -> Any:
    """The mesh in mm, z up."""
    if path.suffix == ".3mf":
        return read_3mf(path)[0]
    mesh = trimesh.load(path, force="mesh")
    if path.suffix == ".glb":
        mesh.apply_transform([[1000, 0, 0, 0], [0, 0, -1000, 0], [0, 1000, 0, 0], [0, 0, 0, 1]])
    return mesh


@pytest.mark.parametrize("extension", MESHES)
@pytest.mark.parametrize("name", ["flange", "generated 0", "generated 2"])
@pytest.mark.parametrize("tolerance", [0.2, None])
def test_meshes_are_closed_and_within_their_tolerance(
    name: str, extension: str, tolerance: float | None, tmp_path: Path
) -> None:
    sketch = SKETCHES[name]()
    if name != "flange":  # 32-bit floats have no digits to spare
        sketch = sketch.translated(-41.7, 1234.5)
    path = tmp_path / f"part{extension}"
    exporters.write(sketch, path, thickness=3, tolerance=tolerance)
    mesh = read_mesh(path)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    allowed = sketch.length * (exporters.CHORD_TOLERANCE if tolerance is None else tolerance) * 3
    assert mesh.volume == pytest.approx(sketch.area * 3, abs=allowed)
    assert mesh.bounds[:, 2] == pytest.approx([0, 3], abs=1e-6)
    assert len(mesh.split(only_watertight=True)) == len(sketch.faces)
    assert list(tmp_path.iterdir()) == [path]


def test_glb_is_in_metres_with_y_up_named_and_colored(tmp_path: Path) -> None:
    path = tmp_path / "part.glb"
    exporters.write(flange(), path, thickness=3, name='a "flange"\n', color="#1f3a5f")
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack("<4sIII4s", data[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    tree = json.loads(data[20 : 20 + size])
    assert tree["nodes"][0]["name"] == tree["meshes"][0]["name"] == 'a "flange"'
    (material,) = tree["materials"]
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([0.0137, 0.0423, 0.1144, 1], abs=1e-4)
    assert material["pbrMetallicRoughness"]["metallicFactor"] == 0
    scene = trimesh.load(path)
    assert scene.bounds.ravel() == pytest.approx([-0.03, 0, -0.03, 0.058, 0.003, 0.03], abs=1e-5)
    assert scene.to_mesh().volume > 0


def test_3mf_is_in_mm_named_and_colored(tmp_path: Path) -> None:
    path = tmp_path / "part.3mf"
    exporters.write(flange(), path, thickness=3, name='a "<flange>"', color="steelblue")
    _, root = read_3mf(path)
    assert root.get("unit") == "millimeter"
    (thing,) = root.iter(f"{CORE}object")
    (base,) = root.iter(f"{CORE}base")
    assert thing.get("name") == 'a "<flange>"'
    assert base.get("displaycolor") == "#4682B4"
    (group,) = root.iter(f"{CORE}basematerials")
    assert (thing.get("pid"), thing.get("pindex")) == (group.get("id"), "0")
    exporters.write(flange(), path, thickness=3)
    assert not list(read_3mf(path)[1].iter(f"{CORE}basematerials"))


def test_3mf_read_by_lib3mf(tmp_path: Path) -> None:
    lib3mf = pytest.importorskip("lib3mf")
    path = tmp_path / "part.3mf"
    exporters.write(flange(), path, thickness=3, name="Größe", color="steelblue")
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    assert model.GetBuildItems().Count() == 1
    objects = model.GetMeshObjects()
    assert objects.MoveNext()
    thing = objects.GetCurrentMeshObject()
    assert thing.GetName() == "Größe"
    assert thing.IsManifoldAndOriented()
    corners = [list(v.Coordinates) for v in thing.GetVertices()]
    facets = [list(t.Indices) for t in thing.GetTriangleIndices()]
    assert trimesh.Trimesh(corners, facets).volume == pytest.approx(flange().area * 3, rel=1e-3)
    resource, index, has_color = thing.GetObjectLevelProperty()
    assert has_color
    shown = model.GetBaseMaterialGroupByID(resource).GetDisplayColor(index)
    assert (shown.Red, shown.Green, shown.Blue) == (70, 130, 180)
    assert not objects.MoveNext()


# All formats


@pytest.mark.parametrize("extension", exporters.EXTENSIONS)
def test_the_same_part_is_the_same_file(extension: str, tmp_path: Path) -> None:
    first, second = tmp_path / "1" / f"part{extension}", tmp_path / "2" / f"part{extension}"
    for path in (first, second):
        path.parent.mkdir()
        takes = exporters.heeded(path, exporters.Options(color="red")).given
        exporters.write(flange(), path, thickness=3, **takes)
    assert first.read_bytes() == second.read_bytes()


def test_colors() -> None:
    assert rgb("#ff8000") == rgb(" #FF8000 ") == (255, 128, 0)
    assert hexadecimal("RebeccaPurple") == "#663399"
    assert linear("#ff00bc") == pytest.approx((1, 0, 0.5029), abs=1e-4)
    for bad in ("", "nope", "#12", "#11223344", "12"):
        with pytest.raises(InputError, match="#rrggbb or a CSS name such as steelblue, got"):
            rgb(bad)


@settings(max_examples=50)
@given(st.text())
def test_names_fit_into_xml(name: str) -> None:
    root = ET.fromstring(svg(Sketch.from_loops([Circle((0, 0), 1).loop()]), name=name))
    assert (root.findtext(f"{SVG}title") or "") == printable(name)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"schema": "AP203"}, "unknown STEP schema 'AP203': known are AP214, AP242"),
        ({"color": "blurple"}, "got 'blurple'"),
        ({"tolerance": 0.0}, "chord tolerance of a mesh must be positive and finite, got 0 mm"),
        ({"tolerance": nan}, "got nan"),
        ({"kerf": -0.1}, "the kerf must be 0 or a positive number in mm, got -0.1"),
        ({"kerf": inf}, "got inf"),
        ({"style": "hatched"}, "must be fill or cut, got 'hatched'"),
    ],
)
def test_values_that_make_no_sense(values: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises((InputError, ExportError), match=message):
        exporters.Options(**values)
    for extension in exporters.takers(next(iter(values))).split():
        with pytest.raises((InputError, ExportError), match=message):
            exporters.write(flange(), tmp_path / f"part{extension}", thickness=1, **values)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("extension", "values", "message"),
    [
        (".step", {"kerf": 0.1}, "a .step file takes no kerf, only .dxf .svg files do"),
        (".stl", {"color": "red"}, "a .stl file takes no color, only .step .stp .3mf .glb .svg files do"),
        (".brep", {"name": "a"}, "takes no name"),
        (".dxf", {"tolerance": 0.1}, "takes no tolerance, only .stl .3mf .glb files do"),
        (".glb", {"schema": "AP214"}, "takes no schema, only .step .stp files do"),
        (".dxf", {"style": "cut"}, "takes no style, only .svg files do"),
    ],
)
def test_options_that_a_format_cannot_hold(
    extension: str, values: dict[str, Any], message: str, tmp_path: Path
) -> None:
    path = tmp_path / f"part{extension}"
    with pytest.raises(InputError) as caught:
        exporters.write(flange(), path, thickness=1, **values)
    assert str(caught.value).startswith(f"cannot write {path}: ")
    assert message in str(caught.value)
    with pytest.raises(InputError, match="takes no"):
        exporters.check(path, thickness=1, options=exporters.Options(**values))
    assert not list(tmp_path.iterdir())


# The command line


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program file of a ring of 20 and 10 mm across."""
    y, x = np.mgrid[:64, :64] + 0.5
    distance = np.hypot(x - 32, y - 32)
    cover = np.clip(20.5 - distance, 0, 1) * np.clip(distance - 9.5, 0, 1)
    path = tmp_path_factory.mktemp("ring") / "ring.json"
    fit_image(cover).save(path, width=20)
    return path


def run(*args: str) -> Any:
    return CliRunner().invoke(app, list(args))


@pytest.mark.usefixtures("offsets")
def test_export_gives_each_output_the_options_it_takes(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outputs = [word for e in (".step", ".3mf", ".glb", ".stl", ".dxf", ".svg") for word in ("-o", f"ring{e}")]
    options = ["--name", "Ring", "--color", "tomato", "--schema", "AP242", "--tolerance", "0.1", "--kerf", "0.2"]
    done = run("export", str(program), *outputs, *options, "--style", "cut", "--thickness", "2")
    assert done.exit_code == 0, done.output
    assert "closes" not in done.output
    ((name, (color,)),) = read_document(tmp_path / "ring.step")
    assert name == "Ring"
    assert color == pytest.approx(linear("tomato"), abs=1e-6)
    space = ezdxf.readfile("ring.dxf").modelspace()
    diameters = [2 * e.dxf.radius for e in space]
    assert diameters == pytest.approx([10 - 0.2, 20 + 0.2], abs=0.02)
    assert len(read_mesh(tmp_path / "ring.stl").faces) < 200
    assert "<title>Ring</title>" in Path("ring.svg").read_text()
    done = run("export", str(program), "-o", "ring.dxf", "--kerf", "11")
    assert "note: a kerf of 11 mm closes 1 hole\n" in done.stdout


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["-o", "a.step", "--kerf", "0.1"], "no output takes a kerf, only .dxf .svg files do"),
        (["-o", "a.json", "--color", "red"], "no output takes a color, only"),
        (["-o", "a.dxf", "--kerf", "-0.1"], "the kerf must be 0 or a positive number in mm, got -0.1"),
        (["-o", "a.stl", "--tolerance", "0"], "the chord tolerance of a mesh must be positive and finite, got 0 mm"),
        (["-o", "a.step", "--schema", "AP203"], "unknown STEP schema 'AP203': known are AP214, AP242"),
        (["-o", "a.glb", "--color", "blurple"], "a CSS name such as steelblue, got 'blurple'"),
        (["-o", "a.svg", "--style", "laser"], "must be fill or cut, got 'laser'"),
        (["-o", "nowhere/a.dxf"], "cannot write nowhere/a.dxf: No such file or directory"),
    ],
)
def test_export_refuses_in_one_sentence(
    program: Path, args: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run("export", str(program), *args)
    assert (done.exit_code, done.stdout) == (2, "")
    (sentence,) = done.stderr.splitlines()
    assert sentence.startswith("error: ")
    assert message in sentence
    assert not list(tmp_path.iterdir())


def test_help_names_every_extension() -> None:
    (option,) = Output.__metadata__  # type: ignore[attr-defined]
    assert option.help.split(": ")[1].split(";")[0].split() == [*exporters.EXTENSIONS, ".json", ".png"]


def test_quarter_arcs_stay_as_they_are() -> None:
    q = tan(pi / 8)
    path = loop_path(Loop(((1, 0), (0, 1), (-1, 0), (0, -1)), (q,) * 4))
    assert path.count("A") == 4
    assert loop_path(Circle((0, 0), 1).loop()).count("A") == 4
