"""Round dimensions: sizes that might be whole multiples of a step that people measure in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from d4cad.regularize.candidates import LIKELY
from d4cad.regularize.measures import Measures
from d4cad.regularize.parameters import Parameters
from d4cad.regularize.selection import Candidate
from d4cad.relations import Relation
from d4cad.sketch import Sketch

MILLIMETRES = (10.0, 5.0, 1.0, 0.5, 0.25, 0.1)
INCHES = tuple(25.4 / part for part in (1, 2, 4, 8, 16, 32, 64))
"""Steps in mm, the coarsest first."""


def round_candidates(
    layout: Parameters, at: Measures, sketch: Sketch, scale: float, steps: Sequence[float]
) -> Iterator[Candidate]:
    """Each size of the sketch with the nearest multiple of each step. ``scale``: mm per unit of the sketch.

    A designer who works in steps of one size leaves sizes spread evenly between their multiples to nobody: the spread
    of a size that is not round is the step.
    """
    for relation, relative in _sizes(layout, at, sketch):
        assert relation.value is not None
        size = relation.value * scale
        for step in steps:
            count = round(size / step)
            if count >= 1:
                spread = step / size if relative else step / scale
                value = count * step / scale
                price = LIKELY if relation.refs else 0.0
                yield Candidate(Relation(relation.kind, relation.refs, value), price, spread)


def _sizes(layout: Parameters, at: Measures, sketch: Sketch) -> Iterator[tuple[Relation, bool]]:
    """Sizes as they are, as relations, and whether their equations are relative ones."""
    xmin, ymin, xmax, ymax = sketch.bounds
    yield Relation("width", (), xmax - xmin), False
    yield Relation("height", (), ymax - ymin), False
    rings = {layout.starts[loop] for loop in np.flatnonzero(layout.circles)}
    for k, ref in enumerate(layout.refs):
        if k in rings:
            yield Relation("diameter", (ref,), 2 * float(np.exp(at.radius.value[k]))), True
        elif layout.arcs[k] and k - 1 not in rings:
            yield Relation("radius", (ref,), float(np.exp(at.radius.value[k]))), True
        elif not layout.arcs[k]:
            yield Relation("length", (ref,), float(np.exp(at.chord.value[k]))), True
    centers = sorted(rings)
    for i, a in enumerate(centers):
        for b in centers[i + 1 :]:
            d = float(np.hypot(at.cx.value[b] - at.cx.value[a], at.cy.value[b] - at.cy.value[a]))
            if d > 0.1 * float(np.exp(at.radius.value[a])):
                yield Relation("distance", (layout.refs[a], layout.refs[b]), d), False
