"""Options of the formats: what each holds or refuses, from Python and from the command line."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from d4cad import exporters
from d4cad.cli import app
from d4cad.cli.options import Output
from d4cad.errors import ExportError, InputError
from d4cad.fitting import fit_image
from d4cad.sketch import Circle, Loop, Sketch


def flange() -> Sketch:
    """60 mm across: a bore of 20, four bolt holes of 5, a slot with semicircular ends, and a washer beside it."""
    bolts = [Circle((22 * x, 22 * y), 2.5).loop() for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    slot = Loop(((12, 12), (16, 16), (14, 18), (10, 14)), (0, 1, 0, 1))
    washer = [Circle((50, 0), 8).loop(), Circle((50, 0), 4).loop()]
    return Sketch.from_loops([Circle((0, 0), 30).loop(), Circle((0, 0), 10).loop(), *bolts, slot, *washer], "mm")


# Options


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
        (".dxf", {"tolerance": 0.1}, "takes no tolerance, only .stl .3mf .glb .scad files do"),
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


def test_export_gives_each_output_the_options_it_takes(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outputs = [word for e in (".step", ".3mf", ".glb", ".stl", ".dxf", ".svg") for word in ("-o", f"ring{e}")]
    options = ["--name", "Ring", "--color", "tomato", "--schema", "AP242", "--tolerance", "0.1", "--kerf", "11"]
    done = run("export", str(program), *outputs, *options, "--style", "cut", "--thickness", "2")
    assert done.exit_code == 0, done.output
    assert "note: a kerf of 11 mm closes 1 hole\n" in done.stdout
    step = Path("ring.step").read_text()
    assert "PRODUCT('Ring'" in step
    assert "COLOUR_RGB('',1.,0.3882" in step
    assert "AP242" in step
    (circle,) = ezdxf.readfile("ring.dxf").modelspace()
    assert circle.dxf.radius == pytest.approx(10 + 11 / 2, abs=0.01)
    assert len(trimesh.load("ring.stl").faces) < 200
    drawing = Path("ring.svg").read_text()
    assert "<title>Ring</title>" in drawing
    assert 'stroke="#FF6347"' in drawing
    assert b'"name":"Ring"' in Path("ring.glb").read_bytes()


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
