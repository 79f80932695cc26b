"""The paper's tables: its ablations are settings, fits are kept, and figures add up."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.descent import descend
from d4cad.errors import InputError
from d4cad.objectives.image import ImageLoss
from d4cad.sketch import Loop, Sketch
from d4cad.tables import running
from d4cad.tables.published import ORDER, PAPER, SETS
from d4cad.tables.running import Result, run, tasks
from d4cad.tables.sets import TOPOLOGIES, TWINS, cases, shape
from d4cad.tables.settings import ABLATIONS, Setting, settings
from d4cad.tables.summing import Claim, cells, claims, interval, verdict
from d4cad.tables.writing import in_words

CANVAS = Canvas.square(64)
CORNERS = ((-0.8, -0.7), (0.2, -0.3), (0.9, -0.6), (0.7, 0.8), (0.0, 0.3), (-0.6, 0.6))
TARGET = coverage(Sketch.from_loops([Loop(CORNERS, (0.0, 0.0, 0.3, 0.0, 0.0, -0.2))]), CANVAS)


def accepted(setting: Setting) -> list[int]:
    """Rewrites accepted in every round of a search for a shape of six primitives."""
    grammar, method = setting.search(CANVAS, TARGET, 6.5e-5)
    method = replace(method, stages=tuple(replace(stage, rounds=min(stage.rounds, 12)) for stage in method.stages))
    start = grammar.axiom(CANVAS)
    found = descend(start, grammar, ImageLoss.of(TARGET), CANVAS, method, np.random.default_rng(0))
    return [record.accepted for record in found.history]


def test_every_row_of_both_tables_is_a_setting() -> None:
    rows = settings(("paper", "fast"))
    for method in ("paper", "fast"):
        assert set(PAPER) <= {row.label for row in rows if row.method == method}
    assert {name for pair in ORDER for name in pair} <= {row.label for row in rows}
    assert len(set(rows)) == len(rows)
    assert all(set(figures) == set(SETS) for figures in PAPER.values())


@pytest.mark.parametrize("method", ["paper", "fast"])
def test_ablations_change_the_settings_that_they_name(method: str) -> None:
    def search(variant: str, ablation: str) -> dict[str, object]:
        _, found = Setting(method, variant, ablation).search(CANVAS, TARGET, 6.5e-5)
        return {
            "steps": getattr(found.estimator, "steps", None),
            "accept": found.accept,
            "rates": (getattr(found.stepper, "rate", None), getattr(found.stepper, "least", None)),
            "factor": getattr(found.stepper, "factor", None),
            "stages": found.stages,
        }

    full, none, one = (search("UR-F", name) for name in ("Full", "NoStep", "OneRewrite"))
    assert none == {**full, "steps": 0}
    assert full["steps"]
    assert one == {**full, "accept": 1}
    for variant, rate in (("AL-F", 0.05), ("UR-F", 0.02)):
        both = search(variant, "Fixed+OneRewrite")
        changed = {"factor": 1.0} if method == "fast" else {"rates": (rate, rate)}
        assert both == {**search(variant, "Full"), **changed, "accept": 1}


@pytest.mark.parametrize("method", ["paper", "fast"])
def test_one_rewrite_accepts_one_a_round(method: str) -> None:
    assert max(accepted(Setting(method, "AL-F", "OneRewrite"))) == 1
    assert max(accepted(Setting(method, "AL-F"))) > 1


def test_without_a_step_no_split_shows_its_worth() -> None:
    grammar, method = Setting("paper", "AL-F", "NoStep").search(CANVAS, TARGET, 6.5e-5)
    loss, program = ImageLoss.of(TARGET), grammar.axiom(CANVAS)
    splits = [
        rewrite
        for rewrite in grammar.rewrites(program, TARGET, CANVAS, np.random.default_rng(0))
        if rewrite.rule == "split"
    ]
    trials = method.estimator.estimate(program, splits, grammar, loss, CANVAS, 1e-5)
    assert trials
    assert all(trial.gain == pytest.approx(-1e-5) for trial in trials)  # the shape is as it was, the price is paid


def test_our_sets_have_the_topology_of_the_papers() -> None:
    assert set(TWINS) == set(TOPOLOGIES)
    assert set(TWINS.values()) == set(SETS)
    found = cases(3)
    assert [case.set for case in found] == [name for name in TOPOLOGIES for _ in range(3)]
    for case in found:
        assert TOPOLOGIES[case.set](Sketch.from_neutral(case.loops, "world"))
    assert shape("ring", 1) == shape("ring", 1)
    assert len({json.dumps(case.loops) for case in found}) == 9
    with pytest.raises(InputError, match="limit"):
        cases(0)


def test_fits_are_kept_and_done_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    todo = tasks(None, [Setting("fast", "AL-F"), Setting("paper", "AL-1")], limit=1, seeds=2, max_time=0.2)
    assert [task.seed for task in todo].count(1) == 3  # the default method draws no random number
    told: list[tuple[int, int]] = []
    first = run(todo, tmp_path, tell=lambda done, total: told.append((done, total)))
    assert told == [(k, 9) for k in range(1, 10)]
    assert all(result.error is None and result.psnr > 10 for result in first)

    monkeypatch.setattr(running, "solve", lambda task: pytest.fail(f"{task.file} was done twice"))
    assert run(todo, tmp_path) == first
    other = tasks(None, [Setting("fast", "AL-F")], limit=1, seeds=1, max_time=0.3)
    assert other[0].file == todo[0].file
    assert running._kept(tmp_path, other[0]) is None  # of another time limit
    (tmp_path / todo[0].file).write_text('{"key": 1')
    assert running._kept(tmp_path, todo[0]) is None


def test_a_shape_that_bounds_no_region_is_a_failure(tmp_path: Path) -> None:
    loops = [[{"type": "line", "start": a, "end": b} for a, b in (((0, 0), (1, 1)), ((1, 1), (0, 0)))]]
    (tmp_path / "bad.json").write_text(json.dumps([{"index": 0, "loops": loops}]))
    result = run(tasks(tmp_path, [Setting("fast", "AL-F")], None, 1), tmp_path / "work")[0]
    assert result.error is not None
    assert cells([result])[0].failed == 1
    assert claims([result]) == []


def test_a_dask_cluster_is_a_backend(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="needs dask[distributed]")
    from joblib import parallel_config

    todo = tasks(None, [Setting("fast", "AL-F")], limit=2, seeds=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of ports and clocks, none of them ours
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
            ) as cluster,
            distributed.Client(cluster),
            parallel_config(backend="dask"),
        ):
            there = run(todo, tmp_path / "dask")
            assert cluster.scheduler.transition_counter >= 2 * len(todo)
    here = run(todo, tmp_path / "here")
    # Its workers are threads here, which share the number of BLAS threads, and with it the last bits.
    assert [(round(min(r.psnr, 100.0), 1), r.primitives) for r in there] == [
        (round(min(r.psnr, 100.0), 1), r.primitives) for r in here
    ]


def results(row: str, psnr: list[float], method: str = "paper") -> list[Result]:
    """One set of shapes, one seed."""
    return [
        Result("ring", k, method, row, 0, value, 8, 8, 0.5 + k, 0.6, 100, "stalled") for k, value in enumerate(psnr)
    ]


def test_a_cell_adds_up() -> None:
    found = cells([*results("AL-F", [20.0, 30.0, 200.0]), replace(results("AL-F", [0.0])[0], index=3, error="no")])[0]
    assert (found.shapes, found.fits, found.failed) == (4, 4, 1)
    assert found.mean == pytest.approx((20 + 30 + 120) / 3)
    assert (found.median, found.worst) == (30.0, 20.0)
    assert found.of_mean == pytest.approx(-10 * np.log10((1e-2 + 1e-3 + 1e-12) / 3))
    assert 20 <= found.low < found.mean < found.high <= 120
    assert (found.median_s, found.worst_s) == (1.5, 2.5)


def test_the_interval_covers_the_mean_of_a_known_distribution() -> None:
    rng = np.random.default_rng(1)
    low, high = np.array([interval(rng.normal(5, 2, 40)) for _ in range(200)]).T
    assert 0.88 < np.mean((low < 5) & (high > 5)) < 0.99


@pytest.mark.parametrize(
    ("published", "low", "high", "expected"),
    [
        (3.0, 0.1, 2.0, "confirmed"),
        (3.0, -2.0, -0.1, "refuted"),
        (3.0, -1.0, 1.0, "undecided"),
        (-3.0, -2.0, -0.1, "confirmed"),
        (-3.0, 0.1, 2.0, "refuted"),
        (None, 0.1, 2.0, "confirmed"),
        (0.2, -0.4, 0.9, "confirmed"),
        (0.2, 1.1, 3.0, "refuted"),
        (0.2, -2.0, 3.0, "undecided"),
    ],
)
def test_verdicts(published: float | None, low: float, high: float, expected: str) -> None:
    assert verdict(published, low, high) == expected


def test_orders_are_judged_shape_by_shape() -> None:
    better = results("AL-F", [40.0, 50.0, 60.0, 45.0])
    found = claims([*better, *results("AL-1", [39.0, 49.0, 59.0, 44.0])])
    claim = found[0]
    assert isinstance(claim, Claim)
    assert (claim.better, claim.worse, claim.verdict) == ("AL-F", "AL-1", "confirmed")
    assert claim.published == pytest.approx(36.7)
    assert claim.low == claim.difference == claim.high == 1.0
    assert "AL-F over AL-1: confirmed on ring." in in_words(found)
    assert claims([*better[:3], *results("AL-1", [39.0, 49.0, 59.0])])[0].verdict == "undecided"  # too few


def test_the_command_writes_tables_and_plots(tmp_path: Path) -> None:
    out = tmp_path / "results"
    arguments = ["tables", "--only", "AL-1", "--only", "AL-F", "--limit", "1", "--seeds", "1", "--max-time", "0.3"]
    done = CliRunner().invoke(app, [*arguments, "-o", str(out), "--work", str(tmp_path / "work")])
    assert done.exit_code == 0, done.output
    document = json.loads((out / "tables.json").read_text())
    assert {cell["row"] for cell in document["cells"]} == {
        "AL-1", "AL-F", "AL-F NoStep", "AL-F OneRewrite", "AL-F Fixed", "AL-F Fixed+OneRewrite",
    }  # fmt: skip
    text = (out / "tables.md").read_text()
    assert "| AL-F | 44.3 / 9 |" in text
    assert "| AL-F NoStep | 30.7 / 118 |" in text
    assert "one-component like onecomp" in text
    for name in ("psnr.svg", "time.svg"):
        assert (out / name).read_text().count("<path") > 10


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--method", "slow"], "no method 'slow'"),
        (["--only", "AL-9"], "no variant 'AL-9'"),
        (["--limit", "0"], "limit"),
        (["--seeds", "0"], "seeds"),
        (["--jobs", "0"], "jobs"),
        (["--max-time", "-1"], "time limit"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path: Path, arguments: list[str], told: str) -> None:
    done = CliRunner().invoke(app, ["tables", "-o", str(tmp_path / "out"), "--work", str(tmp_path / "w"), *arguments])
    assert done.exit_code == 2
    assert told in done.output
    assert not (tmp_path / "out").exists()


def test_ablations_have_the_papers_names() -> None:
    assert set(ABLATIONS) == {"Full", "NoStep", "OneRewrite", "Fixed", "Fixed+OneRewrite"}
