"""Pickled target shapes: read as they are, and nothing in them is ever executed."""

from __future__ import annotations

import io
import json
import os
import pickle
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from d4cad import pickled
from d4cad.bench import shapes, true_outline
from d4cad.cli import app
from d4cad.errors import InputError
from d4cad.pickled import LEGACY, loads
from d4cad.targets import convert, neutral, primitives

SQUARE = [[-1.0, -1.0, 1.0, -1.0], [1.0, -1.0, 1.0, 1.0], [1.0, 1.0, -1.0, 1.0], [-1.0, 1.0, -1.0, -1.0]]
BORE = [[0.5, 0.0, -0.5, 0.0, -0.5], [-0.5, 0.0, 0.5, 0.0, -0.5]]
"""Two half circles, clockwise."""


def archived(value: Any) -> bytes:
    import torch

    stream = io.BytesIO()
    torch.save(value, stream)
    return stream.getvalue()


def streamed(value: Any) -> bytes:
    import torch

    stream = io.BytesIO()
    torch.save(value, stream, _use_new_zipfile_serialization=False)
    return stream.getvalue()


FORMATS = pytest.mark.parametrize("dumped", [archived, streamed, pickle.dumps], ids=["archive", "stream", "pickle"])


@FORMATS
def test_tensors_come_back_as_they_were(dumped: Callable[[Any], bytes]) -> None:
    import torch

    whole = torch.arange(24, dtype=torch.float32).reshape(4, 6)
    value = {
        "a": whole,
        "view": whole.T[1:5:2, ::3],
        "half": torch.tensor([0.5, -2.0], dtype=torch.float16),
        "count": torch.tensor([3, -4]),
        "none": torch.zeros((0, 5)),
        "one": torch.tensor(2.5, dtype=torch.float64),
        "weight": torch.nn.Parameter(torch.tensor([7.0])),
        "rest": [1, 2.5, "text", None, True, (1, 2)],
    }
    found = loads(dumped(value))
    for name, tensor in value.items():
        if name != "rest":
            assert isinstance(found[name], np.ndarray)
            assert found[name].shape == tuple(tensor.shape)  # type: ignore[attr-defined]
            assert np.array_equal(found[name], tensor.detach().numpy())  # type: ignore[attr-defined]
    assert found["rest"] == [1, 2.5, "text", None, True, [1, 2]]


@FORMATS
def test_shapes_of_tensors_are_converted(tmp_path: Path, dumped: Callable[[Any], bytes]) -> None:
    import torch

    lines, arcs = torch.tensor(SQUARE), torch.tensor(BORE)
    ways = [
        {"lines": lines, "arcs": arcs},
        [[torch.tensor(row) for row in SQUARE], [torch.tensor(row) for row in BORE]],
        {"loops": [list(lines), list(arcs)]},
        {"primitives": [{"start": r[:2], "end": r[2:4], "k": r[4:]} if len(r) > 4 else r for r in (*lines, *arcs)]},
        {"lines": lines.reshape(4, 2, 2), "arcs": arcs},
    ]
    (tmp_path / "ours.pkl").write_bytes(dumped(ways))
    done = CliRunner().invoke(app, ["targets", str(tmp_path / "ours.pkl"), "-o", str(tmp_path / "data")])
    assert done.exit_code == 0, done.output
    assert "5 shapes" in done.output
    cases = shapes(tmp_path / "data", None)
    assert [case.index for case in cases] == [0, 1, 2, 3, 4]
    for case in cases:
        outline = true_outline(case)
        assert outline.area == pytest.approx(4 - np.pi / 4, rel=1e-6)
        assert outline.primitives == 6
    entry = json.loads((tmp_path / "data" / "ours.json").read_text())[0]
    assert (entry["n_lines"], entry["n_arcs"]) == (4, 2)


class Call:
    """Pickles as a call of a function."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.function, self.arguments = function, arguments

    def __reduce__(self) -> Any:
        return self.function, self.arguments


def hostile(marker: Path) -> dict[str, bytes]:
    """Pickles that would leave a mark, or load a module, if they were obeyed."""
    touch = f"touch {marker}"
    system = pickle.dumps(Call(os.system, touch))
    evil = f"c{os.system.__module__}\nsystem\n(V{touch}\ntR.".encode()
    zipped = io.BytesIO()
    with zipfile.ZipFile(zipped, "w") as archive:
        archive.writestr("x/data.pkl", system)
    return {
        "system": system,
        "text": evil,
        "instance": f"(V{touch}\ni{os.system.__module__}\nsystem\n.".encode(),
        "object": b"(" + f"c{os.system.__module__}\nsystem\nV{touch}\no.".encode(),
        "eval": pickle.dumps(Call(eval, f"open({str(marker)!r}, 'w')")),
        "open": pickle.dumps(Call(open, str(marker), "w")),
        "module": b"cantigravity\nfly\n.",
        "dotted": pickle.dumps(Call(Path.touch, marker)),
        "getattr": pickle.dumps(Call(getattr, "a", "upper")),
        "archive": zipped.getvalue(),
        "nested": pickle.dumps({"a": [Call(os.system, touch)]}),
        "within a storage": b"ctorch.storage\n_load_from_bytes\n" + b"(C" + bytes([len(evil)]) + evil + b"tR.",
        "after the magic number": pickle.dumps(LEGACY) + system,
        "torch.load": b"ctorch\nload\n(V" + str(marker).encode() + b"\ntR.",
        "dispatch": b"ctorch._utils\n_rebuild_tensor_v2.__globals__\n.",
    }


@pytest.mark.parametrize("name", list(hostile(Path("x"))))
def test_hostile_files_are_refused(name: str, tmp_path: Path) -> None:
    marker = tmp_path / "marker"
    path = tmp_path / "bad.pkl"
    path.write_bytes(hostile(marker)[name])
    done = CliRunner().invoke(app, ["targets", str(path), "-o", str(tmp_path / "data")])
    assert done.exit_code == 2
    assert "refused" in done.stderr
    assert not marker.exists()
    assert "antigravity" not in sys.modules
    assert not list((tmp_path / "data").iterdir())


def test_the_hostile_files_would_have_done_it(tmp_path: Path) -> None:
    """The test above can fail: Python's own reader obeys."""
    marker = tmp_path / "marker"
    pickle.loads(hostile(marker)["system"])
    assert marker.exists()


@pytest.mark.parametrize(
    ("size", "stride", "offset"),
    [
        ((5,), (1,), 0), ((2, 3), (3, 1), 0), ((4,), (1,), 1), ((10**5, 10**5), (0, 0), 0), ((-1,), (1,), 0),
        ((2,), (-1,), 1), ((2,), (1, 1), 0),
    ],
)  # fmt: skip
def test_tensors_that_claim_more_than_there_is_are_refused(
    size: tuple[int, ...], stride: tuple[int, ...], offset: int
) -> None:
    import torch

    tensor: Any = torch.arange(4, dtype=torch.float32)
    function, (storage, _, _, _, *rest) = tensor.__reduce_ex__(2)

    def dumped(size: tuple[int, ...], stride: tuple[int, ...], offset: int) -> bytes:
        """A pickle whose tensor looks at four numbers in that way."""
        return pickle.dumps(Call(function, storage, offset, size, stride, *rest), 2)

    assert loads(dumped((4,), (1,), 0)).tolist() == [0, 1, 2, 3]
    with pytest.raises(InputError, match="tensor"):
        loads(dumped(size, stride, offset))


def test_bombs_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pickled, "MOST_VALUES", 100_000)
    value: list[Any] = ["lol"] * 10
    for _ in range(12):
        value = [value] * 10
    with pytest.raises(InputError, match="too many"):
        loads(pickle.dumps(value))
    loop: list[Any] = []
    loop.append(loop)
    with pytest.raises(InputError, match=r"deeply|many"):
        loads(pickle.dumps(loop))
    monkeypatch.setattr(pickled, "MOST_BYTES", 1000)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x/data.pkl", pickle.dumps([1]))
        archive.writestr("x/data/0", bytes(5000))
    with pytest.raises(InputError, match="too large"):
        loads(stream.getvalue())


@given(st.binary(max_size=60))
def test_what_is_no_pickle_is_refused_in_a_sentence(data: bytes) -> None:
    refused = None
    try:
        loads(data)
    except InputError as error:
        refused = str(error)
    assert refused is None or len(refused) > 10


@FORMATS
def test_cut_files_are_refused(dumped: Callable[[Any], bytes]) -> None:
    import torch

    data = dumped([torch.ones(50)])
    for share in (0.1, 0.5, 0.95):
        with pytest.raises(InputError):
            loads(data[: int(share * len(data))])


@pytest.mark.parametrize(
    ("shape", "told"),
    [
        ([SQUARE[0], SQUARE[1], SQUARE[2]], "go on"),
        ([*SQUARE, *SQUARE], "go on"),
        ([[0.0, 0.0, 1.0]], "4 numbers"),
        ([[0.0, 0.0, float("nan"), 1.0]], "4 numbers"),
        ({"curves": []}, "expected one of"),
        ([], "no primitives"),
        (["line"], "got a str"),
        ([{"start": ["a", "b"], "end": [0, 0]}], "not numbers"),
    ],
)
def test_shapes_that_make_no_sense_are_refused(shape: Any, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        neutral(primitives(shape))
    path = tmp_path / "bad.pkl"
    path.write_bytes(pickle.dumps([SQUARE, shape]))
    with pytest.raises(InputError, match="shape 1"):
        convert(path, tmp_path / "bad.json")
    assert not (tmp_path / "bad.json").exists()


def test_files_without_shapes_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.pkl"
    for data in (pickle.dumps(7), pickle.dumps([]), pickle.dumps("text")):
        path.write_bytes(data)
        with pytest.raises(InputError, match="sequence of shapes"):
            convert(path, tmp_path / "bad.json")
    with pytest.raises(InputError, match="cannot read"):
        convert(tmp_path / "none.pkl", tmp_path / "bad.json")
