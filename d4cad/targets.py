"""Target shapes that were pickled as tensors, as a file in the neutral format of `d4cad tables --data` and `bench`.

A primitive is 4 numbers (x0, y0, x1, y1), a line, or 5, the last a signed sagitta k, an arc, k > 0 counter-clockwise
(SPEC 2); or a mapping with "start", "end" and perhaps one of SAGITTAS. A shape is a mapping with "lines" and "arcs",
each a sequence or a tensor of primitives, or with "primitives" or "loops"; or a sequence of primitives, or of loops of
them. A file is a sequence of shapes, or a mapping that holds one sequence, the shapes, or shapes by name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.errors import D4cadError, InputError
from d4cad.files import replacing
from d4cad.pickled import read
from d4cad.sketch import Sketch

SAGITTAS = ("bulge_height", "sagitta", "k")
PARTS = ("lines", "arcs", "primitives", "loops")
STRAIGHT = 1e-9
"""Sagittas up to this are those of lines."""
APART = 1e-5
"""World units within which ends of primitives are one vertex: they were single precision."""

Primitive = tuple[complex, complex, float]
Neutral = list[list[dict[str, Any]]]


def convert(source: Path, out: Path) -> int:
    """Write the shapes of a pickled file to ``out``, a .json file; returns their number.

    Nothing in the file is executed (:mod:`d4cad.pickled`). Raises InputError, which names the file and the shape, and
    ExportError.
    """
    entries = []
    for index, shape in enumerate(_shapes(read(source), source)):
        try:
            loops = neutral(primitives(shape))
            Sketch.from_neutral(loops, "world")
        except D4cadError as error:
            raise InputError(f"shape {index} of {source}: {error}") from None
        kinds = [edge["type"] for loop in loops for edge in loop]
        counts = {"n_lines": kinds.count("line"), "n_arcs": kinds.count("arc")}
        entries.append({"id": index, "index": index, "loops": loops, **counts})
    with replacing(out) as part:
        part.write_text(json.dumps(entries) + "\n", encoding="utf-8")
    return len(entries)


def _shapes(value: Any, source: Path) -> Sequence[Any]:
    if isinstance(value, Mapping):
        inner = [item for item in value.values() if isinstance(item, list)]
        value = inner[0] if len(inner) == 1 else list(value.values())
    if not isinstance(value, list) or not value:
        raise InputError(f"{source} holds no sequence of shapes")
    return value


def primitives(shape: Any) -> list[Primitive]:
    """(start, end, sagitta) of every primitive of a shape, x + iy. Raises InputError."""
    if isinstance(shape, Mapping):
        if "start" in shape and "end" in shape:
            return [_primitive(shape)]
        parts = [shape[name] for name in PARTS if shape.get(name) is not None]
        if not parts:
            raise InputError(f"expected one of {', '.join(PARTS)}, got {', '.join(shape) or 'nothing'}")
        return [primitive for part in parts for primitive in primitives(part)]
    if isinstance(shape, np.ndarray):
        if shape.size == 0:
            return []
        if shape.ndim == 1 or shape.shape == (2, 2):
            return [_primitive(shape)]
        return [primitive for row in shape for primitive in primitives(row)]
    if isinstance(shape, list):
        if shape and all(isinstance(item, (int, float)) and not isinstance(item, bool) for item in shape):
            return [_primitive(np.array(shape, np.float64))]
        return [primitive for item in shape for primitive in primitives(item)]
    raise InputError(f"expected primitives, got a {type(shape).__name__}")


def _primitive(value: Any) -> Primitive:
    if isinstance(value, Mapping):
        sagitta = next((value[name] for name in SAGITTAS if value.get(name) is not None), 0.0)
        try:
            numbers = np.concatenate(
                [np.ravel(np.asarray(x, np.float64)) for x in (value["start"], value["end"], sagitta)]
            )
        except (TypeError, ValueError):
            raise InputError("a primitive has ends that are not numbers") from None
    else:
        numbers = np.append(value.ravel(), [0.0] * (value.size == 4))
    if numbers.size != 5 or not np.isfinite(numbers).all():
        raise InputError(f"a primitive has 4 numbers, or 5 for an arc, got {numbers.tolist()}")
    x0, y0, x1, y1, k = numbers.tolist()
    return complex(x0, y0), complex(x1, y1), k


def neutral(found: Sequence[Primitive]) -> Neutral:
    """Closed loops of the primitives, each going on where another ends. Raises InputError where none does, or two."""
    if not found:
        raise InputError("it has no primitives")
    starts = np.array([start for start, _, _ in found])
    left = set(range(len(found)))
    loops: Neutral = []
    while left:
        at = first = min(left)
        loop = []
        while True:
            left.discard(at)
            start, end, k = found[at]
            edge: dict[str, Any] = {"type": "arc" if abs(k) > STRAIGHT else "line"}
            edge |= {"start": [start.real, start.imag], "end": [end.real, end.imag]}
            if edge["type"] == "arc":
                edge["bulge_height"] = k
            loop.append(edge)
            following = [i for i in np.flatnonzero(np.abs(starts - end) <= APART).tolist() if i in left or i == first]
            if len(following) > 1 and first in following:
                following = [first]
            if len(following) != 1:
                raise InputError(f"{len(following)} primitives go on from ({end.real:g}, {end.imag:g}), expected one")
            if following[0] == first:
                break
            at = following[0]
        loop[-1]["end"] = loop[0]["start"]
        for before, after in pairwise(loop):
            before["end"] = after["start"]
        loops.append(loop)
    return loops
