"""d4cad bench: every shape of a folder whose truth is known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from d4cad.bench import Case, Request, Row, coverage, run, shapes, table, true_outline
from d4cad.canvas import AREA, Canvas
from d4cad.errors import InputError
from d4cad.programs import load_program
from d4cad.sketch import Circle, Loop, Sketch

KEYS = {"loops", "psnr", "primitives", "true_primitives", "exact", "cpu_s", "wall_s", "stop", "unit", "params"}


def plate() -> list[list[dict[str, Any]]]:
    """A plate with a hole, its bottom side in two collinear lines."""
    corners = [(-0.8, -0.6), (0.1, -0.6), (0.8, -0.6), (0.8, 0.6), (-0.8, 0.6)]
    return Sketch.from_loops([Loop.polyline(corners), Circle((0.1, 0.05), 0.3).loop()]).to_neutral()


def disc() -> list[list[dict[str, Any]]]:
    """A disc, clockwise, with signed sagittas."""
    ends = [[0.7, 0.1], [-0.7, 0.1]]
    arc = {"type": "arc", "bulge_height": -0.7}
    return [[{**arc, "start": ends[0], "end": ends[1]}, {**arc, "start": ends[1], "end": ends[0]}]]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    entries = [{"index": 0, "loops": plate()}, {"index": 7, "loops": disc()}]
    (folder / "plates.json").write_text(json.dumps(entries))
    (folder / "discs.json").write_text(json.dumps(entries[1:]))
    return folder


def test_every_shape_is_fitted_and_written(data: Path, tmp_path: Path) -> None:
    rows = run(Request(data, tmp_path / "out"))
    assert [(row.set, row.index) for row in rows] == [("discs", 7), ("plates", 0), ("plates", 7)]
    assert all(row.exact for row in rows)
    assert [row.true_primitives for row in rows] == [2, 6, 2]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "discs_007.json",
        "plates_000.json",
        "plates_007.json",
    ]
    document = json.loads((tmp_path / "out" / "plates_000.json").read_text())
    assert set(document) >= KEYS
    assert document["unit"] == "world"
    assert document["exact"] is True
    found = Sketch.from_neutral(document["loops"])
    assert found.area == pytest.approx(1.6 * 1.2 - np.pi * 0.09, rel=1e-6)
    assert load_program(tmp_path / "out" / "plates_000.json").primitives == 6


def test_two_processes_give_the_same_programs(data: Path, tmp_path: Path) -> None:
    one = run(Request(data, tmp_path / "one"))
    two = run(Request(data, tmp_path / "two", jobs=2))
    assert [row.psnr for row in one] == [row.psnr for row in two]
    for row in one:
        name = f"{row.set}_{row.index:03d}.json"
        assert load_program(tmp_path / "one" / name).program.params.tobytes() == (
            load_program(tmp_path / "two" / name).program.params.tobytes()
        )


def test_limit_is_for_each_set(data: Path) -> None:
    assert [case.name for case in shapes(data, 1)] == ["discs_007", "plates_000"]


def test_bitmaps_take_the_place_of_exact_rasters(data: Path, tmp_path: Path) -> None:
    pictures = tmp_path / "png"
    pictures.mkdir()
    case = Case("plates", 0, plate())
    cover = coverage(true_outline(case), Canvas.square(96, AREA))
    for name in ("plates_000", "plates_007", "discs_007"):
        Image.fromarray(np.round(cover[::-1] * 255).astype(np.uint8)).save(pictures / f"{name}.png")
    rows = run(Request(data, tmp_path / "out", bitmaps=pictures, limit=1))
    assert rows[1].primitives == 6
    assert 60 < rows[1].psnr < 100  # 8 bits
    (pictures / "plates_000.png").unlink()
    with pytest.raises(InputError, match=r"lacks plates_000\.png"):
        run(Request(data, tmp_path / "out", bitmaps=pictures))


def test_a_shape_that_bounds_no_region_is_reported(data: Path, tmp_path: Path) -> None:
    crossing = Loop.polyline([(0, 0), (1, 1), (1, 0), (0, 2)])
    loops = [
        [
            {"type": "line", "start": crossing.points[k], "end": crossing.points[(k + 1) % 4]}
            for k in range(4)
        ]
    ]  # fmt: skip
    (data / "discs.json").write_text(json.dumps([{"index": 1, "loops": loops}]))
    rows = run(Request(data, tmp_path / "out", limit=1))
    assert rows[0].error is not None
    assert "crosses" in rows[0].error
    assert rows[1].exact
    assert "discs 1: loop 0 crosses" in table(rows)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '[{"index": 0}]', '[{"index": "x", "loops": []}]', "[[]]"])
def test_a_folder_of_something_else(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=r"a\.json is not a list of shapes"):
        shapes(tmp_path, None)


def test_nothing_to_fit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has none"):
        shapes(tmp_path, None)
    with pytest.raises(InputError, match="limit"):
        Request(tmp_path, tmp_path, limit=0)
    with pytest.raises(InputError, match="jobs"):
        Request(tmp_path, tmp_path, jobs=0)


def test_the_table_has_a_line_for_each_set_and_one_for_all() -> None:
    rows = [
        Row("a", 0, 100.0, 4, 4, True, 0.1, 0.2, "stalled", 20.0, 5),
        Row("a", 1, 60.0, 5, 4, False, 0.3, 0.4, "stalled", 40.0, 7),
        Row("b", 0, 120.0, 8, 8, True, 0.2, 0.2, "stalled"),
    ]
    lines = table(rows).splitlines()
    assert [line.split()[0] for line in lines] == ["set", "a", "b", "all"]
    assert lines[1].split()[1:] == [
        "2",
        "50.0%",
        "80.0",
        "80.0",
        "60.0",
        "4.50",
        "4.00",
        "30.0",
        "6.00",
        "0.200",
        "0.300",
        "0",
    ]
    assert "66.7%" in lines[3]
