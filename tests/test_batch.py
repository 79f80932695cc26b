"""Many pictures: tables, failures, resuming, and a dask cluster as the backend."""

from __future__ import annotations

import csv
import json
import os
import warnings
from pathlib import Path
from typing import Any

import pytest
from PIL import Image, ImageDraw
from typer.testing import CliRunner, Result

from d4cad import batch as batches
from d4cad.batch import Batch, Row, pictures, run, solve
from d4cad.cli import app
from d4cad.errors import InputError
from d4cad.finishing import Finish
from d4cad.programs import load_program

KEPT = ("primitives", "lines", "arcs", "circles", "psnr", "iou", "largest_px", "mean_px")


def draw(path: Path, size: int) -> None:
    image = Image.new("L", (48, 48), 255)
    ImageDraw.Draw(image).rectangle((8, 8, 8 + size, 20 + size // 2), fill=0)
    image.save(path)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three pictures and a file that is none, in pics/ of the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pics").mkdir()
    for k in range(3):
        draw(tmp_path / "pics" / f"p{k}.png", 20 + 4 * k)
    (tmp_path / "pics" / "torn.png").write_bytes(b"\x89PNG\r\n\x1a\n...")
    return tmp_path


def d4cad(*args: str) -> Result:
    return CliRunner().invoke(app, ["fit", *args])


def rows() -> list[dict[str, Any]]:
    return list(json.loads(Path("parts/summary.json").read_text())["rows"])


def test_one_failing_file_does_not_stop_the_rest(folder: Path) -> None:
    done = d4cad("pics/*.png", "--out-dir", "parts", "-o", ".json", "-o", ".svg", "--scale", "0.5")
    assert done.exit_code == 2
    assert done.stdout.splitlines()[0] == "3 done, 0 skipped, 1 failed"
    assert done.stderr.startswith("error: pics/torn.png: expected a ")
    names = sorted(p.name for p in Path("parts").iterdir())
    made = [f"p{k}.{kind}" for k in range(3) for kind in ("json", "svg")]
    assert names == sorted([*made, "summary.csv", "summary.json"])
    table = rows()
    assert [row["status"] for row in table] == ["done", "done", "done", "failed"]
    assert [row["primitives"] for row in table] == [4, 4, 4, 0]
    with open("parts/summary.csv", newline="") as file:
        sheet = list(csv.DictReader(file))
    assert [entry["picture"] for entry in sheet] == [row["picture"] for row in table]
    assert float(sheet[1]["psnr"]) == table[1]["psnr"]
    assert load_program("parts/p1.json").made.scale == 0.5


def test_what_is_there_is_skipped(folder: Path) -> None:
    first = d4cad("pics/p*.png", "--out-dir", "parts", "--json")
    assert first.exit_code == 0
    before = {p: p.stat().st_mtime_ns for p in Path("parts").glob("p*.json")}
    again = json.loads(d4cad("pics/p*.png", "--out-dir", "parts", "--json").stdout)
    assert (again["done"], again["skipped"]) == (0, 3)
    assert [row["psnr"] for row in again["rows"]] == [row["psnr"] for row in json.loads(first.stdout)["rows"]]
    assert {p: p.stat().st_mtime_ns for p in Path("parts").glob("p*.json")} == before
    Path("parts/p0.json").unlink()
    os.utime("pics/p1.png", (2e9, 2e9))
    again = json.loads(d4cad("pics/p*.png", "--out-dir", "parts", "--json").stdout)
    assert [row["status"] for row in again["rows"]] == ["done", "done", "skipped"]
    os.utime("pics/p1.png", (1e9, 1e9))
    other = json.loads(d4cad("pics/p*.png", "--out-dir", "parts", "--threshold", "otsu", "--json").stdout)
    assert other["done"] == 3
    assert (
        json.loads(d4cad("pics/p*.png", "--out-dir", "parts", "--threshold", "otsu", "--json").stdout)["skipped"] == 3
    )
    forced = d4cad("pics/p*.png", "--out-dir", "parts", "--threshold", "otsu", "--force")
    assert forced.stdout.startswith("3 done, 0 skipped")
    Path("parts/summary.json").write_text("{")
    assert d4cad("pics/p*.png", "--out-dir", "parts").stdout.startswith("3 done, 0 skipped")


def test_interrupted_keeps_what_is_done(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = solve

    def stopped(batch: Batch, path: Path) -> tuple[Path, Row]:
        return (path, Row(str(path), "interrupted")) if path.stem == "p1" else real(batch, path)

    monkeypatch.setattr(batches, "solve", stopped)
    done = d4cad("pics/p*.png", "--out-dir", "parts")
    assert done.exit_code == 130
    assert "run it again to go on" in done.stderr
    assert [row["status"] for row in rows()] == ["done", "interrupted", "interrupted"]
    monkeypatch.undo()
    os.chdir(folder)
    again = d4cad("pics/p*.png", "--out-dir", "parts")
    assert again.exit_code == 0
    assert again.stdout.startswith("2 done, 1 skipped, 0 failed")


def test_a_defect_costs_one_row(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*args: object, **kwargs: object) -> None:
        raise ZeroDivisionError("oh")

    monkeypatch.setattr(batches, "fit_finished", broken)
    (row,) = run(Batch(Path("parts")), [Path("pics/p0.png")], jobs=1)
    assert (row.status, row.error) == ("failed", "internal error: ZeroDivisionError: oh")


@pytest.mark.parametrize(
    ("args", "part"),
    [
        (["pics/p0.png", "pics/p1.png"], "--out-dir"),
        (["none/*.png", "--out-dir", "parts"], "nothing matches none/*.png"),
        (["pics/p0.png", "--out-dir", "parts", "-o", "a.step"], "names a kind of file such as .step"),
        (["pics/p0.png", "--out-dir", "parts", "-o", ".doc"], "expected kinds of files"),
        (["pics/p0.png", "--out-dir", "parts", "--jobs", "0"], "jobs must be 1 or more"),
        (["pics/p0.png", "--out-dir", "parts", "--report", "r.html"], "-o .html"),
        (["pics/p0.png", "--out-dir", "parts", "--layers", "2"], "no --layers"),
        (["pics/p0.png", "copy/p0.png", "--out-dir", "parts"], "would both become p0"),
    ],
)
def test_bad_requests(folder: Path, args: list[str], part: str) -> None:
    found = d4cad(*args)
    assert found.exit_code == 2
    (sentence,) = found.stderr.splitlines()
    assert part in sentence
    assert not list(Path().glob("parts/*"))


def test_names_and_patterns(folder: Path) -> None:
    Path("pics/odd[1].png").write_bytes(b"")
    found = pictures(["pics/p1.png", "pics/p*.png", "pics/odd[1].png"])
    assert [path.name for path in found] == ["p1.png", "p0.png", "p2.png", "odd[1].png"]
    with pytest.raises(InputError):
        Batch(Path("parts"), (".doc",))


def test_two_processes_give_what_one_gives(folder: Path) -> None:
    files = pictures(["pics/*.png"])
    told: list[str] = []
    how = {"threshold": "otsu"}
    one = run(Batch(Path("one"), options=how, finish=Finish(tolerance="1px")), files, jobs=1)
    batch = Batch(Path("two"), options=how, finish=Finish(tolerance="1px"))
    two = run(batch, files, jobs=2, tell=lambda row: told.append(row.picture))
    assert [row.status for row in two] == ["done", "done", "done", "failed"]
    assert [[getattr(row, name) for name in KEPT] for row in one] == [[getattr(row, n) for n in KEPT] for row in two]
    assert sorted(told) == [str(path) for path in files]


def test_workers_follow_to_another_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes are kept for the next batch, and so is the folder they began in."""
    for name in ("here", "there"):
        (folder / name).mkdir()
        draw(folder / name / "p0.png", 20)
        monkeypatch.chdir(folder / name)
        (row,) = run(Batch(Path("parts")), pictures(["p0.png"]), jobs=2)
        assert (row.status, row.error) == ("done", "")
        assert (folder / name / "parts" / "p0.json").exists()


def test_a_dask_cluster_is_a_backend(folder: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="needs dask[distributed]")
    from joblib import parallel_config

    files = [path.resolve() for path in pictures(["pics/*.png"])]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of ports and clocks, none of them ours
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
            ) as cluster,
            distributed.Client(cluster),
            parallel_config(backend="dask"),
        ):
            found = run(Batch(folder / "parts"), files)
            worked = {state.address for state in cluster.scheduler.workers.values() if state.nbytes or state.metrics}
            tasks = cluster.scheduler.transition_counter
    assert len(worked) == 2
    assert tasks >= 2 * len(files)  # each went through the scheduler
    assert [row.status for row in found] == ["done", "done", "done", "failed"]
    here = run(Batch(folder / "here"), files, jobs=1)
    assert [[getattr(row, n) for n in KEPT] for row in found] == [[getattr(row, n) for n in KEPT] for row in here]
    assert len(list((folder / "parts").glob("p*.json"))) == 3
