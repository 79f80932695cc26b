"""The `d4cad` command: outputs, summaries, exit codes, and one sentence for every bad input."""

from __future__ import annotations

import errno
import json
import os
import signal
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from d4cad import __version__
from d4cad.cli import app
from d4cad.descent import Record
from d4cad.programs import load_program
from d4cad.progress import line

SIDE = 96


@pytest.fixture
def plate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A picture of a 60 x 40 pixel plate with a hole, in the working directory."""
    monkeypatch.chdir(tmp_path)
    fine = (np.arange(SIDE * 8) + 0.5) / 8 - SIDE / 2
    x, y = np.meshgrid(fine, fine)
    inside = (abs(x) < 30) & (abs(y) < 20) & (np.hypot(x, y) > 9)
    cover = inside.reshape(SIDE, 8, SIDE, 8).mean(axis=(1, 3))
    Image.fromarray(np.round(cover * 255).astype(np.uint8)).save("plate.png")
    return "plate.png"


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


def test_every_output_and_a_summary(plate: str) -> None:
    names = ["part.stl", "part.json", "part.svg", "part.png"]
    args = [word for name in names for word in ("-o", name)]
    result = d4cad("fit", plate, *args, "--preview", "look.svg", "--width", "60", "--thickness", "4")
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    lines = result.stdout.splitlines()
    assert lines[0].startswith("6 primitives (4 lines, 1 circle of 2 arcs), ")
    assert lines[1].startswith("60 x 40")
    assert lines[2].startswith("snapped ")
    assert "no rewrite pays" in lines[4]
    assert lines[5:] == [f"wrote {name}" for name in [*names, "look.svg"]]
    assert sorted(os.listdir()) == sorted([*names, "look.svg", "plate.png"])
    assert load_program("part.json").made.thickness == 4


def test_a_step_file(plate: str) -> None:
    pytest.importorskip("OCP")
    result = d4cad("fit", plate, "-o", "part.step", "-o", "part.brep", "--dpi", "254", "--origin", "center")
    assert result.exit_code == 0, result.output
    assert "note: no thickness was given: 3 mm assumed" in result.stdout
    assert "CYLINDRICAL_SURFACE" in Path("part.step").read_text()


def test_json_is_one_object_and_nothing_else(plate: str) -> None:
    result = d4cad("fit", plate, "--json", "-o", "part.svg", "--scale", "0.5", "--seed", "4")
    assert result.exit_code == 0
    assert result.stderr == ""
    facts = json.loads(result.stdout)
    assert (facts["primitives"], facts["lines"], facts["arcs"], facts["circles"]) == (6, 4, 0, 1)
    assert (facts["faces"], facts["holes"], facts["seed"]) == (1, 1, 4)
    assert facts["size_mm"] == pytest.approx([30, 20], rel=1e-3)
    assert facts["psnr"] > 45
    assert facts["stop"] == "stalled"
    assert facts["files"] == ["part.svg"]


def test_what_was_snapped_is_told(plate: str) -> None:
    said = d4cad("fit", plate, "--width", "60").stdout
    assert "snapped" in said
    assert "horizontal" in said
    assert "the largest move is" in said
    facts = json.loads(d4cad("fit", plate, "--width", "60", "--json").stdout)
    assert facts["snap"]["counts"]["horizontal"] == 2
    assert facts["snap"]["largest_move_px"] < 0.2
    assert facts["dimensions"]["hole_diameter"] == pytest.approx(18, abs=1e-9)
    assert {"kind": "height", "refs": [], "value": pytest.approx(40)} in facts["relations"]


def test_snapping_can_be_left_out(plate: str) -> None:
    assert "snapped" not in d4cad("fit", plate, "--width", "60", "--no-snap").stdout
    facts = json.loads(d4cad("fit", plate, "--no-snap", "--json").stdout)
    assert (facts["snap"], facts["relations"], facts["dimensions"]) == (None, [], {})


def test_quiet_prints_nothing(plate: str) -> None:
    result = d4cad("fit", plate, "-q", "-o", "part.json")
    assert (result.exit_code, result.output) == (0, "")


def test_export_keeps_what_the_program_file_says(plate: str) -> None:
    assert (
        d4cad("fit", plate, "-o", "part.json", "--width", "60", "--thickness", "4", "--origin", "center").exit_code == 0
    )
    result = d4cad("export", "part.json", "-o", "again.json", "-o", "part.stl", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["size_mm"] == pytest.approx([60, 40], rel=1e-3)
    assert Path("again.json").read_text() == Path("part.json").read_text()
    result = d4cad("export", "part.json", "-o", "again.json", "--width", "30", "--origin", "corner")
    assert result.stdout.splitlines()[1].startswith("30 x 20")
    (loop, _) = json.loads(Path("again.json").read_text())["loops"]
    assert min(edge["start"][0] for edge in loop) == 0


def test_going_on_from_a_program_file_in_place(plate: str) -> None:
    assert d4cad("fit", plate, "-o", "part.json", "--max-time", "0.000001").exit_code == 0
    assert load_program("part.json").stop.name == "TIME"
    result = d4cad("fit", plate, "--init", "part.json", "-o", "part.json")
    assert result.stdout.startswith("6 primitives")
    assert load_program("part.json").settings["init"] == "program"


def test_threshold_and_invert(plate: str) -> None:
    facts = json.loads(d4cad("fit", plate, "--json", "--threshold", "0.5", "--invert", "--scale", "1").stdout)
    assert facts["size_mm"] == pytest.approx([SIDE, SIDE], abs=0.2)
    assert (facts["faces"], facts["holes"]) == (2, 1)


def test_bench_prints_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("data").mkdir()
    half = {"type": "arc", "start": [0.7, 0.1], "end": [-0.7, 0.1], "bulge": 1.0}
    disc = [[half, {**half, "start": half["end"], "end": half["start"]}]]
    Path("data/discs.json").write_text(json.dumps([{"index": 3, "loops": disc}]))
    result = d4cad("bench", "data", "--out", "found")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[1].split()[:3] == ["discs", "1", "100.0%"]
    assert os.listdir("found") == ["discs_003.json"]
    assert "no method 'quick'" in refused("bench", "data", "--out", "other", "--method", "quick")
    assert refused("bench", "found/discs_003.json", "--out", "other").endswith("has none")


def nothing(path: Path) -> None:
    """No file at all."""


def folder(path: Path) -> None:
    path.mkdir()


def text(path: Path) -> None:
    path.write_text("this is no picture")


def truncated(path: Path) -> None:
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(0, 255, (64, 64), np.uint8)).save(path)
    path.write_bytes(path.read_bytes()[:1000])


def one_pixel(path: Path) -> None:
    Image.new("L", (1, 1), 255).save(path)


def black(path: Path) -> None:
    Image.new("L", (64, 64), 0).save(path)


def white(path: Path) -> None:
    Image.new("L", (64, 64), 255).save(path)


def enormous(path: Path) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 20_000, 20_000, 8, 0, 0, 0, 0))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b""))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (nothing, "there is no file picture.png"),
        (folder, "picture.png is a directory"),
        (text, "is none of these"),
        (truncated, "damaged or cut short"),
        (one_pixel, "picture.png has 1x1"),
        (black, "no contrast"),
        (white, "no contrast"),
        (enormous, "at most 50 million pixels, but picture.png has far more"),
    ],
)
def test_pictures_that_are_none(
    make: Callable[[Path], None], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    make(Path("picture.png"))
    assert message in refused("fit", "picture.png", "-o", "part.svg", "-o", "part.json")


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["-o", "part.dwg"], "cannot write part.dwg: known extensions are"),
        (["-o", "part"], "got none"),
        (["-o", "nowhere/part.svg"], "cannot write nowhere/part.svg: No such file"),
        (["-o", "nowhere/part.stl"], "cannot write nowhere/part.stl: No such file"),
        (["-o", "folder.json"], "it is a folder"),
        (["-o", "plate.png/part.json"], "Not a directory"),
        (["-o", "plate.png"], "cannot write plate.png: it is the picture"),
        (["--preview", "look.jpg"], "a preview is .png or .svg"),
        (["--preview", "nowhere/look.png"], "No such file"),
        (["-o", "look.svg", "--preview", "look.svg"], "named for two outputs"),
        (["--width", "0"], "the width must be a positive number in mm, got 0"),
        (["--width", "-3"], "got -3"),
        (["--width", "nan"], "got nan"),
        (["--scale", "0"], "the scale must be"),
        (["--dpi", "-96"], "the dpi must be"),
        (["--dpi", "inf"], "the dpi must be"),
        (["--thickness", "0"], "the thickness must be a positive number in mm, got 0"),
        (["--thickness", "-1", "-o", "part.stl"], "got -1"),
        (["--width", "3", "--dpi", "96"], "expected one of width, scale and dpi, got width and dpi"),
        (["--origin", "left"], "the origin must be corner, center or drawing, got 'left'"),
        (["--method", "quick"], "there is no method 'quick'"),
        (["--grammar", "spline"], "there is no grammar 'spline'"),
        (["--grammar", "mine.py"], "a script's is named mine.py:OBJECT"),
        (["--init", "start.json"], "there is no program file start.json"),
        (["--seed", "-1"], "the seed must be 0 or more"),
        (["--max-time", "0"], "the time limit must be"),
        (["--threshold", "2"], "threshold between 0 and 1"),
    ],
)
def test_requests_that_cannot_be_met(plate: str, args: list[str], message: str) -> None:
    Path("folder.json").mkdir()
    assert message in refused("fit", plate, *args)


@pytest.mark.parametrize(("name"), ["part.step", "part.stp", "part.brep"])
def test_without_a_cad_kernel_step_is_refused_at_once(plate: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OCP", None)
    monkeypatch.setattr("d4cad.fitting.fit_image", lambda *_: pytest.fail("the fit was started"))
    assert "needs a CAD kernel: pip install" in refused("fit", plate, "-o", name)


def test_export_of_source(plate: str) -> None:
    d4cad("fit", plate, "-o", "part.json")
    result = d4cad(
        "export", "part.json", "-o", "part.py", "-o", "part.scad", "--dialect", "cadquery", "--thickness", "7"
    )
    assert "part.py" in result.stdout
    text = Path("part.py").read_text(encoding="utf-8")
    assert text.startswith(f'"""Made by d4cad {__version__} from plate.png: ')
    assert "\nimport cadquery as cq\n\nthickness = 7.0  # mm\n" in text
    assert "\nthickness = 7; // mm\n" in Path("part.scad").read_text(encoding="utf-8")
    d4cad("export", "part.json", "-o", "part.py")
    assert "from build123d import BuildPart" in Path("part.py").read_text(encoding="utf-8").replace("(\n    ", "")
    before = sorted(Path().iterdir())
    refusal = refused("export", "part.json", "-o", "new.py", "--dialect", "x")
    assert "unknown dialect 'x': known are build123d, build123d-algebra, cadquery, openscad" in refusal
    assert "cannot be in the dialect openscad" in refused("export", "part.json", "-o", "n.py", "--dialect", "openscad")
    assert sorted(Path().iterdir()) == before


def test_export_of_what_is_no_program(plate: str) -> None:
    Path("part.json").write_text("{}")
    assert "part.json is not a usable program file" in refused("export", "part.json", "-o", "part.svg")
    assert "plate.png is not a program file: it is not text" in refused("export", plate, "-o", "part.svg")
    assert "name a file with -o" in refused("export", "part.json")
    assert "needs the picture" in refused("export", "part.json", "-o", "part.png")
    assert "got width and scale" in refused("export", "part.json", "-o", "part.svg", "--width", "1", "--scale", "1")


def test_a_full_disk_is_one_sentence(plate: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.replace", full)
    assert refused("fit", plate, "-o", "part.json") == "error: cannot write part.json: No space left on device"


def test_usage_errors_have_the_same_exit_code() -> None:
    for args in (["fit"], ["fit", "a.png", "--widht", "3"], ["paint"], ["fit", "a.png", "--width", "wide"]):
        assert d4cad(*args).exit_code == 2


def test_version_and_help() -> None:
    assert d4cad("--version").stdout == f"d4cad {__version__}\n"
    for command in ([], ["fit"], ["export"], ["bench"]):
        result = d4cad(*command, "--help")
        assert result.exit_code == 0
        assert "Usage: " in result.stdout


def test_the_installed_command_has_no_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "d4cad", "fit", "nothing.png"]
    found = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert found.returncode == 2
    assert found.stdout == ""
    assert found.stderr == "error: expected a picture, but there is no file nothing.png\n"


def test_the_live_line() -> None:
    record = Record(step=12, loss=1e-4, primitives=7, accepted=2, seconds=1.5)
    assert line(record, 2.0, None) == "step 12 · loss 0.0001 · 40.0 dB · 7 primitives · 2.0 s"
    assert line(record, 2.0, 10.0).endswith(" · 8 s left")
    assert line(None, 1.0, 10.0) == "starting"
    assert "compiles" in line(None, 60.0, 10.0)


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_ctrl_c_keeps_the_best_part(plate: str) -> None:
    import pty

    there, here = pty.openpty()
    command = [sys.executable, "-m", "d4cad.cli", "fit", plate, "--method", "paper", "-o", "part.json"]
    run = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=here, text=True, env={**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    )
    os.close(here)
    shown = b""
    deadline = time.monotonic() + 600
    while b"step " not in shown and time.monotonic() < deadline:
        shown += os.read(there, 1024)
    run.send_signal(signal.SIGINT)
    out, _ = run.communicate(timeout=300)
    os.close(there)
    assert b"primitives" in shown
    assert run.returncode == 130
    assert "the run was interrupted" in out
    assert "wrote part.json" in out
    assert load_program("part.json").stop.name == "INTERRUPTED"
    assert sorted(os.listdir()) == ["part.json", plate]


def test_ctrl_c_elsewhere_is_one_line(plate: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("d4cad.fitting.load", interrupt)
    result = d4cad("fit", plate, "-o", "part.json")
    assert (result.exit_code, result.stdout) == (130, "")
    assert result.stderr == "interrupted: nothing more was written\n"
    assert os.listdir() == [plate]
