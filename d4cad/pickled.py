"""Tensors that PyTorch pickled, read without PyTorch and without running anything.

A pickle is a program: it may name any function of any module and call it. Here only what tensors need can be named,
each name stands for a harmless function of our own, and everything else is refused before it is looked up. Formats: the
zip archive and the older stream of ``torch.save`` (https://pytorch.org/docs/stable/notes/serialization.html), and plain
pickles that hold tensors.
"""

from __future__ import annotations

import io
import pickle
import struct
import zipfile
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError

MOST_BYTES = 1 << 28
"""Files, members of archives and tensors beyond this size are no target shapes."""
MOST_VALUES = 5_000_000
"""Values in all lists and mappings of a file, each counted as often as it is met."""
LEGACY = 0x1950A86A20F9469CFC6C
"""The number that ``torch.save`` began its files with before they were archives."""
KINDS = {
    "DoubleStorage": "<f8", "FloatStorage": "<f4", "HalfStorage": "<f2", "LongStorage": "<i8", "IntStorage": "<i4",
    "ShortStorage": "<i2", "CharStorage": "<i1", "ByteStorage": "<u1", "BoolStorage": "<u1", "UntypedStorage": "<u1",
}  # fmt: skip
"""NumPy's types of PyTorch's storages."""


@dataclass(slots=True, eq=False)
class Storage:
    """A run of numbers; ``data`` may come after the tensors that look at it."""

    kind: str
    data: bytes = b""


@dataclass(frozen=True, slots=True, eq=False)
class Tensor:
    """A view of a storage, as in PyTorch: offset and strides in numbers."""

    storage: Storage
    offset: int
    size: tuple[int, ...]
    stride: tuple[int, ...]

    def array(self) -> NDArray[np.float64]:
        """The numbers as float64. Raises InputError where the view leaves the storage."""
        numbers = np.frombuffer(self.storage.data, dtype=self.storage.kind)
        whole = (self.offset, *self.size, *self.stride)
        if not all(type(n) is int and 0 <= n < MOST_BYTES for n in whole) or len(self.size) != len(self.stride):
            raise InputError(f"it has a tensor of size {self.size} and strides {self.stride}")
        count = prod(self.size)
        last = self.offset + sum((n - 1) * step for n, step in zip(self.size, self.stride, strict=True))
        if count * 8 > MOST_BYTES or (count and last >= numbers.size):
            raise InputError(f"it has a tensor of {count} numbers that are not in it")
        index = np.array(self.offset)
        for n, step in zip(self.size, self.stride, strict=True):
            index = index[..., None] + np.arange(n) * step
        return np.asarray(numbers[index], dtype=np.float64)


@dataclass(slots=True)
class _File:
    """What the pickles of one file share."""

    storages: dict[str, Storage] = field(default_factory=dict)
    depth: int = 0


def read(path: Path) -> Any:
    """What a file holds: lists, mappings, text, numbers, and arrays (float64) for tensors.

    Raises InputError, which names ``path``, for a file that names anything else, that is broken, or that is too large.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError("it is too large for a file of shapes")
        return loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except InputError as error:
        raise InputError(f"{path} is refused: {error}") from None


def loads(data: bytes) -> Any:
    """The same from bytes."""
    try:
        return _plain(_loaded(data, _File()), _Budget())
    except InputError:
        raise
    except RecursionError:
        raise InputError("it is nested too deeply") from None
    except MemoryError:
        raise InputError("it asks for too much memory") from None
    except Exception as error:  # noqa: BLE001  # a broken pickle raises whatever its broken parts raise
        raise InputError(f"it is not a pickle of tensors ({type(error).__name__}: {error})") from None


def _loaded(data: bytes, file: _File) -> Any:
    if data[:4] == b"PK\x03\x04":
        return _archive(data)
    stream = io.BytesIO(data)
    first = _Unpickler(stream, file).load()
    if not (isinstance(first, int) and first == LEGACY):
        return first
    for _ in range(2):  # the version of the format, and facts of the machine
        _Unpickler(stream, file).load()
    value = _Unpickler(stream, file).load()
    for key in _Unpickler(stream, file).load():
        storage = file.storages[key]
        (count,) = struct.unpack("<q", stream.read(8))
        width = np.dtype(storage.kind).itemsize
        if not 0 <= count * width <= len(data):
            raise InputError(f"it has a storage of {count} numbers that are not in it")
        storage.data = stream.read(count * width)
        if len(storage.data) != count * width:
            raise InputError("it ends before its numbers do")
    return value


def _archive(data: bytes) -> Any:
    """The value in the archive of ``torch.save``: ``NAME/data.pkl``, with numbers in ``NAME/data/KEY``."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: info for info in archive.infolist()}
        (pickled,) = (name for name in members if name.endswith("/data.pkl"))
        folder = pickled.removesuffix("data.pkl")
        if sum(info.file_size for info in members.values()) > MOST_BYTES:
            raise InputError("it is too large for a file of shapes")
        if f"{folder}byteorder" in members and archive.read(f"{folder}byteorder") != b"little":
            raise InputError("its numbers are big-endian")
        file = _File()
        value = _Unpickler(io.BytesIO(archive.read(pickled)), file).load()
        for key, storage in file.storages.items():
            data, width = archive.read(f"{folder}data/{key}"), np.dtype(storage.kind).itemsize
            storage.data = data[: len(data) // width * width]
        return value


class _Unpickler(pickle.Unpickler):
    """Knows the few names of KINDS and NAMES, and no others."""

    def __init__(self, stream: io.BytesIO, file: _File) -> None:
        super().__init__(stream, encoding="utf-8")
        self.file = file

    def find_class(self, module: str, name: str) -> Any:
        """What a name stands for; InputError for all but those that tensors need."""
        if module == "torch" and name in KINDS:
            return KINDS[name]
        if (module, name) == ("torch.storage", "_load_from_bytes"):
            return self._nested
        if (module, name) not in NAMES:
            raise InputError(f"it names {module}.{name}, and nothing but tensors is read")
        return partial(NAMES[module, name])  # a pickle may set attributes of what it has named

    def persistent_load(self, pid: Any) -> Storage:
        """The storage that a tensor looks at: ("storage", kind, key, device, numbers)."""
        if not (isinstance(pid, tuple) and len(pid) >= 5 and pid[0] == "storage" and pid[1] in KINDS.values()):
            raise InputError("it refers to something that is no storage")
        return self.file.storages.setdefault(str(pid[2]), Storage(str(pid[1])))

    def _nested(self, data: Any) -> Any:
        """A storage within a plain pickle: a file of its own."""
        if not isinstance(data, bytes) or self.file.depth > 2:
            raise InputError("it has a storage that is none")
        return _loaded(data, _File(depth=self.file.depth + 1))


def _tensor(storage: Any, offset: int, size: Any, stride: Any, *_: Any) -> Tensor:
    if not isinstance(storage, Storage) or not isinstance(size, tuple) or not isinstance(stride, tuple):
        raise InputError("it has a tensor without numbers")
    return Tensor(storage, offset, size, stride)


def _parameter(data: Any, *_: Any) -> Tensor:
    if not isinstance(data, Tensor):
        raise InputError("it has a parameter that is no tensor")
    return data


def _latin1(text: Any, encoding: Any = "latin1") -> bytes:
    """Bytes, as the older protocols of pickle write them."""
    if not isinstance(text, str) or encoding != "latin1":
        raise InputError("it encodes text in a way that no tensor needs")
    return text.encode("latin1")


NAMES: dict[tuple[str, str], Callable[..., Any]] = {
    ("torch._utils", "_rebuild_tensor_v2"): _tensor,
    ("torch._utils", "_rebuild_parameter"): _parameter,
    ("collections", "OrderedDict"): OrderedDict,
    ("_codecs", "encode"): _latin1,
}
"""What may be named, and what is called for it."""


@dataclass(slots=True)
class _Budget:
    """How many more values may be met."""

    left: int = field(default_factory=lambda: MOST_VALUES)

    def spend(self, count: int) -> None:
        """Raises InputError when it is used up: a few bytes can refer to one value a billion times."""
        self.left -= count
        if self.left < 0:
            raise InputError("it holds too many values for a file of shapes")


def _plain(value: Any, budget: _Budget) -> Any:
    """Arrays for tensors, and only lists, mappings, text and numbers around them."""
    budget.spend(1)
    if isinstance(value, Tensor):
        array = value.array()
        budget.spend(array.size)
        return array
    if isinstance(value, dict):
        return {str(key): _plain(item, budget) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, budget) for item in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise InputError(f"it holds a {type(value).__name__}, and only lists, mappings, numbers and tensors are read")
