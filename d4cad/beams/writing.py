"""Problems as TOML, as `d4cad.beams.reading` reads them."""

from __future__ import annotations

import json
from collections.abc import Iterable

from d4cad.beams.problem import Place, Problem
from d4cad.errors import InputError


def toml_of(problem: Problem) -> str:
    """A TOML text that reads back as the same problem. Raises InputError for a place that TOML has no words for."""
    material = problem.material
    lines = [
        f"name = {_text(problem.name)}",
        f"volume = {_number(problem.volume)}",
        f"thickness = {_number(problem.thickness)}",
        "",
        "[domain]",
        f"size = {_numbers(problem.size)}",
        f"element = {_number(problem.element)}",
        "",
        "[material]",
        f"young = {_number(material.young)}",
        f"poisson = {_number(material.poisson)}",
    ]
    if material.strength is not None:
        lines.append(f"yield = {_number(material.strength)}")
    for support in problem.supports:
        lines += ["", "[[support]]", *_place(support.place), f'fix = "{support.fix}"']
    for load in problem.loads:
        lines += ["", "[[load]]", *_place(load.place), f"force = {_numbers(load.force)}"]
        if load.case:
            lines.append(f"case = {_text(load.case)}")
    for kind, places in (("cut", problem.cuts), ("void", problem.voids), ("solid", problem.solids)):
        for place in places:
            lines += ["", f"[[{kind}]]", *_place(place)]
    return "\n".join(lines) + "\n"


def _place(place: Place) -> list[str]:
    if place.box:
        return [f"box = {_numbers((*place.start, *place.end))}"]
    if place.start == place.end:
        if place.radius == 0:
            return [f"at = {_numbers(place.start)}"]
        return [f"circle = {_numbers((*place.start, place.radius))}"]
    if place.radius:
        raise InputError(f"{place} with a radius of {place.radius:g} mm cannot be written")
    return [f"from = {_numbers(place.start)}", f"to = {_numbers(place.end)}"]


def _text(text: str) -> str:
    """A basic string: escaped as in JSON, but no character as a pair of surrogates, and DEL too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _numbers(values: Iterable[float]) -> str:
    return f"[{', '.join(_number(value) for value in values)}]"


def _number(value: float) -> str:
    return repr(float(value))
