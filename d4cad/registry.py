"""Grammars and methods by the names they have on the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from d4cad.canvas import Canvas
from d4cad.descent import Method
from d4cad.errors import InputError
from d4cad.grammars.arc_line import ArcLine, sagitta_metric
from d4cad.grammars.arc_line.drawing import drawn
from d4cad.grammars.arc_line.places import UniformPlaces
from d4cad.methods import fast, paper
from d4cad.program import Floats, Program
from d4cad.protocols import Grammar
from d4cad.sketch import Sketch

PAPER_LOSSY = 0.03
"""World length by which the paper lets a lossy rewrite move the outline (SPEC 3)."""
PAPER_RULES = ("split", "to-arc", "to-line", "merge-line", "merge-arc", "close", "add-loop", "remove-loop")


@dataclass(frozen=True, slots=True)
class Entry:
    """A grammar: as the default method wants it, as the paper has it, the number of parameters of a structure,
    the paper's scaling of the gradient, and the program that draws a given outline, where there always is one."""

    fast: Callable[[Canvas], Grammar[Any]]
    paper: Callable[[Canvas], Grammar[Any]]
    size: Callable[[Any], int]
    metric: Callable[[Program[Any]], Floats] | None = None
    draw: Callable[[Sketch], Program[Any]] | None = None


def _paper_arc_line(canvas: Canvas) -> ArcLine:
    rules = frozenset(PAPER_RULES)
    return ArcLine(canvas.pixel, rules, UniformPlaces(), PAPER_LOSSY / canvas.pixel, arc_weight=1.0)


GRAMMARS = {
    "arc-line": Entry(
        fast=lambda canvas: ArcLine(canvas.pixel),
        paper=_paper_arc_line,
        size=lambda structure: int(structure.layout.size),
        metric=sagitta_metric,
        draw=drawn,
    ),
}
METHODS: dict[str, Callable[[Entry, Canvas, float], Method]] = {
    "fast": lambda grammar, canvas, floor: fast(canvas, floor),
    "paper": lambda grammar, canvas, floor: paper(canvas, grammar.metric),
}


def entry(grammar: str) -> Entry:
    """The grammar's entry. Raises InputError for an unknown name."""
    if grammar not in GRAMMARS:
        raise InputError(f"there is no grammar {grammar!r}, expected one of: {', '.join(GRAMMARS)}")
    return GRAMMARS[grammar]


def make_grammar(grammar: str, method: str, canvas: Canvas) -> Grammar[Any]:
    """The grammar as ``method`` uses it on ``canvas``. Raises InputError for an unknown name."""
    found = entry(grammar)
    return found.paper(canvas) if method == "paper" else found.fast(canvas)


def make_method(method: str, canvas: Canvas, floor: float, grammar: str = "arc-line") -> Method:
    """The settings of ``method`` for ``grammar``; ``floor``: the last price of a primitive, in summed squared error.

    Raises InputError for an unknown name.
    """
    if method not in METHODS:
        raise InputError(f"there is no method {method!r}, expected one of: {', '.join(METHODS)}")
    return METHODS[method](entry(grammar), canvas, floor)
