"""`d4cad beam`: outputs, what it prints, Ctrl-C, and bad input."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from d4cad import importers
from d4cad.beams.occupancy import solid_elements
from d4cad.beams.reading import parse_problem
from d4cad.cli import app
from d4cad.cli.beam import _quality
from d4cad.descent import Record
from d4cad.exporters import occ
from d4cad.objectives.fem import Grid
from d4cad.programs import load_program
from d4cad.progress import line
from d4cad.sketch import Sketch

COARSE = """\
volume = 0.45
[domain]
size = [60, 32]
element = 2
[material]
yield = 250
[[support]]
from = [0, 0]
to = [0, 32]
[[load]]
from = [60, 14]
to = [60, 18]
force = [0, -500]
"""


def read_step(path: Path) -> Any:
    reader = import_module("OCP.STEPControl").STEPControl_Reader()
    assert reader.ReadFile(str(path)) == import_module("OCP.IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone
    reader.TransferRoots()
    return reader.OneShape()


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["beam", *map(str, arguments)])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A folder with every output of one run, and what it printed."""
    folder = tmp_path_factory.mktemp("beam")
    (folder / "hook.toml").write_text(COARSE)
    names = ["beam.step", "beam.json", "beam.stl", "beam.svg"]
    outputs = [argument for name in names for argument in ("-o", folder / name)]
    found = run(
        folder / "hook.toml", *outputs, "--preview", folder / "beam.png", "--simplify", "1%", "--compare-simp",
        "--thickness", 8, "--json",
    )  # fmt: skip
    assert found.exit_code == 0, found.output
    return folder, json.loads(found.stdout)


def test_report(made: tuple[Path, dict[str, Any]]) -> None:
    _, facts = made
    assert facts["problem"] == "hook"
    assert facts["volume"] == pytest.approx(0.45, abs=0.01)
    assert facts["primitives"] == facts["lines"] + facts["arcs"] + 2 * facts["circles"] < 60
    assert facts["thickness_mm"] == 8
    assert facts["work_nmm"] == pytest.approx(facts["compliance_fine"] * 500**2 / (210e3 * 8))
    assert facts["compliance"] == pytest.approx(facts["compliance_fine"], rel=0.1)
    assert facts["simp"]["ratio"] == pytest.approx(facts["compliance_fine"] / facts["simp"]["compliance_fine"])
    assert facts["simp"]["ratio"] < 1.05
    assert facts["safety_factor"] == pytest.approx(250 / facts["max_von_mises_mpa"])
    assert 0.5 < facts["minimum_member_mm"] < 15
    assert facts["simplify"] == 0.01


def test_files(made: tuple[Path, dict[str, Any]]) -> None:
    folder, facts = made
    assert [Path(name).name for name in facts["files"]] == [
        "beam.step", "beam.json", "beam.stl", "beam.svg", "beam.png",
    ]  # fmt: skip
    assert (folder / "beam.png").read_bytes().startswith(b"\x89PNG")
    assert trimesh.load_mesh(folder / "beam.stl").is_volume
    shape = read_step(folder / "beam.step")
    assert occ.is_valid(shape)
    kinds = import_module("OCP.TopAbs").TopAbs_ShapeEnum
    explorer = import_module("OCP.TopExp").TopExp_Explorer(shape, kinds.TopAbs_SOLID)
    solids = 0
    while explorer.More():
        solids += 1
        explorer.Next()
    assert solids == 1
    assert occ.volume(shape) == pytest.approx(facts["volume"] * 60 * 32 * 8, rel=1e-9)


def test_the_part_contains_its_load(made: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = made
    part = load_program(folder / "beam.json").sketch()
    solid = solid_elements(part, Grid(64, 120), 0.5)
    assert solid[28:36, -1].all()
    assert solid[:, 0].any()


def test_program_file_gives_the_same_outline_and_problem(made: tuple[Path, dict[str, Any]]) -> None:
    folder, facts = made
    document = json.loads((folder / "beam.json").read_text())
    part = Sketch.from_neutral(document["loops"], "mm")
    again = load_program(folder / "beam.json").sketch()
    assert [len(loop.points) for loop in again.loops] == [len(loop.points) for loop in part.loops]
    for a, b in zip(again.loops, part.loops, strict=True):
        assert np.array(a.points) == pytest.approx(np.array(b.points), abs=1e-9)
        assert a.bulges == pytest.approx(b.bulges)
    assert part.area == pytest.approx(facts["volume"] * 60 * 32)
    problem = parse_problem(document["problem"])
    assert problem.name == "hook"
    assert problem.thickness == 8
    assert document["settings"]["beam"]["simplify"] == 0.01
    found = CliRunner().invoke(app, ["export", str(folder / "beam.json"), "-o", str(folder / "again.svg")])
    assert found.exit_code == 0
    drawn = importers.read(folder / "again.svg").sketch
    assert drawn.area == pytest.approx(part.area, rel=1e-6)
    assert drawn.primitives == part.primitives


def test_text_and_quiet(tmp_path: Path) -> None:
    (tmp_path / "hook.toml").write_text(COARSE)
    found = run(tmp_path / "hook.toml", "--volume", 0.5)
    assert found.exit_code == 0, found.output
    assert "compliance" in found.stdout
    assert "times below yield" in found.stdout
    quiet = run(tmp_path / "hook.toml", "-q", "-o", tmp_path / "part.json")
    assert quiet.exit_code == 0
    assert quiet.output == ""


def test_interrupted_keeps_the_best(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C during the search: outputs are written, exit code 130."""
    from d4cad.objectives.compliance import ComplianceLoss

    (tmp_path / "hook.toml").write_text(COARSE)
    inner = ComplianceLoss.demand

    def interrupted(self: ComplianceLoss, band: Any) -> Any:
        inner(self, band)
        raise KeyboardInterrupt

    monkeypatch.setattr(ComplianceLoss, "demand", interrupted)
    found = run(tmp_path / "hook.toml", "-o", tmp_path / "part.svg")
    assert found.exit_code == 130
    assert "Ctrl-C" in found.stdout or "interrupt" in found.stdout.lower()
    assert (tmp_path / "part.svg").exists()


BAD: list[tuple[list[str], str, str]] = [
    ([], "force = [0, -500]", "force = [0, 0]"),
    ([], "[[support]]\nfrom = [0, 0]\nto = [0, 32]\n", ""),
    ([], "from = [60, 14]\nto = [60, 18]", "at = [61.5, 40]"),
    ([], "yield = 250", "young = -1"),
    ([], "yield = 250", "poisson = 0.5"),
    ([], "element = 2", "elemnt = 2"),
    (["--volume", "0"], "", ""),
    (["--volume", "1"], "", ""),
    (["--thickness", "0"], "", ""),
    (["--element", "7"], "", ""),
    (["--simplify", "lots"], "", ""),
    (["--simplify", "120%"], "", ""),
    (["--grammar", "tree"], "", ""),
    (["--init", "diamond"], "", ""),
    (["--seed", "-1"], "", ""),
    (["--max-time", "0"], "", ""),
    (["--method", "slow"], "", ""),
    (["--fillet", "0"], "", ""),
    (["-o", "part.xyz"], "", ""),
    (["-o", "part.svg", "-o", "part.svg"], "", ""),
    (["-o", "no/such/folder/part.svg"], "", ""),
    (["--preview", "part.pdf"], "", ""),
    (["-o", "hook.toml"], "", ""),
]


@pytest.mark.parametrize(("arguments", "good", "bad"), BAD, ids=[f"{a}{b!r}" for a, _, b in BAD])
def test_bad_input(arguments: list[str], good: str, bad: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One sentence on standard error, exit code 2, nothing written."""
    monkeypatch.chdir(tmp_path)
    assert good in COARSE
    Path("hook.toml").write_text(COARSE.replace(good, bad) if good else COARSE)
    found = run("hook.toml", *arguments)
    assert found.exit_code == 2
    assert found.stdout == ""
    assert found.stderr.startswith("error: ")
    assert found.stderr.count("\n") == 1
    assert "Traceback" not in found.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["hook.toml"]


PAPER = [
    ("mbb", ["--volume", "0.3"], "--volume cannot be combined with --method paper"),
    ("mbb", ["--element", "2"], "--element cannot be combined"),
    ("mbb", ["--simplify", "1%"], "--simplify cannot be combined"),
    ("mbb", ["--fillet", "2"], "--fillet cannot be combined"),
    ("mbb", ["--grammar", "union-rect"], "--grammar cannot be combined"),
    ("mbb", ["--init", "axiom"], "--init cannot be combined"),
    ("bridge", [], "the paper has the beams cantilever, mbb, mbb-half, got 'bridge'"),
    ("mbb", ["--seed", "-1"], "the seed must be 0 or more, got -1"),
    ("mbb", ["--max-time", "0"], "the time limit must be a positive number of seconds, got 0"),
]


@pytest.mark.parametrize(("problem", "arguments", "message"), PAPER)
def test_the_papers_set_ups_are_as_published(problem: str, arguments: list[str], message: str) -> None:
    found = run(problem, "--method", "paper", *arguments)
    assert found.exit_code == 2
    assert found.stderr.startswith("error: ")
    assert message in found.stderr
    assert found.stderr.count("\n") == 1


def test_paper_for_a_second(tmp_path: Path) -> None:
    """The report and the picture are of the paper's domain."""
    found = run(
        "cantilever",
        "--method",
        "paper",
        "--max-time",
        0.5,
        "--preview",
        tmp_path / "p.svg",
        "--thickness",
        4,
        "--json",
    )
    assert found.exit_code == 0, found.output
    facts = json.loads(found.stdout)
    assert facts["size_mm"] == [64, 64]
    assert facts["thickness_mm"] == 4
    assert facts["method"] == "paper"
    assert "stop" in facts
    assert (tmp_path / "p.svg").exists()


def test_unknown_problem() -> None:
    found = run("bracket")
    assert found.exit_code == 2
    assert "expected one of cantilever, mbb, mbb-half, l-bracket, bridge, or a .toml file" in found.stderr


def test_live_line_tells_stiffness() -> None:
    shown = line(Record(20, 1.8512, 31, 2, 3.0), 4.0, 10.0, lambda record: _quality(record, "compliance"))
    assert shown == "step 20 · compliance 1.851 · 31 primitives · 4.0 s · 6 s left"
