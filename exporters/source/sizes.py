"""Round sizes as parameters, from which coordinates follow."""

from __future__ import annotations

import re

from d4cad.exporters.source.drawing import CENTER, Drawing, Key
from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.places import BULGE
from d4cad.exporters.source.words import contours, listed
from d4cad.relations import Dimension

NAMES = re.compile(r"width|height|((corner|end|arc)_radius|length|distance)(_\d{1,4})?", re.ASCII)
"""Names that regularisation gives: any other might hide one that the source uses."""
LONGEST = 60
"""Characters of a formula beyond which nobody would have written it."""
FIXED = {"right": 1, "top": 1, "left": 2, "bottom": 2}
"""Coordinates that stay parameters if another can follow from them, the greater the sooner."""


def impose(drawing: Drawing, dimension: Dimension, *, centers: bool) -> None:
    """Makes a round size a parameter, and one of the coordinates that it fixes a formula; if one can be.

    ``centers``: sizes between centres, which have their names last, or all others.
    """
    name = dimension.name
    if name in drawing.values or not NAMES.fullmatch(name):
        return
    target = Linear.of(name, 2.0 if dimension.kind == "radius" else 1.0)
    formulas, places = dict(drawing.formulas), dict[Key, Linear]()
    spans = _spans(drawing, dimension, centers=centers)
    for a, b in spans:
        if abs(drawing.at(b) - drawing.at(a) - target.value({name: dimension.value})) > drawing.slack:
            return
        start, end = (places.get(key) or drawing.expression(key) for key in (a, b))
        if not (start.terms or end.terms):
            return
        if not start.terms:
            places[a] = end - target
        elif not end.terms:
            places[b] = start + target
        elif not _solved(drawing, end - start - target, formulas):
            return
    if spans:
        drawing.values[name] = round(dimension.value, drawing.decimals)
        drawing.notes[name] = _extent(drawing, dimension)
        drawing.formulas, drawing.places = formulas, drawing.places | places


def _spans(drawing: Drawing, dimension: Dimension, *, centers: bool) -> list[tuple[Key, Key]]:
    """The coordinates, the lesser first, whose difference a dimension is (for a radius: twice that)."""
    refs = [ref for ref in dimension.refs if ref[0] in drawing.names]
    found: list[tuple[Key, Key] | None] = []
    match dimension.kind:
        case "width" | "height" if dimension.round and not centers:
            ends = ("left", "right") if dimension.kind == "width" else ("bottom", "top")
            keys = [next((key for key, at in drawing.places.items() if at == Linear.of(end)), None) for end in ends]
            found = [(keys[0], keys[1]) if keys[0] and keys[1] else None]
        case "length" if dimension.round and not centers:
            found = [_along(drawing, *ref) for ref in refs if drawing.has_edges(ref[0])]
        case "radius" if not centers:
            found = [_across(drawing, *ref) for ref in refs if drawing.has_edges(ref[0])]
        case "distance" if dimension.round and len(refs) == 2:
            found = [_between(drawing, *refs, centers=centers)]
    spans = [span if drawing.at(span[0]) < drawing.at(span[1]) else span[::-1] for span in found if span is not None]
    return spans if len(spans) == len(found) else []


def _extent(drawing: Drawing, dimension: Dimension) -> str:
    """Of what a length or distance is, in words; "" if its name tells."""
    refs = [ref for ref in dimension.refs if ref[0] in drawing.names]
    lines = [str(drawing.places[axis, *ref]) for ref in refs for axis in (0, 1) if (axis, *ref) in drawing.level]
    match dimension.kind:
        case "length":
            return f"of the side{'s' if len(lines) > 1 else ''} at {listed(lines)}"
        case "distance" if lines:
            return f"from {' to '.join(lines)}"
        case "distance":
            return f"of {contours([drawing.names[loop] for loop, _ in refs])}"
    return ""


def _along(drawing: Drawing, loop: int, k: int) -> tuple[Key, Key] | None:
    """The ends of a level or upright line, along it."""
    axis = next((axis for axis in (0, 1) if (1 - axis, loop, k) in drawing.level), None)
    return None if axis is None else ((axis, loop, k), (axis, loop, drawing.after(loop, k)))


def _across(drawing: Drawing, loop: int, k: int) -> tuple[Key, Key] | None:
    """The ends of a semicircle between two named lines, across them."""
    ends = [((axis, loop, k), (axis, loop, drawing.after(loop, k))) for axis in (0, 1)]
    for other, span in (ends, ends[::-1]):
        if abs(abs(drawing.loops[loop].bulges[k]) - 1) <= BULGE and drawing.equal(*other):
            return span if all(key in drawing.places for key in (*span, *other)) else None
    return None


def _between(drawing: Drawing, a: tuple[int, int], b: tuple[int, int], *, centers: bool) -> tuple[Key, Key] | None:
    """Two parallel lines, or two centres that are level with each other, along their distance."""
    for axis in (0, 1):
        if centers and a[0] in drawing.circles and b[0] in drawing.circles:
            keys, others = ([(each, ref[0], CENTER) for ref in (a, b)] for each in (axis, 1 - axis))
            if drawing.expression(others[0]) == drawing.expression(others[1]):
                return keys[0], keys[1]
        elif not centers and (axis, *a) in drawing.level and (axis, *b) in drawing.level:
            return (axis, *a), (axis, *b)
    return None


def _solved(drawing: Drawing, zero: Linear, formulas: dict[str, Linear]) -> bool:
    """Whether ``zero`` could be made 0 by a formula for one of its coordinates, which ``formulas`` then has."""
    rest = zero.substituted(formulas)
    names = [name for name, factor in rest.terms if name in drawing.coordinates and abs(abs(factor) - 1) < 1e-9]
    if not names:
        return False
    chosen = max(names, key=lambda name: (-FIXED.get(name, 0), drawing.values[name], name))
    factor = rest.factor(chosen)
    formula = (Linear.of(chosen, factor) - rest).times(1 / factor)
    formula = Linear(
        formula.constant, tuple(sorted(formula.terms, key=lambda term: term[0] not in drawing.coordinates))
    )
    for name, known in formulas.items():
        formulas[name] = known.substituted({chosen: formula})
    formulas[chosen] = formula
    return all(len(each.text(drawing.decimals)) <= LONGEST for each in formulas.values())
