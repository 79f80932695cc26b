"""`d4cad simplify`, and drawings where programs are taken."""

from __future__ import annotations

import json
from math import pi
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from d4cad.cli import app
from d4cad.deviation import drawn_apart
from d4cad.errors import InputError
from d4cad.fitting import fit_image
from d4cad.importers import read
from d4cad.placement import Placement
from d4cad.programs import load_program
from d4cad.reduction import length, reduced
from d4cad.shapes import generate


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def d4cad(*args: str) -> Result:
    return CliRunner().invoke(app, list(args))


def refused(*args: str) -> str:
    """The one sentence with which a command is refused; it leaves nothing behind."""
    before = sorted(Path.cwd().rglob("*"))
    result = d4cad(*args)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    (sentence,) = result.stderr.splitlines()
    assert sentence.startswith("error: ")
    assert sorted(Path.cwd().rglob("*")) == before
    return sentence


def messy(name: str = "messy.svg") -> str:
    """A plate of 60 x 40 with round corners and a hole, as one polygon of hundreds of points and four Beziers."""
    t = np.linspace(0, pi / 2, 60)
    centres = [(54, 34), (6, 34), (6, 6), (54, 6)]
    points = [
        (x + 6 * np.cos(a + k * pi / 2), y + 6 * np.sin(a + k * pi / 2)) for k, (x, y) in enumerate(centres) for a in t
    ]
    k = 8 * 0.5522847498
    hole = (
        f"M38 20C38 {20 + k} {30 + k} 28 30 28C{30 - k} 28 22 {20 + k} 22 20"
        f"C22 {20 - k} {30 - k} 12 30 12C{30 + k} 12 38 {20 - k} 38 20Z"
    )
    outer = "M" + "L".join(f"{x:.9f} {y:.9f}" for x, y in points) + "Z"
    Path(name).write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="40mm" viewBox="0 0 60 40">'
        f'<path fill-rule="evenodd" d="{outer} {hole}"/></svg>'
    )
    return name


def test_a_messy_drawing_becomes_a_clean_one() -> None:
    result = d4cad("simplify", messy(), "--tolerance", "0.05mm", "-o", "clean.svg", "-o", "clean.json")
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    lines = result.stdout.splitlines()
    assert lines[0].startswith("244 segments, ")
    assert lines[0].endswith("-> 10 primitives (4 lines, 4 arcs, 1 circle of 2 arcs)")
    assert lines[1].startswith("60 x 40 mm, at most 0.0")
    assert lines[3:] == ["wrote clean.svg", "wrote clean.json"]
    clean = read("clean.svg").sketch
    assert clean.primitives == 10
    assert clean.area == pytest.approx(2400 - (4 - pi) * 36 - 64 * pi, abs=0.1)
    assert drawn_apart(clean.loops, read("messy.svg").sketch.loops) <= 0.05
    assert load_program("clean.json").sketch().primitives == 10


def test_the_report_as_json() -> None:
    result = d4cad("simplify", messy(), "-t", "0.002in", "--json", "--preview", "look.png")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert facts["segments"] == 244
    assert facts["primitives"] == 10
    assert (facts["lines"], facts["arcs"], facts["circles"], facts["faces"], facts["holes"]) == (4, 4, 1, 1, 1)
    assert facts["tolerance_mm"] == pytest.approx(0.0508)
    assert 0 < facts["deviation_mm"] <= facts["tolerance_mm"]
    assert facts["area_mm2"] == pytest.approx(facts["area_before_mm2"], rel=1e-3)
    assert facts["files"] == ["look.png"]
    with Image.open("look.png") as picture:
        colours = {tuple(c) for c in np.asarray(picture.convert("RGB")).reshape(-1, 3).tolist()}
    assert {(0x1D, 0x5F, 0xA8), (0xD1, 0x49, 0x5B)} <= colours  # lines and arcs are there


def test_a_layer_of_a_dxf_drawing() -> None:
    document = ezdxf.new()
    document.units = 4
    t = np.linspace(0, 2 * pi, 200, endpoint=False)
    for name, radius in (("cut", 10.0), ("mark", 5.0)):
        document.layers.add(name)
        document.modelspace().add_lwpolyline(
            np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1).tolist(), close=True, dxfattribs={"layer": name}
        )
    document.saveas("rings.dxf")
    assert reduced("rings.dxf", "0.1mm").after.area == pytest.approx(75 * pi)
    (loop,) = reduced("rings.dxf", "0.1mm", layers=["cut"]).after.loops
    assert loop.circle is not None
    assert loop.circle.radius == pytest.approx(10)
    assert d4cad("simplify", "rings.dxf", "--layer", "mark", "-o", "out.svg").exit_code == 0
    assert "no layer 'none'" in refused("simplify", "rings.dxf", "--layer", "none", "-o", "no.svg")


def test_a_program_is_simplified_in_its_place() -> None:
    load_program(messy()).save("messy.json")
    found = reduced("messy.json", 0.05)
    assert found.before.bounds == pytest.approx((0, 0, 60, 40), abs=1e-9)
    assert found.after.primitives == 10
    assert found.after.bounds == pytest.approx((0, 0, 60, 40), abs=0.05)


def test_simplifying_again_changes_nothing() -> None:
    assert d4cad("simplify", messy(), "-o", "once.json").exit_code == 0
    again = reduced("once.json", 0.05)
    assert again.before == again.after
    assert again.deviation < 1e-12


@pytest.mark.parametrize(
    ("text", "mm"),
    [("0.05", 0.05), ("0.05mm", 0.05), (" 5e-2 mm ", 0.05), ("0.002in", 0.0508), ("2px", 0.4), ("1cm", 10), (0.3, 0.3)],
)
def test_lengths(text: str | float, mm: float) -> None:
    assert length(text, 0.2) == pytest.approx(mm)


@pytest.mark.parametrize("text", ["", "mm", "-1mm", "0", "nan", "inf", "1 ft", "1e999mm", "--5", "1e", -2.0])
def test_lengths_that_are_none(text: str | float) -> None:
    with pytest.raises(InputError, match="tolerance must be a positive length such as"):
        length(text, 0.2)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["none.svg"], "there is no drawing none.svg"),
        (["messy.png"], "known drawings are .dxf .svg, got .png"),
        (["messy.svg", "-t", "0"], "tolerance must be a positive length"),
        (["messy.svg", "--gap", "0"], "the gap must be a positive number"),
        (["messy.svg", "--layer", "cut"], "layers can be chosen in DXF drawings only"),
        (["messy.svg", "-o", "part.xyz"], "known extensions are"),
        (["messy.svg", "-o", "part.png"], "a preview needs the picture"),
        (["messy.svg", "-o", "messy.svg"], "it is the drawing"),
        (["messy.svg", "-o", "none/part.svg"], "cannot write none/part.svg"),
        (["messy.svg", "--preview", "look.gif"], "a preview is .png or .svg"),
        (["messy.svg", "-o", "part.stl", "--thickness", "0"], "the thickness must be a positive number"),
        (["empty.svg", "-o", "part.svg"], "it is empty"),
        (["broken.svg", "-o", "part.svg"], "it is not SVG"),
        (["garbage.dxf", "-o", "part.svg"], "it is not DXF"),
        (["open.svg", "-o", "part.svg"], "its outline is open at (0, 0)"),
        (["crossing.svg", "-o", "part.svg"], "crosses or touches itself"),
        (["broken.json", "-o", "part.svg"], "it is not JSON"),
    ],
)
def test_requests_that_cannot_be_met(args: list[str], message: str) -> None:
    messy()
    root = '<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="40mm" viewBox="0 0 60 40">'
    Path("empty.svg").write_text("")
    Path("broken.svg").write_text(f'{root}<path d="M0 0')
    Path("garbage.dxf").write_bytes(bytes(range(256)) * 9)
    Path("open.svg").write_text(f'{root}<path fill="none" stroke="red" d="M0 40 H10 V20"/></svg>')
    Path("crossing.svg").write_text(f'{root}<path d="M0 0 L20 20 L20 0 L0 10 Z"/></svg>')
    Path("broken.json").write_text("{")
    assert message in refused("simplify", *args)


# Drawings as programs


def test_a_drawing_is_a_program_in_its_own_place() -> None:
    true = generate(np.random.default_rng(5), 40).scaled(25).translated(1234.5, -77.25)
    document = ezdxf.new()
    document.units = 4
    for loop in true.loops:
        corners = [(x, y, b) for (x, y), b in zip(loop.points, loop.bulges, strict=True)]
        document.modelspace().add_lwpolyline(corners, format="xyb", close=True)
    document.saveas("part.dxf")
    fit = load_program("part.dxf")
    fit.save("part.json")
    placed = read("part.dxf").sketch
    assert placed.primitives == true.primitives
    for found in (fit.sketch(), load_program("part.json").sketch()):
        assert found.unit == "mm"
        ours = np.array([p for loop in found.loops for p in loop.points])
        assert ours == pytest.approx(np.array([p for loop in placed.loops for p in loop.points]), abs=1e-11)
        assert [loop.bulges for loop in found.loops] == [loop.bulges for loop in placed.loops]
    xmin, ymin, xmax, ymax = fit.outline.bounds
    assert 0.45 * 3 <= max(xmax - xmin, ymax - ymin) <= 0.9 * 3
    assert fit.coverage.mean() * 9 == pytest.approx(fit.outline.area, rel=1e-3)
    corner = fit.sketch(width=10, origin="corner").bounds
    assert (corner[0], corner[1], corner[2]) == pytest.approx((0, 0, 10))


def test_export_takes_a_drawing() -> None:
    result = d4cad("export", messy(), "-o", "part.svg", "-o", "part.stl", "--thickness", "4")
    assert result.exit_code == 0, result.output
    assert " dB" not in result.stdout
    assert "stopped" not in result.stdout
    assert read("part.svg").sketch.area == pytest.approx(read("messy.svg").sketch.area, rel=1e-8)
    assert "is not a usable drawing" in refused(
        "export", str(Path("bad.svg").write_text("x") and "bad.svg"), "-o", "a.svg"
    )


def test_a_fit_can_start_from_a_drawing() -> None:
    """The drawing is put onto the picture's shape, whatever the sizes of both."""
    fine = (np.arange(96 * 8) + 0.5) / 8 - 48
    x, y = np.meshgrid(fine, fine)
    inside = (abs(x - 3) < 30) & (abs(y) < 20) & (np.hypot(x, y) > 9)
    picture = inside.reshape(96, 8, 96, 8).mean(axis=(1, 3))
    Path("plate.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="600mm" height="400mm" viewBox="0 0 600 400">'
        '<rect width="600" height="400"/><circle cx="270" cy="200" r="80"/></svg>'
    )
    found = fit_image(picture, init="plate.svg")
    assert found.primitives == 6
    assert found.psnr > 40
    assert found.history[0].primitives == 6


def test_only_a_drawing_has_an_origin_of_its_own() -> None:
    square = generate(np.random.default_rng(0), 8)
    fit = load_program(messy())
    with pytest.raises(InputError, match="only a part that was drawn"):
        Placement(origin="drawing").place(square, fit.canvas)
    assert Placement(scale=fit.made.scale, origin="center", zero=fit.made.zero).place(
        fit.outline, fit.canvas
    ).bounds == pytest.approx((-30, -20, 30, 20), abs=1e-9)


@pytest.mark.parametrize("zero", ["x", [1.0], [1.0, "y"], [True, 0.0], 3])
def test_a_program_file_with_a_wrong_origin(zero: object) -> None:
    load_program(messy()).save("part.json")
    lines = Path("part.json").read_text().splitlines()
    document = json.loads("\n".join(lines))
    document["settings"]["placement"]["zero"] = zero
    Path("part.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="its placement has a wrong zero"):
        load_program("part.json")
