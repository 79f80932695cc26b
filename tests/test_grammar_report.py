"""The four properties of a grammar, measured."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.errors import ExportError, InputError
from d4cad.grammars.union_rect import FACTS, UnionRect
from d4cad.laboratory import SAME, Laboratory, span
from d4cad.properties import BACK, Report, Spread, measure
from d4cad.propertypages import markdown, text, write
from d4cad.registry import Entry, entry, make_method
from d4cad.steppers import LevenbergMarquardt

CANVAS = Canvas.square(48)


@pytest.fixture(scope="module")
def rectangles() -> Report:
    return measure("union-rect", programs=2, pixels=48)


def test_rectangles(rectangles: Report) -> None:
    rules = {found.rule: found for found in rectangles.rules}
    assert set(rules) | set(rectangles.unseen) == set(FACTS)
    for rule in ("split-h", "split-v"):
        assert rules[rule].same == 1
        assert rules[rule].jump.most < SAME
        assert rules[rule].undone == 1
        assert rules[rule].inverse == "merge"
    assert rules["add-rect"].undone == 1
    assert rules["add-rect"].inverse == "remove"
    assert rules["remove"].jump.most > BACK
    assert rules["remove"].undone < 1
    for found in rectangles.rules:
        assert len(found.jumps) == len(found.reaches) == found.tries > 0
        assert found.undone <= found.mended
        assert 0 <= found.reach.median <= found.reach.most <= 1
        assert found.refitted.most <= found.jump.most + SAME
    assert 0 < rectangles.control.reach.median < 0.5
    assert rectangles.repairs.repaired == rectangles.repairs.drawable == 1
    assert rectangles.broken == ()


@pytest.mark.parametrize("name", ["arc-line", "tree"])
def test_the_others(name: str) -> None:
    report = measure(name, programs=1, pixels=48)
    rules = {found.rule: found for found in report.rules}
    assert report.broken == ()
    assert report.repairs.repaired == report.repairs.drawable == 1
    if name == "arc-line":
        assert rules["split"].jump.most < SAME
        assert rules["to-arc"].inverse == "to-line"
        assert rules["split"].reach.most < 0.5
    else:
        assert rules["add-leaf"].inverse == "remove-leaf"
        # an inner branch moves all that hangs on it
        assert report.control.reach.most > 2 * report.control.reach.median


def test_the_same_seed_gives_the_same_report(rectangles: Report) -> None:
    one = measure("union-rect", programs=1, pixels=48)
    assert measure("union-rect", programs=1, pixels=48) == one
    assert one.rules[0].jumps[:2] == rectangles.rules[0].jumps[:2]
    assert measure("union-rect", programs=1, pixels=48, seed=1) != one


@dataclass(frozen=True, slots=True)
class Leaky(UnionRect):
    """Its removals are called exact, and its repair moves whatever it is given."""

    def repair(self, program: Any) -> Any:
        edit = UnionRect.repair(self, program)
        return type(edit)(edit.program.moved(edit.program.params + 1e-3), edit.origin)


def test_what_a_grammar_says_wrongly_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    facts = {**FACTS, "remove": type(FACTS["remove"])("a rectangle goes", exact=True), "never": FACTS["merge"]}
    wrong = Entry(lambda canvas, rules: Leaky(canvas.pixel, rules), facts, counted="rectangle")
    monkeypatch.setitem(__import__("d4cad.registry").registry.GRAMMARS, "leaky", wrong)
    report = measure("leaky", programs=1, pixels=48)
    (sentence,) = report.broken
    assert sentence.startswith("remove is said to leave the shape as it is, but changes it by up to ")
    assert "never" in report.unseen
    assert report.repairs.violated == 1
    assert report.repairs.repaired == 0
    assert f"- Not as the grammar says: {sentence}." in markdown(report)


def test_influence_is_the_raster_s_derivative() -> None:
    lab = Laboratory(
        UnionRect(CANVAS.pixel), CANVAS, make_method("fast", CANVAS, 0.0, "union-rect").stepper,
        np.random.default_rng(0), entry("union-rect").rules,
    )  # fmt: skip
    assert isinstance(lab.stepper, LevenbergMarquardt)
    program, target = lab.random_program()
    assert target.shape == CANVAS.shape
    influence = lab.influence(program, np.arange(program.params.size))
    weight = np.random.default_rng(1).standard_normal(CANVAS.shape)
    pulled = lab.grammar.rasterize(program, CANVAS).pull_back(weight)
    assert (influence * weight).sum(axis=(1, 2)) == pytest.approx(pulled, rel=1e-3, abs=1e-3)


def test_span_and_spread() -> None:
    whole = np.ones((9, 9), bool)
    part = np.zeros((9, 9), bool)
    part[3:6, 3:6] = True
    assert span(whole, whole) == pytest.approx(1)
    assert span(part, whole) == pytest.approx(np.sqrt((9 - 1) / (81 - 1)))
    assert span(np.zeros((9, 9), bool), whole) == 0
    assert Spread.of(list(range(11))) == Spread(5.0, 9.0, 10.0)
    assert Spread.of([]) == Spread(0.0, 0.0, 0.0)


def test_bad_requests(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no grammar 'arcs'"):
        measure("arcs")
    with pytest.raises(
        InputError, match="at least 1 program, a seed from 0 on and 32 to 1024 pixels, got 0, 0 and 128"
    ):
        measure("tree", programs=0)
    done = CliRunner().invoke(app, ["grammar-report", "tree", "-o", str(tmp_path / "a.pdf")])
    assert done.exit_code == 2
    assert "a grammar's report is .json .md .png .svg, got .pdf" in done.output


def test_the_command_writes_text_json_and_a_picture(tmp_path: Path, rectangles: Report) -> None:
    files = [tmp_path / f"report{suffix}" for suffix in (".md", ".json", ".png", ".svg")]
    call = ["grammar-report", "union-rect", "--programs", "2", "--pixels", "48", "--json"]
    done = CliRunner().invoke(app, [*call, *(part for file in files for part in ("-o", str(file)))])
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["files"] == [str(file) for file in files]
    assert files[0].read_text() == markdown(rectangles)
    assert json.loads(files[1].read_text())["rules"] == facts["rules"]
    assert facts["rules"][0]["jump"]["median"] == rectangles.rules[0].jump.median
    with Image.open(files[2]) as picture:
        assert picture.width > 800
        assert np.asarray(picture.convert("L")).std() > 10
    first = files[3].read_bytes()
    write(rectangles, files[3])
    assert files[3].read_bytes() == first
    (tmp_path / "folder.md").mkdir()
    with pytest.raises(ExportError, match="it is a folder"):
        write(rectangles, tmp_path / "folder.md")


def test_the_command_tells_people(rectangles: Report) -> None:
    done = CliRunner().invoke(app, ["grammar-report", "union-rect", "--programs", "1", "--pixels", "48"])
    assert done.exit_code == 0, done.output
    lines = text(rectangles).splitlines()
    assert done.output.splitlines()[2].split() == lines[2].split()
    (row,) = [line.split() for line in lines if line.startswith("split-h")]
    assert row[2:6] == ["100", "%", "0", "0"]
