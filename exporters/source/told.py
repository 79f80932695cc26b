"""The relations of a sketch in words, for comments."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from d4cad.exporters.source.words import contours, listed
from d4cad.relations import DIMENSIONS
from d4cad.sketch import Sketch

SHOWN = ("horizontal", "vertical", "equal_radius")
"""Kinds that between circles are told by their parameters."""

BETWEEN = {"polar": "evenly on a circle", "row": "evenly on a line"}


def told(sketch: Sketch, names: Mapping[int, str]) -> tuple[dict[int, str], tuple[str, ...]]:
    """By the index of a loop, the relations between its edges; and a line for each kind between several loops.

    ``names``: of contours, by index of the loop. Sizes are no relations.
    """
    within: dict[int, Counter[str]] = {}
    between: dict[tuple[str, frozenset[int]], None] = {}
    for relation in sketch.relations:
        loops = frozenset(loop for loop, _ in relation.refs)
        if relation.kind in DIMENSIONS or not loops:
            continue
        if len(loops) == 1:
            within.setdefault(min(loops), Counter())[relation.kind] += 1
        elif relation.kind not in SHOWN:
            between[relation.kind, loops] = None
    return {loop: _counted(kinds) for loop, kinds in within.items()}, tuple(
        f"{contours([name for loop, name in names.items() if loop in loops])}: {BETWEEN.get(kind, _words(kind))}"
        for kind, loops in between
    )


def _counted(kinds: Counter[str]) -> str:
    return listed(
        [_words(kind) if kind in ("symmetric", "congruent") else f"{n} {_words(kind)}" for kind, n in kinds.items()]
    )


def _words(kind: str) -> str:
    return "repeats itself when turned" if kind == "congruent" else kind.replace("_", " ")
