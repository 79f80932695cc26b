"""DXF and SVG read back by programs that are not ours, and measured; what a kerf does to them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from functools import cache, partial
from math import atan, hypot, pi, sin, tan
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad import exporters
from d4cad.errors import InputError
from d4cad.exporters import kerf as kerfs
from d4cad.exporters.dxf import write_dxf
from d4cad.exporters.names import printable
from d4cad.exporters.svg import loop_path, svg, write_svg
from d4cad.offsets import offset
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

SVG = "{http://www.w3.org/2000/svg}"


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


def test_kerf_makes_outlines_larger_and_holes_smaller(tmp_path: Path) -> None:
    exporters.write(washers(), tmp_path / "part.dxf", kerf=0.2)
    space = ezdxf.readfile(tmp_path / "part.dxf").modelspace()
    found = [(e.dxf.layer, round(2 * e.dxf.radius, 12)) for e in space]
    assert sorted(found) == [("INNER", 9.8), ("OUTER", 6.2), ("OUTER", 20.2)]
    exporters.write(washers(), tmp_path / "part.svg", kerf=0.2, style="cut")
    assert (tmp_path / "part.svg").read_text() == svg(offset(washers(), 0.1), style="cut", name="part")


def test_no_kerf_changes_nothing(tmp_path: Path) -> None:
    for extension in (".dxf", ".svg"):
        bare, zero = tmp_path / f"bare{extension}", tmp_path / f"zero{extension}"
        name = "same" if extension == ".svg" else None
        exporters.write(flange(), bare, name=name)
        exporters.write(flange(), zero, name=name, kerf=0)
        assert bare.read_bytes() == zero.read_bytes()


def test_holes_that_a_kerf_closes_are_told() -> None:
    """The parts of the washers are 1 mm apart, the hole is 10 mm across."""
    assert kerfs.losses(washers(), 0.9) == ()
    assert kerfs.losses(washers(), 9.9) == ("a kerf of 9.9 mm makes 2 parts 1",)
    assert kerfs.losses(washers(), 10.5) == ("a kerf of 10.5 mm closes 1 hole", "a kerf of 10.5 mm makes 2 parts 1")


def test_kerf_of_a_flange(tmp_path: Path) -> None:
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


def test_quarter_arcs_stay_as_they_are() -> None:
    q = tan(pi / 8)
    path = loop_path(Loop(((1, 0), (0, 1), (-1, 0), (0, -1)), (q,) * 4))
    assert path.count("A") == 4
    assert loop_path(Circle((0, 0), 1).loop()).count("A") == 4


@settings(max_examples=50)
@given(st.text())
def test_names_fit_into_xml(name: str) -> None:
    root = ET.fromstring(svg(Sketch.from_loops([Circle((0, 0), 1).loop()]), name=name))
    assert (root.findtext(f"{SVG}title") or "") == printable(name)
