"""Parts that are not their grammar's plain outline: leaves joined by branches, rectangles each by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from d4cad.errors import InputError
from d4cad.exporters import Options
from d4cad.fit import OF_BODIES, Fit
from d4cad.grammars.tree import Tree
from d4cad.placement import Placement
from d4cad.reduction import length
from d4cad.registry import entry
from d4cad.sketch import Sketch

ROUNDS = 4
"""A width in mm of a part of given width depends on its outline, which depends on it: this often is it asked anew."""


def require(
    grammar: str, branches: str | None, *, separate: bool, outputs: Sequence[Path], options: Options | None = None
) -> None:
    """Raises InputError, before a long fit, where branches or separate rectangles cannot be had.

    branches: width as :func:`d4cad.reduction.length` reads it, None for none. options: what else the files are given.
    """
    counted = entry(grammar).counted
    if branches is not None:
        length(branches, 1.0, "width of the branches")
        if counted != "node":
            raise InputError(f"only the leaves of a tree have branches, and the grammar is {grammar}")
    if not separate:
        return
    if counted != "rectangle":
        raise InputError(f"only the rectangles of union-rect can be separate, and the grammar is {grammar}")
    if not any(path.suffix.lower() in OF_BODIES for path in outputs):
        raise InputError(f"no output takes separate rectangles, only {' '.join(OF_BODIES)} files do")
    given = {} if options is None else options.given
    for name in ("kerf", "form"):
        if name in given:
            raise InputError(f"separate rectangles take no {name}: they lap over each other")


def drawn(fit: Fit, placement: Placement, branches: str | None, *, separate: bool) -> Fit:
    """The fit with what of both is asked for; what :func:`require` refuses is refused here too."""
    fit = fit if branches is None else branched(fit, branches, placement)
    return separated(fit) if separate else fit


def branched(fit: Fit, width: str | float, placement: Placement) -> Fit:
    """A tree's fit whose outline joins the leaves by branches of one width into one part.

    width: mm of the part as it is placed, or text with a unit as :func:`d4cad.reduction.length` has it. Raises
    InputError for another grammar and for a width that is not positive.
    """
    grammar = fit.grammar
    if not isinstance(grammar, Tree):
        raise InputError(f"only the leaves of a tree have branches, and the grammar is {grammar.name}")
    outline, world = grammar.outline(fit.program), 0.0
    for _ in range(ROUNDS):
        factor = placement.factor(outline, fit.canvas)
        world = length(width, factor * fit.canvas.pixel, "width of the branches") / factor
        outline = grammar.outline(fit.program, world)
        if placement.width is None:
            break
    return replace(fit, outline=outline, settings={**fit.settings, "branches": world})


def separated(fit: Fit) -> Fit:
    """A fit whose solids and drawings hold every rectangle by itself, at its place. Raises InputError for a program
    that is no union of rectangles."""
    return replace(fit, bodies=Sketch(tuple(face for one in fit.world_rectangles() for face in one.faces), "world"))
