"""The program file: exact round trip, and one sentence for everything that is not one."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from d4cad import io
from d4cad.canvas import Canvas
from d4cad.errors import ExportError, InputError
from d4cad.relations import Dimension, Relation

LOOPS: list[list[dict[str, Any]]] = [
    [
        {"type": "line", "start": [0.0, 0.0], "end": [2.0, 0.0]},
        {"type": "arc", "start": [2.0, 0.0], "end": [0.0, 0.0], "bulge": 1.0},
    ]
]
FILE = io.ProgramFile(
    grammar="arc-line",
    structure=["LA"],
    params=(0.1, 1 / 3, -1e-300, 0.7),
    canvas=Canvas(64, 48, 3 / 64, 0.5),
    settings={"method": "fast", "seed": 3},
    history=({"step": 4, "loss": 0.1, "primitives": 2, "accepted": 1, "seconds": 0.5},),
    stop="stalled",
    psnr=61.25,
    primitives=2,
    unit="mm",
    loops=LOOPS,
    extra={"cpu_s": 0.25},
)


def fields(file: io.ProgramFile) -> dict[str, Any]:
    return {name: getattr(file, name) for name in io.ProgramFile.__dataclass_fields__}


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    io.write(tmp_path / "p.json", FILE)
    assert fields(io.read(tmp_path / "p.json")) == fields(FILE)
    assert [path.name for path in tmp_path.iterdir()] == ["p.json"]


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=8))
def test_floats_come_back_bit_for_bit(params: list[float]) -> None:
    back = io.loads(io.dumps(replace(FILE, params=tuple(params)))).params
    assert [x.hex() for x in back] == [x.hex() for x in params]


def test_other_software_can_read_it() -> None:
    document = json.loads(io.dumps(FILE), parse_constant=lambda name: pytest.fail(name))
    assert document["format"] == "d4cad-program"
    assert document["version"] == 1
    assert document["loops"] == LOOPS
    assert document["unit"] == "mm"


def test_relations_and_dimensions_read_back() -> None:
    relations = (Relation("horizontal", ((0, 0),)), Relation("length", ((0, 1),), 2.5))
    dimensions = (Dimension("width", "width", (), 4.0, True),)
    file = replace(FILE, relations=relations, dimensions=dimensions)
    text = io.dumps(file)
    assert fields(io.loads(text)) == fields(file)
    assert "regularisation" not in json.loads(io.dumps(FILE))
    document = json.loads(text)
    document["regularisation"]["relations"][0]["refs"] = [[9, 0]]
    with pytest.raises(InputError, match=r'in its "regularisation", there is no edge 0 of loop 9'):
        io.loads(json.dumps(document))


def broken(**changes: Any) -> str:
    document = json.loads(io.dumps(FILE))
    for key, value in changes.items():
        document[key] = value
    return json.dumps(document)


def without(key: str) -> str:
    document = json.loads(io.dumps(FILE))
    del document[key]
    return json.dumps(document)


@pytest.mark.parametrize(
    "key", ["structure", "params", "canvas", "settings", "history", "stop", "psnr", "unit", "loops"]
)
def test_a_missing_key_is_named(key: str) -> None:
    with pytest.raises(InputError, match=f'no "{key}"'):
        io.loads(without(key))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not JSON"),
        ("solid part", "not JSON"),
        ("{", "not JSON"),
        ("[" * 100_000, "nested too deeply"),
        ("[1, 2]", "d4cad-program"),
        ("{}", "d4cad-program"),
        (broken(format="gltf"), "d4cad-program"),
        (broken(version=2), "version is 2"),
        (broken(version="1"), "version is '1'"),
        (broken(params=[1.0, math.nan]), "NaN"),
        (broken(params=[1.0, math.inf]), "Infinity"),
        (broken(params=[1.0, "2"]), r"params\[1\] is \"2\""),
        (broken(params=[True]), r"params\[0\] is true"),
        (broken(params=[10**400]), r"params\[0\] is not a finite number"),
        (io.dumps(FILE).replace("0.7]", "1e999]"), r"params\[3\] is not a finite number"),
        (broken(params={}), "expected a list"),
        (broken(canvas={"width": 0, "height": 4, "pixel": 0.1, "ramp": 0.5}), "canvas"),
        (broken(canvas={"width": 4, "height": 4, "ramp": 0.5}), "canvas pixel"),
        (broken(canvas={"width": 4.5, "height": 4, "pixel": 0.1, "ramp": 0.5}), "whole number"),
        (broken(psnr="high"), "psnr"),
        (broken(unit="inch"), "mm, world"),
        (broken(history=[3]), r"history\[0\]"),
        (broken(history=[{"step": 1}]), r"history\[0\].loss"),
        (broken(loops=[3]), r"loops\[0\]"),
        (broken(loops=[[{"type": "bezier"}]]), "not a line or an arc"),
        (broken(loops=[[{"type": "line", "start": [0, 1]}]]), r"no end \[x, y\]"),
        (broken(loops=[[{"type": "arc", "start": [0, 1], "end": [1, 1]}]]), "bulge"),
    ],
)
def test_what_is_no_program_file_is_refused_with_a_sentence(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        io.loads(text)


def test_reading_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "part.json"
    with pytest.raises(InputError, match="no program file"):
        io.read(path)
    with pytest.raises(InputError, match="folder"):
        io.read(tmp_path)
    path.write_bytes(b"\x89PNG\xff")
    with pytest.raises(InputError, match=r"part\.json is not a program file: it is not text"):
        io.read(path)
    path.write_text("{}")
    with pytest.raises(InputError, match=r"part\.json is not a usable program file"):
        io.read(path)


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    io.write(tmp_path / "p.json", FILE)
    with pytest.raises(ValueError, match="JSON compliant"):
        io.write(tmp_path / "p.json", replace(FILE, psnr=math.nan))
    with pytest.raises(ExportError, match="cannot write"):
        io.write(tmp_path / "nowhere" / "p.json", FILE)
    assert fields(io.read(tmp_path / "p.json")) == fields(FILE)
    assert [path.name for path in tmp_path.iterdir()] == ["p.json"]
