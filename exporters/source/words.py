"""Numbers, names and sizes as people read them, in source code and its comments."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10

from d4cad.features import Circle, Feature, Rectangle, RegularPolygon, RoundedRectangle, Slot
from d4cad.loop import Point

LONGEST_NAME = 80
"""Characters of a name given by the user that are kept."""


def number(value: float, decimals: int) -> str:
    """The shortest decimal that is ``value`` to ``decimals`` places: "12", "0.25", never "-0".

    >>> number(12.0, 9), number(-1e-12, 9), number(0.1 + 0.2, 9)
    ('12', '0', '0.3')
    """
    return repr(round(value, decimals) + 0.0).removesuffix(".0")  # adding 0 turns -0 into 0


def plain(name: str) -> str:
    """A name that cannot end a comment or a string: printable, on one line, without double quotes and backslashes."""
    printable = "".join(c if c.isprintable() else " " for c in name)
    return " ".join(printable.replace('"', "'").replace("\\", "/").split())[:LONGEST_NAME].strip()


def counted(n: int, noun: str) -> str:
    """ "1 line", "3 lines"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def listed(words: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def ranges(numbers: Sequence[int]) -> str:
    """Ascending whole numbers, runs of three and more as such.

    >>> ranges([1, 2, 3, 7, 8])
    '1 to 3, 7 and 8'
    """
    runs: list[list[int]] = []
    for k in numbers:
        if runs and k == runs[-1][-1] + 1:
            runs[-1].append(k)
        else:
            runs.append([k])
    words = [[f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(k) for k in run] for run in runs]
    return listed([word for each in words for word in each])


def contours(names: Sequence[str]) -> str:
    """Names of contours in words, each role's numbers together.

    >>> contours(["outer_1", "hole_2", "hole_4"])
    'outer 1 and holes 2 and 4'
    """
    roles: dict[str, list[int]] = {}
    for name in names:
        role, _, k = name.rpartition("_")
        roles.setdefault(role, []).append(int(k))
    return listed([f"{role}{'s' if len(each) > 1 else ''} {ranges(sorted(each))}" for role, each in roles.items()])


def edges(lines: int, arcs: int, circles: int = 0) -> str:
    """ "4 lines and 2 arcs"; kinds of which there are none are not named."""
    kinds = ((lines, "line"), (arcs, "arc"), (circles, "full circle"))
    return listed([counted(n, kind) for n, kind in kinds if n])


def described(found: Feature) -> str:
    """Kind and size of a feature in mm, and where it is."""
    place = at(found.center)
    match found:
        case Circle(_, radius):
            return f"circle of diameter {short(2 * radius)} mm {place}"
        case Rectangle(_, width, height):
            return f"rectangle, {short(width)} x {short(height)} mm {place}, 4 lines"
        case RoundedRectangle(_, width, height, _):
            return f"rounded rectangle, {short(width)} x {short(height)} mm {place}, 4 lines and 4 arcs"
        case Slot(_, length, width):
            return f"slot, {short(length)} x {short(width)} mm {place}, 2 lines and 2 arcs"
        case RegularPolygon(_, radius, sides):
            return f"regular polygon of radius {short(radius)} mm {place}, {sides} lines"


def at(point: Point) -> str:
    """ "at (3, 4)"."""
    return f"at ({short(point[0], 4)}, {short(point[1], 4)})"


def short(value: float, digits: int = 5) -> str:
    """A length for people: so many significant digits, and nothing below 1e-9 mm.

    >>> short(77.855249), short(123456.7), short(-2e-16)
    ('77.855', '123457', '0')
    """
    size = abs(value)
    return number(value, max(0, digits - 1 - floor(log10(size)))) if size > 1e-9 else "0"
