"""DXF and SVG drawings become exact outlines; what cannot be used is refused in one sentence."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

from d4cad.deviation import drawn_apart
from d4cad.errors import D4cadError, GeometryError, InputError
from d4cad.exporters.svg import write_svg
from d4cad.importers import Drawing, read
from d4cad.loop import Circle
from d4cad.shapes import generate
from d4cad.sketch import Sketch


def svg(tmp_path: Path, body: str, root: str = 'width="100mm" height="50mm" viewBox="0 0 100 50"') -> Path:
    path = tmp_path / "drawing.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {root}>{body}</svg>', encoding="utf-8")
    return path


def dxf(tmp_path: Path, draw: Callable[[Any, Any], None], units: int = 4, version: str = "R2010") -> Path:
    """A DXF file; ``draw(modelspace, document)`` draws it. units: 4 mm, 1 inches, 0 none."""
    document = ezdxf.new(version)
    document.units = units
    draw(document.modelspace(), document)
    path = tmp_path / "drawing.dxf"
    document.saveas(path)
    return path


def areas(drawing: Drawing) -> list[float]:
    return sorted(face.area for face in drawing.sketch.faces)


# SVG


@pytest.mark.parametrize(
    ("body", "area", "primitives"),
    [
        ('<path d="M10 10 H30 V20 h-20 z"/>', 200, 4),
        ('<path d="M10 10 h20 a5 5 0 0 1 0 10 h-20 Z"/>', 200 + 12.5 * pi, 4),
        ('<path d="M10 10 A5 5 0 1 1 20 10 A5 5 0 0 1 10 10"/>', 25 * pi, 2),
        ('<rect x="10" y="5" width="20" height="10" rx="2"/>', 200 - (4 - pi) * 4, 8),
        ('<circle cx="20" cy="20" r="7"/>', 49 * pi, 2),
        ('<polygon points="10,10 20,10 20,20"/>', 50, 3),
        ('<polyline points="10,10 20,10 20,20"/>', 50, 3),
        ('<g transform="rotate(30)"><circle cx="20" cy="5" r="3" transform="scale(-2)"/></g>', 36 * pi, 2),
        ('<path transform="skewX(0) rotate(17)" d="M10 10 h20 a5 5 0 0 1 0 10 h-20 Z"/>', 200 + 12.5 * pi, 4),
        ('<defs><circle id="c" cx="9" cy="9" r="2"/></defs><use href="#c" x="20" y="20"/>', 4 * pi, 2),
    ],
)  # fmt: skip
def test_svg_lines_and_arcs_are_exact(tmp_path: Path, body: str, area: float, primitives: int) -> None:
    found = read(svg(tmp_path, body))
    assert found.sketch.area == pytest.approx(area, rel=1e-9)
    assert found.sketch.primitives == primitives
    assert found.notes == ()


@pytest.mark.parametrize(
    ("body", "area"),
    [
        ('<ellipse cx="30" cy="20" rx="20" ry="10"/>', 200 * pi),
        ('<circle cx="10" cy="10" r="5" transform="scale(3 1)"/>', 75 * pi),
        ('<path d="M10 40 A20 10 0 0 1 50 40 Z"/>', 100 * pi),
        ('<path d="M0 0 C 0 20 30 20 30 0 Z"/>', 30 * 20 * 0.6),
        ('<path d="M0 10 Q 15 30 30 10 T 60 10 V 40 H 0 Z"/>', 1800),
    ],
)
def test_svg_curves_are_fitted(tmp_path: Path, body: str, area: float) -> None:
    coarse, fine = (read(svg(tmp_path, body), tolerance=t).sketch for t in (0.1, 0.001))
    assert coarse.area == pytest.approx(area, abs=0.05 * coarse.length)
    assert fine.area == pytest.approx(area, abs=0.0005 * fine.length)
    assert coarse.primitives < fine.primitives < 80
    assert drawn_apart(coarse.loops, fine.loops) <= 0.101


def test_svg_four_beziers_of_a_circle_are_a_circle(tmp_path: Path) -> None:
    """The usual ones are 0.03 % of the radius off."""
    k = 5 * 0.5522847498
    body = (
        f'<path d="M25 20 C25 {20 + k} {20 + k} 25 20 25 S15 {20 + k} 15 20 S{20 - k} 15 20 15 '
        f'S25 {20 - k} 25 20 Z"/>'
    )  # fmt: skip
    (loop,) = read(svg(tmp_path, body)).sketch.loops
    assert loop.circle is not None
    assert loop.circle.radius == pytest.approx(5, abs=0.005)
    assert loop.circle.center == pytest.approx((20, 30), abs=1e-6)


@pytest.mark.parametrize(
    ("root", "size"),
    [
        ('width="100mm" height="50mm" viewBox="0 0 100 50"', 10),
        ('width="10cm" height="5cm" viewBox="0 0 100 50"', 10),
        ('width="4in" height="2in" viewBox="0 0 400 200"', 2.54),
        ('width="400" height="200"', 10 * 25.4 / 96),
        ('viewBox="0 0 400 200"', 10 * 25.4 / 96),
        ("", 10 * 25.4 / 96),
    ],
)
def test_svg_units(tmp_path: Path, root: str, size: float) -> None:
    found = read(svg(tmp_path, '<rect x="10" y="10" width="10" height="10"/>', root))
    xmin, ymin, xmax, ymax = found.sketch.bounds
    assert (xmax - xmin, ymax - ymin) == pytest.approx((size, size), rel=1e-12)
    assert xmin == pytest.approx(size, rel=1e-12)
    assert any("no unit" in note for note in found.notes) == ("m" not in root and "in" not in root)


def test_svg_y_points_up_from_the_foot_of_a_page_or_the_own_origin(tmp_path: Path) -> None:
    body = '<rect x="10" y="40" width="20" height="8"/>'
    assert read(svg(tmp_path, body)).sketch.bounds == pytest.approx((10, 2, 30, 10), abs=1e-9)
    elsewhere = read(svg(tmp_path, body, 'width="50mm" height="50mm" viewBox="5 20 100 100"'))
    assert elsewhere.sketch.bounds == pytest.approx((5, -24, 15, -20), abs=1e-9)


def test_svg_fill_rules_and_holes(tmp_path: Path) -> None:
    same = "M0 0 h30 v30 h-30 z M10 10 h10 v10 h-10 z"
    opposite = "M0 0 h30 v30 h-30 z M10 10 v10 h10 v-10 z"
    assert read(svg(tmp_path, f'<path d="{same}"/>')).sketch.area == pytest.approx(900)
    assert read(svg(tmp_path, f'<path d="{opposite}"/>')).sketch.area == pytest.approx(800)
    assert read(svg(tmp_path, f'<path fill-rule="evenodd" d="{same}"/>')).sketch.area == pytest.approx(800)
    assert read(svg(tmp_path, f'<path style="fill-rule:evenodd" d="{same}"/>')).sketch.area == pytest.approx(800)
    two = '<rect width="30" height="30"/><circle cx="15" cy="15" r="5"/>'
    assert read(svg(tmp_path, two)).sketch.area == pytest.approx(900 - 25 * pi)


def test_svg_strokes_join_to_outlines(tmp_path: Path) -> None:
    lines = [(0, 0, 20, 0), (20, 0, 20, 10), (0, 10, 20, 10.001), (0, 0, 0, 10)]
    body = "".join(f'<line x1="{a}" y1="{b}" x2="{c}" y2="{d}" stroke="red" fill="none"/>' for a, b, c, d in lines)
    found = read(svg(tmp_path, body))
    assert found.sketch.area == pytest.approx(200, abs=0.02)
    assert found.sketch.primitives == 4
    assert found.notes == ("gaps of up to 0.001 mm between strokes were closed",)


def test_svg_what_is_no_outline_is_left_out(tmp_path: Path) -> None:
    body = (
        '<rect width="100" height="50" fill="white"/><circle cx="20" cy="20" r="7"/><text x="1" y="9">hi</text>'
        '<g display="none"><circle cx="60" cy="20" r="7"/></g><circle cx="70" cy="20" r="3" fill="none"/>'
    )
    found = read(svg(tmp_path, body))
    assert found.sketch.area == pytest.approx(49 * pi)
    assert found.notes == ("left out, as no outline: 1 text", "white background left out")


@pytest.mark.parametrize("seed", range(3))
def test_svg_reads_back_what_was_written(tmp_path: Path, seed: int) -> None:
    true = generate(np.random.default_rng(seed), 40).scaled(30)
    write_svg(true, tmp_path / "part.svg")
    found = read(tmp_path / "part.svg").sketch
    assert found.area == pytest.approx(true.area, rel=1e-9)
    assert found.primitives == true.primitives
    assert len(found.faces) == len(true.faces)
    assert drawn_apart(found.loops, true.loops) < 1e-7


# DXF


def test_dxf_closed_entities_are_exact(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        space.add_lwpolyline([(0, 0, 0), (10, 0, 1), (10, 5, 0), (0, 5, 0)], format="xyb", close=True)
        space.add_circle((5, 2.5), 1)
        space.add_polyline2d([(20, 0, 0), (30, 0, -0.3), (30, 5, 0)], format="xyb", close=True)
        space.add_ellipse((40, 0), (0, 3), 1)

    found = read(dxf(tmp_path, draw))
    sector = 25 / 8 * ((1 + 0.09) ** 2 * np.arctan(0.3) - 0.3 * 0.91) / 0.09
    assert areas(found) == pytest.approx([25 - sector, 9 * pi, 50 + 6.25 * pi / 2 - pi], rel=1e-12)
    assert found.notes == ()
    assert found.segments == 4 + 2 + 3 + 1


@pytest.mark.parametrize(("units", "factor", "noted"), [(4, 1, False), (1, 25.4, False), (5, 10, False), (0, 1, True)])
def test_dxf_units(tmp_path: Path, units: int, factor: float, noted: bool) -> None:
    found = read(dxf(tmp_path, lambda space, _: space.add_circle((3, 0), 2), units))
    assert found.sketch.area == pytest.approx(4 * pi * factor**2, rel=1e-12)
    assert found.sketch.bounds[0] == pytest.approx(factor)
    assert ("the drawing states no unit: mm assumed" in found.notes) == noted


def test_dxf_loose_strokes_join(tmp_path: Path) -> None:
    """A slot of lines and arcs in any order and direction, two of them drawn twice, one the other way."""

    def draw(space: Any, document: Any) -> None:
        space.add_line((0, 0), (10, 0))
        space.add_line((0, 4), (10, 4))
        space.add_arc((10, 2), 2, 270, 90)
        space.add_arc((0, 2), 2, 90, 270)
        space.add_line((10, 4), (0, 4))
        space.add_arc((0, 2), 2, 90, 270)

    found = read(dxf(tmp_path, draw))
    assert found.sketch.area == pytest.approx(40 + 4 * pi, rel=1e-12)
    assert found.sketch.primitives == 4
    assert found.notes == ("2 strokes drawn twice counted once",)


def test_dxf_an_outline_drawn_twice_counts_once(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        for _ in range(2):
            space.add_lwpolyline([(0, 0), (10, 0), (10, 5)], close=True)
        space.add_lwpolyline([(10, 5), (10, 0), (0, 0)], close=True)

    found = read(dxf(tmp_path, draw))
    assert found.sketch.area == pytest.approx(25)
    assert found.notes == ("2 outlines drawn twice counted once",)


def test_dxf_splines_and_ellipses_are_fitted(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        space.add_ellipse((0, 0), (10, 0), 0.5)
        t = np.linspace(0, 2 * pi, 25)
        space.add_spline([(40 + 8 * cos(a), 8 * sin(a)) for a in t])
        space.add_ellipse((70, 0), (10, 0), 0.5, 0, pi)
        space.add_line((60, 0), (80, 0))

    found = read(dxf(tmp_path, draw), tolerance=0.005).sketch
    ellipse, disc, half = sorted(found.faces, key=lambda face: face.outer.bounds[0])
    assert ellipse.area == pytest.approx(50 * pi, abs=0.1)
    assert disc.area == pytest.approx(64 * pi, abs=0.2)
    assert half.area == pytest.approx(25 * pi, abs=0.1)
    assert found.primitives < 60


def test_dxf_a_closed_spline_ends_where_it_begins(tmp_path: Path) -> None:
    """Its knots reach beyond the curve; ezdxf's own flattening runs through all of them, to points far off."""
    square = [(0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (30.0, 20.0, 0.0), (0.0, 20.0, 0.0)]

    def draw(space: Any, document: Any) -> None:
        space.add_spline().set_closed(square)

    found = read(dxf(tmp_path, draw))
    assert found.segments == 4
    assert found.sketch.area == pytest.approx(61 * 600 / 90, rel=1e-4)  # of the uniform cubic B-spline
    assert found.sketch.bounds == pytest.approx((1.2524, 0.8349, 28.7476, 19.1651), abs=0.01)


def test_dxf_a_spline_circle_is_one_circle(tmp_path: Path) -> None:
    """The rational spline of degree 2 is a circle to the last digit."""

    def draw(space: Any, document: Any) -> None:
        corner = np.sqrt(0.5)
        square = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
        space.add_rational_spline(
            [(6 * x + 1, 6 * y) for x, y in square],
            weights=[1, corner, 1, corner, 1, corner, 1, corner, 1],
            degree=2,
            knots=[0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
        )

    (loop,) = read(dxf(tmp_path, draw)).sketch.loops
    assert loop.circle is not None
    assert loop.circle.radius == pytest.approx(6, abs=1e-6)
    assert loop.circle.center == pytest.approx((1, 0), abs=1e-6)


def test_dxf_blocks_are_followed(tmp_path: Path) -> None:
    """Mirrored, turned, scaled, stretched, in a grid, and within each other."""

    def draw(space: Any, document: Any) -> None:
        dee = document.blocks.new("dee")
        dee.add_arc((0, 0), 1, 0, 180)
        dee.add_line((1, 0), (-1, 0))
        pair = document.blocks.new("pair")
        pair.add_blockref("dee", (0, 0))
        pair.add_blockref("dee", (0, -1), dxfattribs={"yscale": -1})
        space.add_blockref("dee", (0, 20), dxfattribs={"xscale": -2, "yscale": 2, "rotation": 30})
        space.add_blockref("dee", (20, 20), dxfattribs={"xscale": 2, "yscale": 1})
        space.add_blockref("pair", (40, 20))
        space.add_blockref(
            "dee", (0, 0), dxfattribs={"column_count": 3, "row_count": 2, "column_spacing": 5, "row_spacing": 4}
        )

    found = read(dxf(tmp_path, draw), tolerance=0.001)
    assert areas(found)[:8] == pytest.approx([pi / 2] * 8, rel=1e-9)
    assert areas(found)[8:] == pytest.approx([pi, 2 * pi], abs=0.005)


def test_dxf_entities_seen_from_behind(tmp_path: Path) -> None:
    """An extrusion of -z turns x round: an arc runs the other way."""
    behind = {"extrusion": (0, 0, -1)}

    def draw(space: Any, document: Any) -> None:
        space.add_arc((-10, 0), 2, 0, 90, dxfattribs=behind)
        space.add_line((10, 0), (10, 2))
        space.add_line((10, 0), (8, 0))
        space.add_lwpolyline([(0, 0, 0), (-4, 0, 0.5), (-4, 3, 0)], format="xyb", close=True, dxfattribs=behind)

    found = read(dxf(tmp_path, draw))
    quarter, bowed = sorted(found.sketch.faces, key=lambda face: -face.outer.bounds[0])
    assert quarter.area == pytest.approx(pi, rel=1e-9)
    assert quarter.outer.bounds == pytest.approx((8, 0, 10, 2))
    assert bowed.outer.bounds == pytest.approx((0, 0, 4, 3), abs=1e-9)


def test_dxf_layers(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        for name, x in (("cut", 0), ("mark", 10), ("hidden", 20)):
            document.layers.add(name)
            space.add_circle((x, 0), 1, dxfattribs={"layer": name})
        document.layers.get("hidden").off()

    path = dxf(tmp_path, draw)
    assert len(read(path).sketch.faces) == 2
    assert read(path, layers=["CUT"]).sketch.bounds == pytest.approx((-1, -1, 1, 1))
    with pytest.raises(InputError, match=r"no layer 'cuts', only .*cut.*mark"):
        read(path, layers=["cuts"])


def test_dxf_what_is_no_outline_is_left_out(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        space.add_circle((0, 0), 1)
        space.add_text("hi")
        space.add_text("ho")
        space.add_linear_dim(base=(0, 2), p1=(0, 0), p2=(3, 0)).render()
        space.add_circle((5, 0), 1, dxfattribs={"extrusion": (1, 0, 0)})

    found = read(dxf(tmp_path, draw))
    assert found.sketch.area == pytest.approx(pi)
    assert found.notes == ("left out, as no outline: 1 CIRCLE out of the plane, 1 DIMENSION, 2 TEXT",)


@pytest.mark.parametrize("version", ["R12", "R2000", "R2018"])
def test_dxf_versions(tmp_path: Path, version: str) -> None:
    def draw(space: Any, document: Any) -> None:
        space.add_polyline2d([(0, 0, 0), (10, 0, 1), (10, 5, 0)], format="xyb", close=True)

    assert read(dxf(tmp_path, draw, version=version)).sketch.area == pytest.approx(25 + 6.25 * pi / 2)


def test_dxf_binary(tmp_path: Path) -> None:
    document = ezdxf.new()
    document.units = 4
    document.modelspace().add_circle((0, 0), 3)
    document.saveas(tmp_path / "binary.dxf", fmt="bin")
    assert read(tmp_path / "binary.dxf").sketch.area == pytest.approx(9 * pi)


# What cannot be used


def test_an_open_outline_says_where_and_how_wide(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        space.add_lwpolyline([(0, 0), (10, 0), (10, 5), (0.3, 0.4)])

    path = dxf(tmp_path, draw)
    with pytest.raises(
        GeometryError, match=r"open at \(0, 0\): .* at \(0\.3, 0\.4\), is 0\.5 mm away; ends up to 0\.01"
    ):
        read(path)
    assert read(path, gap=0.6).sketch.primitives == 3


def test_a_branch_says_where(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        space.add_lwpolyline([(0, 0), (10, 0), (10, 5), (0, 0)])
        for angle in (0, 120, 240):
            space.add_line((30, 0), (30 + cos(radians(angle)), sin(radians(angle))))

    with pytest.raises(GeometryError, match=r"3 strokes meet at \(30, 0\)"):
        read(dxf(tmp_path, draw))


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "no closed outline"),
        ('<path d="M0 0 L20 20 L20 0 L0 10 Z"/>', r"crosses or touches itself at \(6.66667, 43.3333\)"),
        ('<path d="M0 0 h10 v10 h-10 z M10 0 h10 v10 h-10 z"/>', "crosses or touches loop 1"),
        ('<path d="M0 0 L10 nan L10 0 Z"/>', "neither a command nor a number|damaged"),
        ('<path d="M0 0 L10 foo L10 0 Z"/>', "neither a command nor a number|damaged"),
        ('<path d="M0 0 L1e400 0 L0 1 Z"/>', "not finite"),
        ('<path d="M0 0 L1e12 0 L0 1e12 Z"/>', "coordinates of 1e\\+12 mm, expected at most 1e\\+08"),
        ('<path d="M5 5 L5 5 L5 5 Z"/>', "no closed outline"),
        ('<path d="M5 5 L9 9 Z"/>', "encloses no area"),
        ('<rect x="5" y="5" width="0" height="9"/>', "no closed outline"),
        ('<path fill="none" stroke="red" d="M0 0 H 10 V 10"/>', "open at"),
    ],
)
def test_svg_drawings_that_cannot_be_used(tmp_path: Path, body: str, message: str) -> None:
    with pytest.raises(D4cadError, match=message):
        read(svg(tmp_path, body))


@pytest.mark.parametrize("name", ["drawing.svg", "drawing.dxf"])
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"  \n",
        b"hello",
        b"<html></html>",
        b"\x00\xff\x80" * 100,
        b"  0\nSECTION\n  2\nENTITIES\n",
        b'<svg viewBox="',
    ],
)
def test_files_that_are_no_drawings(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"{name} is not a usable drawing: "):
        read(path)


def test_a_truncated_dxf(tmp_path: Path) -> None:
    path = dxf(tmp_path, lambda space, _: space.add_circle((0, 0), 1))
    whole = path.read_bytes()
    for share in (0.1, 0.5, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(D4cadError, match="is not a usable drawing"):
            read(path)


@pytest.mark.parametrize("value", ["nan", "1e400", "x"])
def test_a_dxf_with_a_wrong_number(tmp_path: Path, value: str) -> None:
    path = dxf(tmp_path, lambda space, _: space.add_circle((0, 0), 1.2345))
    path.write_text(path.read_text().replace("1.2345", value))
    with pytest.raises(D4cadError, match=r"not finite|damaged"):
        read(path)


def test_blocks_that_hold_each_other(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        document.blocks.new("a").add_blockref("b", (1, 0))
        document.blocks.new("b").add_blockref("a", (1, 0))
        space.add_blockref("a", (0, 0))

    with pytest.raises(InputError, match="nested over 16 deep"):
        read(dxf(tmp_path, draw))


def test_requests_that_cannot_be_met(tmp_path: Path) -> None:
    path = svg(tmp_path, '<circle cx="20" cy="20" r="7"/>')
    with pytest.raises(InputError, match="tolerance must be a positive number in mm, got 0"):
        read(path, tolerance=0)
    with pytest.raises(InputError, match="gap must be a positive number in mm, got nan"):
        read(path, gap=float("nan"))
    with pytest.raises(InputError, match="layers can be chosen in DXF drawings only"):
        read(path, layers=["cut"])
    with pytest.raises(InputError, match=r"known drawings are \.dxf \.svg, got \.pdf"):
        read(tmp_path / "part.pdf")
    with pytest.raises(InputError, match="there is no drawing"):
        read(tmp_path / "none.svg")
    (tmp_path / "folder.svg").mkdir()
    with pytest.raises(InputError, match="cannot read"):
        read(tmp_path / "folder.svg")


def test_overlapping_shapes_are_united_or_refused(tmp_path: Path) -> None:
    path = svg(tmp_path, '<rect width="20" height="10"/><circle cx="20" cy="5" r="3"/>')
    try:
        found = read(path).sketch
    except GeometryError as error:
        assert "overlap at" in str(error)  # noqa: PT017
        return
    assert found.area == pytest.approx(200 + 9 * pi / 2)


def test_the_result_is_a_sketch_in_mm(tmp_path: Path) -> None:
    found = read(svg(tmp_path, '<circle cx="20" cy="20" r="7"/>')).sketch
    assert found == Sketch.from_loops(found.loops, "mm")
    assert found.loops[0].circle == Circle((pytest.approx(20), pytest.approx(30)), pytest.approx(7))  # type: ignore[arg-type]
