"""Relations between the edges of a sketch, and its named dimensions: what a designer would have constrained.

A reference is a pair (loop, edge) of indices into ``Sketch.loops`` and that loop's edges. Where a kind relates
*points*, the pair stands for the vertex at which the edge starts; in a loop that is one full circle it stands for the
circle's centre, and as an edge for the whole circle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from d4cad.errors import InputError

Ref = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Kind:
    """What a relation of one kind relates and means.

    refs: the least number of references; ``more``: whether there may be more. points: whether they are points. value:
    "length" in the sketch's unit, "angle" in radians, or None for none; ``optional``: whether it may be missing.
    """

    refs: int
    meaning: str
    more: bool = False
    points: bool = False
    value: str | None = None
    optional: bool = False


KINDS = {
    "horizontal": Kind(1, "the line runs along x; of two circular edges, their centres do", more=True),
    "vertical": Kind(1, "the line runs along y; of two circular edges, their centres do", more=True),
    "parallel": Kind(2, "two lines have one direction"),
    "perpendicular": Kind(2, "two lines are at right angles"),
    "tangent": Kind(2, "the second edge leaves where the first ends, in the direction in which it arrives"),
    "equal_radius": Kind(2, "two circular edges have one radius"),
    "concentric": Kind(2, "two circular edges have one centre"),
    "equal_length": Kind(2, "two lines are equally long"),
    "collinear": Kind(2, "two lines lie on one line"),
    "symmetric": Kind(
        2,
        "points a0, b0, a1, b1, ... of whole loops: each b mirrors its a, and the edges with them; "
        "the value is the angle of the axis to x, where that is fixed",
        more=True,
        points=True,
        value="angle",
        optional=True,
    ),
    "congruent": Kind(
        2,
        "points a0, b0, a1, b1, ... all around two loops of one shape, one of them turned and moved; "
        "or around one loop that is its own image, turned",
        more=True,
        points=True,
    ),
    "polar": Kind(3, "centres of circles, in order, evenly on a circle", True, True),
    "row": Kind(3, "centres of circles, in order, evenly on a line", True, True),
    "radius": Kind(1, "radius of an arc", value="length"),
    "diameter": Kind(1, "diameter of a circle", value="length"),
    "length": Kind(1, "length of a line", value="length"),
    "distance": Kind(2, "distance of two parallel lines, or of two centres", value="length"),
    "angle": Kind(2, "angle from the first line to the second, modulo half a turn", value="angle"),
    "width": Kind(0, "extent of the whole sketch in x", value="length"),
    "height": Kind(0, "extent of the whole sketch in y", value="length"),
}
"""Every kind of relation by its name. Those from "radius" on are dimensions."""

DIMENSIONS = ("radius", "diameter", "length", "distance", "angle", "width", "height")


@dataclass(frozen=True, slots=True)
class Relation:
    """One thing that holds exactly in a sketch.

    kind: one of ``KINDS``, which says what the references are. value: a length in the sketch's unit or an angle in
    radians. Raises InputError for an unknown kind, a wrong number of references, or a missing or unwanted value.
    """

    kind: str
    refs: tuple[Ref, ...]
    value: float | None = None

    def __post_init__(self) -> None:
        known = KINDS.get(self.kind)
        if known is None:
            raise InputError(f"there is no relation {self.kind!r}, expected one of: {', '.join(KINDS)}")
        _check(self.kind, self.refs, known)
        if self.value is None:
            if known.value is not None and not known.optional:
                raise InputError(f"the relation {self.kind} needs a value, got none")
        elif known.value is None or not isfinite(self.value):
            raise InputError(f"the relation {self.kind} does not take the value {self.value}")

    def scaled(self, factor: float) -> Relation:
        """The relation in a sketch whose coordinates are multiplied by ``factor``."""
        if self.value is None or KINDS[self.kind].value != "length":
            return self
        return replace(self, value=self.value * factor)


@dataclass(frozen=True, slots=True)
class Dimension:
    """A named size of a sketch, for the parameters of generated code.

    name: a Python identifier, unique in its sketch. kind: one of ``DIMENSIONS``. refs: every edge that has this size
    (for a distance or an angle: the two edges; for width and height: none). value: in the sketch's unit, or radians.
    round: whether the value was made a round number. Raises InputError as :class:`Relation`.
    """

    name: str
    kind: str
    refs: tuple[Ref, ...]
    value: float
    round: bool = False

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise InputError(f"the name of a dimension must be an identifier, got {self.name!r}")
        if self.kind not in DIMENSIONS:
            raise InputError(f"there is no dimension {self.kind!r}, expected one of: {', '.join(DIMENSIONS)}")
        _check(self.kind, self.refs, replace(KINDS[self.kind], more=True))
        if not isfinite(self.value):
            raise InputError(f"the dimension {self.name} has the value {self.value}")

    def scaled(self, factor: float) -> Dimension:
        """The dimension of a sketch whose coordinates are multiplied by ``factor``."""
        return self if KINDS[self.kind].value != "length" else replace(self, value=self.value * factor)


def to_json(relations: Iterable[Relation], dimensions: Iterable[Dimension]) -> dict[str, Any]:
    """The JSON value of a program file's key "regularisation"."""
    return {
        "relations": [
            {
                "kind": r.kind,
                "refs": [list(ref) for ref in r.refs],
                **({} if r.value is None else {"value": _written(r)}),
            }
            for r in relations
        ],
        "dimensions": [
            {
                "name": d.name,
                "kind": d.kind,
                "refs": [list(ref) for ref in d.refs],
                "value": _written(d),
                "round": d.round,
            }
            for d in dimensions
        ],
    }


def _written(fact: Relation | Dimension) -> float:
    """Of a length twelve digits: those that survive the way from mm to world units and back."""
    value = fact.value or 0.0
    return float(f"{value:.12g}") if fact.scaled(2.0).value != value else value


def from_json(value: object, edges: list[int]) -> tuple[tuple[Relation, ...], tuple[Dimension, ...]]:
    """The inverse of :func:`to_json`. ``edges``: the number of edges of each loop that references may name.

    Raises InputError, which says what is wrong.
    """
    if not isinstance(value, dict):
        raise InputError(f"expected an object with relations and dimensions, got {type(value).__name__}")
    relations = tuple(
        Relation(_text(entry, "kind"), _refs(entry, edges), _value(entry)) for entry in _entries(value, "relations")
    )
    dimensions = tuple(
        Dimension(
            _text(entry, "name"),
            _text(entry, "kind"),
            _refs(entry, edges),
            _required(entry),
            bool(entry.get("round", False)),
        )
        for entry in _entries(value, "dimensions")
    )
    names = [dimension.name for dimension in dimensions]
    if len(set(names)) != len(names):
        raise InputError("two dimensions have one name")
    return relations, dimensions


def _check(name: str, refs: tuple[Ref, ...], known: Kind) -> None:
    paired = name in ("symmetric", "congruent")
    few, many = len(refs) < known.refs, len(refs) > known.refs and not known.more
    if few or many or (paired and len(refs) % 2):
        raise InputError(f"{len(refs)} references are the wrong number for {name}")


def _entries(value: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    entries = value.get(key, [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{key} is not a list of objects")
    return entries


def _text(entry: Mapping[str, Any], key: str) -> str:
    text = entry.get(key)
    if not isinstance(text, str):
        raise InputError(f"a relation or dimension has no {key}")
    return text


def _refs(entry: Mapping[str, Any], edges: list[int]) -> tuple[Ref, ...]:
    refs = entry.get("refs")
    if not isinstance(refs, list):
        raise InputError("a relation or dimension has no refs")
    for ref in refs:
        if (
            not isinstance(ref, list)
            or len(ref) != 2
            or not all(isinstance(k, int) and not isinstance(k, bool) for k in ref)
        ):
            raise InputError(f"a reference is not a pair [loop, edge]: {ref!r}")
        if not (0 <= ref[0] < len(edges) and 0 <= ref[1] < edges[ref[0]]):
            raise InputError(f"there is no edge {ref[1]} of loop {ref[0]}")
    return tuple((ref[0], ref[1]) for ref in refs)


def _value(entry: Mapping[str, Any]) -> float | None:
    return None if entry.get("value") is None else _required(entry)


def _required(entry: Mapping[str, Any]) -> float:
    value = entry.get("value")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"a relation or dimension has the value {value!r}, expected a number")
    return float(value)
