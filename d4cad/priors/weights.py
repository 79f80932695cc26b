"""Safetensors files in NumPy: eight bytes with the length of a JSON header, the header, the arrays.

Format: https://huggingface.co/docs/safetensors. Only what the trained prior needs: float16 and float32.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError
from d4cad.files import replacing

TYPES: dict[str, np.dtype[Any]] = {"F16": np.dtype("<f2"), "F32": np.dtype("<f4")}
NAMES = {kind: name for name, kind in TYPES.items()}

Arrays = dict[str, NDArray[Any]]


def write_weights(path: str | Path, arrays: Mapping[str, NDArray[Any]], facts: Mapping[str, str]) -> None:
    """Write arrays by name with facts, both text, in the header."""
    head: dict[str, Any] = {"__metadata__": dict(facts)}
    offset, parts = 0, []
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        parts.append(array.tobytes())
        span = [offset, offset + len(parts[-1])]
        head[name] = {"dtype": NAMES[array.dtype], "shape": list(array.shape), "data_offsets": span}
        offset = span[1]
    text = json.dumps(head, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with replacing(path) as temporary:
        Path(temporary).write_bytes(struct.pack("<Q", len(text)) + text + b"".join(parts))


def read_weights(path: str | Path) -> tuple[Arrays, dict[str, str]]:
    """The arrays and the facts of a file. Raises InputError if it is missing or not such a file."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the weights {path}: {error.strerror}") from None
    try:
        (length,) = struct.unpack_from("<Q", data)
        head = json.loads(data[8 : 8 + length])
        facts = {str(key): str(value) for key, value in head.pop("__metadata__", {}).items()}
        body = memoryview(data)[8 + length :]
        arrays: Arrays = {}
        for name, entry in head.items():
            first, last = entry["data_offsets"]
            kind: np.dtype[Any] = TYPES[entry["dtype"]]
            if not 0 <= first <= last <= len(body):
                raise ValueError
            arrays[name] = np.frombuffer(body[first:last], kind).reshape(entry["shape"])
    except (struct.error, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(f"{path} is not a whole safetensors file of arrays of float16 or float32") from None
    return arrays, facts
