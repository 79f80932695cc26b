"""Relations and dimensions as values: checked when made, scaled with their sketch, read back from JSON."""

from __future__ import annotations

import json
from typing import Any

import pytest

from d4cad.errors import InputError
from d4cad.relations import KINDS, Dimension, Relation, from_json, to_json
from d4cad.sketch import Circle, Loop, Sketch

RELATIONS = (
    Relation("horizontal", ((0, 0),)),
    Relation("tangent", ((0, 0), (0, 1))),
    Relation("symmetric", ((0, 0), (0, 1), (0, 2), (0, 3)), 0.75),
    Relation("diameter", ((1, 0),), 2.0),
    Relation("width", (), 4.0),
)
DIMENSIONS = (
    Dimension("width", "width", (), 4.0, True),
    Dimension("hole_diameter", "diameter", ((1, 0),), 2.0),
    Dimension("angle", "angle", ((0, 0), (0, 1)), 0.75),
)


def plate() -> Sketch:
    square = Loop.polyline([(0, 0), (4, 0), (4, 4), (0, 4)])
    made = Sketch.from_loops([square, Circle((2, 2), 1).loop()], "mm")
    return Sketch(made.faces, "mm", RELATIONS, DIMENSIONS)


@pytest.mark.parametrize(
    ("kind", "refs", "value", "message"),
    [
        ("near", ((0, 0),), None, "no relation 'near'"),
        ("horizontal", (), None, "wrong number"),
        ("parallel", ((0, 0),), None, "wrong number"),
        ("parallel", ((0, 0), (0, 1), (0, 2)), None, "wrong number"),
        ("symmetric", ((0, 0), (0, 1), (0, 2)), None, "wrong number"),
        ("radius", ((0, 0),), None, "needs a value"),
        ("radius", ((0, 0),), float("nan"), "does not take"),
        ("parallel", ((0, 0), (0, 1)), 1.0, "does not take"),
    ],
)
def test_a_wrong_relation_is_refused(kind: str, refs: Any, value: float | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Relation(kind, refs, value)


@pytest.mark.parametrize(
    ("name", "kind", "value", "message"),
    [
        ("2nd", "width", 1.0, "identifier"),
        ("size", "parallel", 1.0, "no dimension"),
        ("size", "width", float("inf"), "has the value"),
        ("size", "radius", 1.0, "wrong number"),
    ],
)
def test_a_wrong_dimension_is_refused(name: str, kind: str, value: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Dimension(name, kind, (), value)


def test_lengths_scale_with_the_sketch_and_angles_do_not() -> None:
    scaled = plate().scaled(2.5)
    assert [r.value for r in scaled.relations] == [None, None, 0.75, 5.0, 10.0]
    assert [d.value for d in scaled.dimensions] == [10.0, 5.0, 0.75]
    assert [d.name for d in scaled.dimensions] == ["width", "hole_diameter", "angle"]


def test_a_moved_sketch_keeps_its_relations() -> None:
    moved = plate().translated(3, -1)
    assert (moved.relations, moved.dimensions) == (RELATIONS, DIMENSIONS)


def test_simplifying_keeps_relations_only_where_every_edge_stays() -> None:
    sketch = plate()
    kept = Sketch((sketch.faces[0].__class__(sketch.faces[0].outer),), "mm", RELATIONS[:1])
    assert kept.simplified(1e-6) == kept
    notched = Loop.polyline([(0, 0), (2, 0), (4, 0), (4, 4), (0, 4)])
    changed = Sketch(Sketch.from_loops([notched], "mm").faces, "mm", RELATIONS[:1]).simplified(1e-6)
    assert len(changed.loops[0].points) == 4
    assert changed.relations == ()


def test_json_reads_back_the_same() -> None:
    text = json.dumps(to_json(RELATIONS, DIMENSIONS))
    assert from_json(json.loads(text), [4, 2]) == (RELATIONS, DIMENSIONS)
    assert from_json({}, []) == ((), ())


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([], "expected an object"),
        ({"relations": 3}, "not a list of objects"),
        ({"relations": [3]}, "not a list of objects"),
        ({"relations": [{"refs": []}]}, "no kind"),
        ({"relations": [{"kind": "horizontal"}]}, "no refs"),
        ({"relations": [{"kind": "horizontal", "refs": [[0]]}]}, "not a pair"),
        ({"relations": [{"kind": "horizontal", "refs": [[0, True]]}]}, "not a pair"),
        ({"relations": [{"kind": "horizontal", "refs": [[0, 4]]}]}, "no edge 4 of loop 0"),
        ({"relations": [{"kind": "horizontal", "refs": [[-1, 0]]}]}, "no edge 0 of loop -1"),
        ({"relations": [{"kind": "radius", "refs": [[0, 0]], "value": "3"}]}, "expected a number"),
        ({"dimensions": [{"name": "a", "kind": "width", "refs": []}]}, "expected a number"),
        ({"dimensions": [{"name": "a", "kind": "width", "refs": [], "value": 1}] * 2}, "one name"),
    ],
)
def test_what_is_no_regularisation_is_refused(value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        from_json(value, [4, 2])


def test_every_kind_says_what_it_means() -> None:
    assert all(kind.meaning for kind in KINDS.values())
