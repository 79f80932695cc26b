"""STEP and meshes read back by programs that are not ours, and measured."""

from __future__ import annotations

import json
import struct
import xml.etree.ElementTree as ET
import zipfile
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from d4cad import exporters
from d4cad.errors import InputError
from d4cad.exporters.color import hexadecimal, linear, rgb
from d4cad.exporters.step import write_step
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


def flange() -> Sketch:
    """60 mm across: a bore of 20, four bolt holes of 5, a slot with semicircular ends, and a washer beside it."""
    bolts = [Circle((22 * x, 22 * y), 2.5).loop() for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    slot = Loop(((12, 12), (16, 16), (14, 18), (10, 14)), (0, 1, 0, 1))
    washer = [Circle((50, 0), 8).loop(), Circle((50, 0), 4).loop()]
    return Sketch.from_loops([Circle((0, 0), 30).loop(), Circle((0, 0), 10).loop(), *bolts, slot, *washer], "mm")


def washers() -> Sketch:
    """A ring of 20 and 10 mm across and a disc of 6 mm, 1 mm apart."""
    loops = [Circle((0, 0), 10).loop(), Circle((0, 0), 5).loop(), Circle((14, 0), 3).loop()]
    return Sketch.from_loops(loops, "mm")


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
@pytest.mark.parametrize("primitives", [0, 8, 40])
@pytest.mark.parametrize("tolerance", [0.2, None])
def test_meshes_are_closed_and_within_their_tolerance(
    primitives: int, extension: str, tolerance: float | None, tmp_path: Path
) -> None:
    sketch = generate(np.random.default_rng(5), primitives).scaled(27.3) if primitives else flange()
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
