"""Named parameters of the features of a part. Features of one size share theirs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees

from d4cad.exporters.source.words import ranges
from d4cad.features import Circle, Feature, Rectangle, RegularPolygon, RoundedRectangle, Slot
from d4cad.loop import Point

EQUAL = 1e-6
"""Relative difference of sizes that share one parameter."""

ANGLE_DECIMALS = 9


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number, or a point, that a user may change, or a formula. ``note``: the comment beside it, perhaps empty."""

    name: str
    value: float | Point | str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Named:
    """A feature whose contour is called ``name``: a role, "outer" or "hole", and a number from 1."""

    name: str
    feature: Feature

    @property
    def role(self) -> str:
        """The name without its number."""
        return self.name.rpartition("_")[0]

    @property
    def number(self) -> int:
        """The number in its name."""
        return int(self.name.rpartition("_")[2])


Names = dict[str, str]
"""The parameter that holds each size of a feature: {"diameter": "hole_diameter", "center": "hole_1_center"}.

In place of "center" there may be "x" and "y", with formulas.
"""


def named(
    features: Sequence[Named], decimals: int, places: Mapping[str, tuple[str, str]]
) -> tuple[list[Parameter], dict[str, Names]]:
    """The parameters of features, lengths rounded to ``decimals``, and for each contour their names.

    Features of one role, kind and size are a family: it shares its sizes, which are called after its first member, or
    "hole_diameter" where it is the only family of several holes. Their common value is the mean, so that a part
    whose sizes differ by no more than EQUAL keeps its volume to the square of that. ``places``: formulas for x and y of
    centres, by contour; only the others are parameters.
    """
    families = _families(features)
    parameters: list[Parameter] = []
    names: dict[str, Names] = {}
    for family in families:
        first, each = family[0], [sizes(member.feature) for member in family]
        prefix = first.role if _is_only_ring(family, families) else first.name
        note = "" if len(family) == 1 else f"of {first.role}s {ranges([member.number for member in family])}"
        shared = {key: f"{prefix}_{key}" for key in each[0]}
        for key, name in shared.items():
            mean = sum(one[key] for one in each) / len(each)
            parameters.append(Parameter(name, round(mean, decimals) + 0.0, note))
        for member in family:
            own: Names = {}
            for key, value, note in _placement(member.feature, decimals):
                if key == "center" and member.name in places:
                    own |= zip("xy", places[member.name], strict=True)
                else:
                    own[key] = f"{member.name}_{key}"
                    parameters.append(Parameter(own[key], value, note))
            names[member.name] = shared | own
    return parameters, names


def sizes(found: Feature) -> dict[str, float]:
    """The lengths that make a feature, by name."""
    match found:
        case Circle(_, radius):
            return {"diameter": 2 * radius}
        case Rectangle(_, width, height):
            return {"width": width, "height": height}
        case RoundedRectangle(_, width, height, radius):
            return {"width": width, "height": height, "radius": radius}
        case Slot(_, length, width):
            return {"length": length, "width": width}
        case RegularPolygon(_, radius, _):
            return {"radius": radius}


def _placement(found: Feature, decimals: int) -> Iterator[tuple[str, float | Point, str]]:
    """Centre and, unless it is nothing, angle in degrees: key, value, note."""
    x, y = found.center
    yield "center", (round(x, decimals) + 0.0, round(y, decimals) + 0.0), ""
    angle = 0.0 if isinstance(found, Circle) else round(degrees(found.angle), ANGLE_DECIMALS)
    if angle != 0:
        yield "angle", angle, "degrees"


def _families(features: Sequence[Named]) -> list[list[Named]]:
    """In the order of their first members."""
    families: list[list[Named]] = []
    for one in features:
        family = next((family for family in families if _are_alike(family[0], one)), None)
        if family is None:
            families.append([one])
        else:
            family.append(one)
    return families


def _are_alike(a: Named, b: Named) -> bool:
    if a.role != b.role or type(a.feature) is not type(b.feature):
        return False
    if getattr(a.feature, "sides", 0) != getattr(b.feature, "sides", 0):
        return False
    mine, others = sizes(a.feature), sizes(b.feature)
    return all(abs(mine[key] - others[key]) <= EQUAL * mine[key] for key in mine)


def _is_only_ring(family: Sequence[Named], families: Sequence[Sequence[Named]]) -> bool:
    """Whether it is the one family of several circles in its role."""
    rings = [f for f in families if len(f) > 1 and isinstance(f[0].feature, Circle) and f[0].role == family[0].role]
    return len(rings) == 1 and rings[0] is family
