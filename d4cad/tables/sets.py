"""Three sets of our own shapes, analogous to the paper's and drawn from seeds: anyone has them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from d4cad.bench import Case
from d4cad.errors import InputError
from d4cad.shapes import generate
from d4cad.sketch import Sketch

SHAPES = 24
"""Shapes of each set."""
PRIMITIVES = (6, 12)
"""The least and the greatest number asked of the generator; the paper's shapes have 8 to 9 on average."""

Topology = Callable[[Sketch], bool]

TOPOLOGIES: dict[str, Topology] = {
    "one-component": lambda shape: len(shape.faces) == 1 and not shape.faces[0].holes,
    "ring": lambda shape: len(shape.faces) == 1 and len(shape.faces[0].holes) == 1,
    "two-components": lambda shape: len(shape.faces) == 2 and not any(face.holes for face in shape.faces),
}
"""What the sets have in common with the paper's OneComp, Donut and TwoComp."""

TWINS = {"one-component": "onecomp", "ring": "donut", "two-components": "twocomp"}
"""The paper's set that each is analogous to."""


def cases(limit: int | None = None) -> list[Case]:
    """The first ``limit`` shapes of each set, SHAPES at most. Raises InputError for a limit under 1."""
    if limit is not None and limit < 1:
        raise InputError(f"the limit must be 1 or more, got {limit}")
    count = SHAPES if limit is None else min(limit, SHAPES)
    return [Case(name, index, shape(name, index).to_neutral()) for name in TOPOLOGIES for index in range(count)]


def shape(name: str, index: int) -> Sketch:
    """Shape ``index`` of a set in world units: the first of the generator's that has the set's topology."""
    rng = np.random.default_rng((list(TOPOLOGIES).index(name), index))
    while True:
        found = generate(rng, int(rng.integers(PRIMITIVES[0], PRIMITIVES[1] + 1)))
        if TOPOLOGIES[name](found):
            return found
