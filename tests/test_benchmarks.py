"""The benchmarks' scripts do what they say, on little."""

from __future__ import annotations

import importlib.util
import json
import sys
from dataclasses import replace
from math import inf
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from d4cad.canvas import Canvas
from d4cad.descent import descend
from d4cad.methods import fast
from d4cad.objectives.image import ImageLoss
from d4cad.tables.sets import cases

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"


def script(name: str) -> ModuleType:
    """The module of a benchmark."""
    spec = importlib.util.spec_from_file_location(f"benchmark_{name}", BENCHMARKS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


ABLATION = script("ablation")


@pytest.mark.parametrize("name", list(ABLATION.CHANGES))
def test_every_ablation_changes_something_and_searches(name: str) -> None:
    canvas = Canvas.square(48)
    target = np.zeros(canvas.shape)
    target[12:30, 10:34] = 1
    target[18:24, 16:24] = 0
    plain, grammar = fast(canvas, 0.1), ABLATION.Counted(canvas.pixel)
    method, changed = ABLATION.CHANGES[name][1](plain, grammar)
    assert (method != plain or replace(changed, count=grammar.count) != grammar) == (name != "full")
    method = replace(method, stages=tuple(replace(stage, rounds=min(stage.rounds, 3)) for stage in method.stages[:2]))
    start = changed.axiom(canvas)
    found = descend(start, changed, ImageLoss.of(target), canvas, method, np.random.default_rng(0))
    assert found.loss < ImageLoss.of(target).value(changed.rasterize(start, canvas))
    assert changed.count.rasters > 0
    assert (changed.count.trials > 0) == ("whole" not in name)


def test_an_ablation_is_measured() -> None:
    (case, *_) = cases(1)
    run = ABLATION.solved(case, "full", inf)
    assert run.exact
    seconds, evaluations, psnr = zip(*run.points, strict=True)
    assert list(seconds) == sorted(seconds)
    assert list(evaluations) == sorted(evaluations)
    assert psnr[-1] == run.psnr >= 80
    assert evaluations[-1] == run.rasters + run.trials


def test_the_noise_sets_the_price_in_the_ablation() -> None:
    (case, *_) = cases(1)
    wise = ABLATION.priced(case, "price by noise", 0.1, inf)
    naive = ABLATION.priced(case, "price of a clean picture", 0.1, inf)
    assert wise.psnr > naive.psnr
    assert wise.primitives < naive.primitives


def test_slopes_and_wheels_of_the_scaling() -> None:
    scaling = script("scaling")
    assert scaling.slope([1, 2, 4, 8], [5, 3, 12, 48]) == pytest.approx(2.0)
    for count in (4, 12, 40, 400):
        assert scaling.wheel(count).primitives == count
    run, number = scaling.trials(scaling.setup(64, 12), 40)
    assert number == 40
    assert run() is not None


def test_rjmcmc_is_run_beside_srd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rjmcmc = script("rjmcmc")
    monkeypatch.setattr(rjmcmc, "cases", lambda limit: cases(limit)[:1])
    monkeypatch.setattr(sys, "argv", ["rjmcmc.py", "--seconds", "0.4", "--out", str(tmp_path)])
    rjmcmc.main()
    facts = json.loads((tmp_path / "rjmcmc.json").read_text())
    assert [row["method"] for row in facts["rows"]] == list(rjmcmc.METHODS)
    for runs in facts["runs"].values():
        psnr = [point[1] for point in runs[0]]
        assert psnr == sorted(psnr)
    assert "| Tr-5 |" in (tmp_path / "rjmcmc.md").read_text()
    assert (tmp_path / "rjmcmc.svg").stat().st_size > 5000
