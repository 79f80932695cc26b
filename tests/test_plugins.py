"""Grammars of other packages and of scripts: found by name, and good for all that d4cad's own are good for."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.descent import descend
from d4cad.errors import InputError
from d4cad.fitting import fit_coverage
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats
from d4cad.programs import load_program
from d4cad.registry import GRAMMARS, entry, make_grammar, make_method, names

EXAMPLE = Path(__file__).parent.parent / "examples" / "superellipse_grammar.py"
SCRIPT = f"{EXAMPLE}:ENTRY"
CANVAS = Canvas.square(48)


def disc(radius: float = 0.6) -> Floats:
    """A disc by the canvas' own ramp."""
    rows, columns = np.indices(CANVAS.shape) + 0.5
    x, y = (columns - CANVAS.width / 2) * CANVAS.pixel, (rows - CANVAS.height / 2) * CANVAS.pixel
    away: Floats = np.hypot(x, y) - radius
    return np.clip(0.5 - away / (2 * CANVAS.ramp * CANVAS.pixel), 0.0, 1.0)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An installed package, as importlib.metadata sees one, that offers the example's grammar and broken ones."""
    site = tmp_path / "site"
    info = site / "blobs-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "blobs.py").write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
    (site / "not_there.py").write_text("import a_module_that_does_not_exist\n", encoding="utf-8")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: blobs\nVersion: 1.0\n", encoding="utf-8")
    points = ["[d4cad.grammars]", "superellipse = blobs:ENTRY", "unusable = blobs:FACTS", "missing = not_there:ENTRY"]
    (info / "entry_points.txt").write_text("\n".join(points) + "\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(site))
    yield site
    sys.modules.pop("blobs", None)


def test_an_installed_package_registers_its_grammar(package: Path) -> None:
    assert names()[: len(GRAMMARS)] == tuple(GRAMMARS)
    assert "superellipse" in names()
    grammar = make_grammar("superellipse", "fast", CANVAS)
    assert grammar.name == "superellipse"
    assert entry("superellipse").counted == "superellipse"


def test_its_fits_are_like_any_other(package: Path, tmp_path: Path) -> None:
    fit = fit_coverage(disc(), CANVAS, grammar="superellipse")
    assert fit.primitives == 1
    assert fit.psnr > 40
    assert "grammar" not in fit.settings
    fit.save(tmp_path / "disc.json")
    fit.save(tmp_path / "disc.svg", width=30)
    again = load_program(tmp_path / "disc.json")
    assert np.array_equal(again.program.params, fit.program.params)
    assert again.sketch(width=30).area == pytest.approx(np.pi * 15**2, rel=0.02)
    on = fit_coverage(disc(0.7), CANVAS, grammar="superellipse", init=tmp_path / "disc.json")
    assert on.primitives == 1
    assert on.psnr > 40


def test_the_paper_s_method_runs_with_it(package: Path) -> None:
    grammar, method = make_grammar("superellipse", "paper", CANVAS), make_method("paper", CANVAS, 0.0, "superellipse")
    short = replace(method, stages=(replace(method.stages[0], rounds=3),))
    first = grammar.axiom(CANVAS)
    found = descend(first, grammar, ImageLoss.of(disc()), CANVAS, short, np.random.default_rng(0))
    assert len(found.history) == 3
    assert found.loss < found.history[0].loss < ImageLoss.of(disc()).value(grammar.rasterize(first, CANVAS)) / 4


def test_the_command_lists_it_and_fits_with_it(package: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["grammars", "--json"])
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["superellipse"]["rewrites"]["bud"]["exact"] is True
    assert facts["missing"] == {
        "error": "cannot load the grammar missing: No module named 'a_module_that_does_not_exist'"
    }
    listed = CliRunner().invoke(app, ["grammars"])
    assert "superellipse, whose programs count their superellipses" in listed.output
    assert "unusable: the grammar unusable should be a d4cad.registry.Entry, got dict" in listed.output
    Image.fromarray((255 * (1 - disc()[::-1])).astype(np.uint8)).save(tmp_path / "disc.png")
    done = CliRunner().invoke(
        app, ["fit", str(tmp_path / "disc.png"), "--grammar", "superellipse", "-o", str(tmp_path / "d.json"), "--json"]
    )
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["primitives"] == 1
    assert json.loads((tmp_path / "d.json").read_text())["grammar"] == "superellipse"


def test_what_cannot_be_used_is_one_sentence(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        InputError, match="there is no grammar 'blob', expected one of: arc-line, union-rect, tree, mis"
    ):
        entry("blob")
    with pytest.raises(InputError, match=r"unusable should be a d4cad\.registry\.Entry, got dict"):
        entry("unusable")
    with pytest.raises(InputError, match="cannot load the grammar missing: No module"):
        entry("missing")
    with pytest.raises(InputError, match=r"cannot load the grammar nowhere\.py:ENTRY: there is no file nowhere\.py"):
        entry("nowhere.py:ENTRY")
    with pytest.raises(InputError, match="cannot load the grammar json:ENTRY: json has no 'ENTRY'"):
        entry("json:ENTRY")
    with pytest.raises(InputError, match=r"json:loads should be a d4cad\.registry\.Entry, got function"):
        entry("json:loads")
    with pytest.raises(InputError, match="Tr-1 is a variant of tree, not of superellipse"):
        make_grammar("superellipse", "fast", CANVAS, "Tr-1")


def test_a_script_s_grammar_by_file_and_by_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert make_grammar(SCRIPT, "fast", CANVAS).name == "superellipse"
    assert entry(SCRIPT) is entry(SCRIPT)
    (tmp_path / "my_blobs.py").write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
    code = "from d4cad.registry import entry; print(entry('my_blobs:ENTRY').counted)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "superellipse"


def test_a_file_runs_no_code_that_it_alone_names(tmp_path: Path) -> None:
    fit = fit_coverage(disc(), CANVAS, grammar=SCRIPT)
    path = tmp_path / "disc.json"
    fit.save(path)
    assert json.loads(path.read_text())["grammar"] == SCRIPT
    with pytest.raises(InputError, match="is code that runs only where it is named: --grammar"):
        load_program(path)
    again = load_program(path, SCRIPT)
    assert again.language == SCRIPT
    again.save(tmp_path / "again.json")
    assert json.loads((tmp_path / "again.json").read_text())["grammar"] == SCRIPT
    refused = CliRunner().invoke(app, ["export", str(path), "-o", str(tmp_path / "disc.svg")])
    assert refused.exit_code == 2
    assert not (tmp_path / "disc.svg").exists()
    allowed = CliRunner().invoke(app, ["export", str(path), "--grammar", SCRIPT, "-o", str(tmp_path / "disc.svg")])
    assert allowed.exit_code == 0, allowed.output
    assert (tmp_path / "disc.svg").exists()
