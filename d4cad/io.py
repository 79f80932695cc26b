"""The program file: one versioned JSON format that d4cad and other software read.

It holds the program (grammar, structure, parameters, canvas), how it was found (settings, history, stop, psnr) and,
under ``loops``, its outline in ``unit``, y up, origin as chosen: loops of ``{"type": "line", "start": [x, y],
"end": [x, y]}`` and ``{"type": "arc", ..., "bulge": b}``, b = tan(sweep / 4), > 0 counter-clockwise (the DXF bulge).
Under ``regularisation``, which may be missing, it says what holds exactly between these edges and names their sizes:
``{"relations": [{"kind", "refs": [[loop, edge], ...], "value"}], "dimensions": [{"name", "kind", "refs", "value",
"round"}]}``, kinds as in :mod:`d4cad.relations`, lengths in ``unit``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar, cast

from d4cad import __version__
from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.files import read_text, replacing
from d4cad.relations import Dimension, Relation, from_json, to_json

FORMAT = "d4cad-program"
VERSION = 1
UNITS = ("mm", "world")
RECORD = ("step", "loss", "primitives", "accepted", "seconds")
"""Keys of one history record: a mean squared error, counts, and seconds since the start."""
COUNTS = ("step", "primitives", "accepted")


@dataclass(frozen=True, slots=True, eq=False)
class ProgramFile:
    """The contents of a program file, checked but not yet decoded by its grammar.

    structure: the JSON value that the grammar encoded. params: world units and pure numbers. history: one mapping per
    record with the keys ``RECORD``. stop: name of the stop reason. psnr: dB. loops: the outline in ``unit``. relations,
    dimensions: of the loops, lengths in ``unit``.
    extra: further keys, kept as they are.
    """

    grammar: str
    structure: Any
    params: tuple[float, ...]
    canvas: Canvas
    settings: Mapping[str, Any]
    history: tuple[Mapping[str, float], ...]
    stop: str
    psnr: float
    primitives: int
    unit: str
    loops: list[list[dict[str, Any]]]
    extra: Mapping[str, Any] = field(default_factory=dict)
    relations: tuple[Relation, ...] = ()
    dimensions: tuple[Dimension, ...] = ()


def write(path: str | PathLike[str], file: ProgramFile) -> None:
    """Write ``file`` to ``path``, all of it or nothing. Raises ExportError."""
    text = dumps(file)
    with replacing(Path(path)) as part:
        part.write_text(text, encoding="utf-8")


def read(path: str | PathLike[str]) -> ProgramFile:
    """Read a program file. Raises InputError, which names ``path``, if it is none."""
    path = Path(path)
    text = read_text(path, "program file")
    try:
        return loads(text)
    except InputError as error:
        raise InputError(f"{path} is not a usable program file: {error}") from None


def dumps(file: ProgramFile) -> str:
    """The file's text: JSON with one top-level key a line, floats that read back exactly."""
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "d4cad": __version__,
        "grammar": file.grammar,
        "structure": file.structure,
        "params": [float(x) for x in file.params],
        "canvas": {
            "width": file.canvas.width,
            "height": file.canvas.height,
            "pixel": file.canvas.pixel,
            "ramp": file.canvas.ramp,
        },
        "settings": dict(file.settings),
        "history": [dict(record) for record in file.history],
        "stop": file.stop,
        "psnr": float(file.psnr),
        "primitives": int(file.primitives),
        **file.extra,
        "unit": file.unit,
        "loops": file.loops,
    }
    if file.relations or file.dimensions:
        document["regularisation"] = to_json(file.relations, file.dimensions)
    lines = (f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in document.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def loads(text: str) -> ProgramFile:
    """The inverse of :func:`dumps`. Raises InputError with what was expected and what came."""
    try:
        document = json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise InputError(f"it is not JSON (line {error.lineno}: {error.msg})") from None
    except RecursionError:
        raise InputError("its JSON is nested too deeply") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f'it does not say "format": "{FORMAT}"')
    if document.get("version") != VERSION:
        raise InputError(f"its version is {document.get('version')!r}, and this d4cad reads version {VERSION}")
    unit = _take(document, "unit", str)
    if unit not in UNITS:
        raise InputError(f'its "unit" is {unit!r}, expected one of {", ".join(UNITS)}')
    if "structure" not in document:
        raise InputError('it has no "structure"')
    history = _take(document, "history", list)
    loops = _loops(_take(document, "loops", list))
    relations, dimensions = _regularisation(document.get("regularisation", {}), [len(loop) for loop in loops])
    return ProgramFile(
        grammar=_take(document, "grammar", str),
        structure=document["structure"],
        params=tuple(_number(x, f"params[{i}]") for i, x in enumerate(_take(document, "params", list))),
        canvas=_canvas(_take(document, "canvas", dict)),
        settings=_take(document, "settings", dict),
        history=tuple(_record(record, i) for i, record in enumerate(history)),
        stop=_take(document, "stop", str),
        psnr=_number(_take(document, "psnr", float), "psnr"),
        primitives=_take(document, "primitives", int),
        unit=unit,
        loops=loops,
        relations=relations,
        dimensions=dimensions,
        extra={key: value for key, value in document.items() if key not in _KEYS},
    )


_KEYS = frozenset(
    ("format", "version", "d4cad", "grammar", "structure", "params", "canvas", "settings", "history", "stop", "psnr")
) | {"primitives", "unit", "loops", "regularisation"}
_KINDS: dict[type, str] = {str: "text", int: "a whole number", float: "a number", list: "a list", dict: "an object"}


T = TypeVar("T")


def _take(document: Mapping[str, Any], key: str, kind: type[T]) -> T:
    """``document[key]`` if it is there and of that kind; whole numbers are numbers, booleans are not."""
    if key not in document:
        raise InputError(f'it has no "{key}"')
    value = document[key]
    if isinstance(value, bool) or not isinstance(value, (int, float) if kind is float else kind):
        raise InputError(f'its "{key}" is {_short(value)}, expected {_KINDS[kind]}')
    return cast(T, value)


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"its {where} is {_short(value)}, expected a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"its {where} is not a finite number")
    return number


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _refuse_constant(name: str) -> None:
    raise InputError(f"it holds {name}, which is not a finite number")


def _canvas(value: Mapping[str, Any]) -> Canvas:
    try:
        return Canvas(
            _take(value, "width", int),
            _take(value, "height", int),
            _number(value.get("pixel"), "canvas pixel"),
            _number(value.get("ramp"), "canvas ramp"),
        )
    except InputError as error:
        raise InputError(f"in its canvas, {error}") from None


def _loops(value: list[Any]) -> list[list[dict[str, Any]]]:
    """The loops, each edge an object with a type and finite ends."""
    for i, loop in enumerate(value):
        if not isinstance(loop, list):
            raise InputError(f"its loops[{i}] is {_short(loop)}, expected a list of edges")
        for j, edge in enumerate(loop):
            where = f"loops[{i}][{j}]"
            if not isinstance(edge, dict) or edge.get("type") not in ("line", "arc"):
                raise InputError(f"its {where} is not a line or an arc")
            for end in ("start", "end"):
                point = edge.get(end)
                if not isinstance(point, list) or len(point) != 2:
                    raise InputError(f"its {where} has no {end} [x, y]")
                for x in point:
                    _number(x, f"{where}.{end}")
            if edge["type"] == "arc":
                _number(edge.get("bulge"), f"{where}.bulge")
    return value


def _regularisation(value: object, edges: list[int]) -> tuple[tuple[Relation, ...], tuple[Dimension, ...]]:
    try:
        return from_json(value, edges)
    except InputError as error:
        raise InputError(f'in its "regularisation", {error}') from None


def _record(value: object, i: int) -> dict[str, float]:
    if not isinstance(value, dict):
        raise InputError(f"its history[{i}] is {_short(value)}, expected an object")
    record = {key: _number(value.get(key), f"history[{i}].{key}") for key in RECORD}
    return {key: int(x) if key in COUNTS else x for key, x in record.items()}
