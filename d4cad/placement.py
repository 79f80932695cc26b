"""From world units to a part's millimetres: how large it is and where its origin lies."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import isfinite
from typing import Any

from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.sketch import Sketch

INCH = 25.4
ORIGINS = ("corner", "center", "drawing")
DEFAULT_DPI = 96.0
"""Pixels per inch of a picture that states none: CSS and SVG count the same way."""
DEFAULT_THICKNESS = 3.0
"""Thickness in mm of a solid for which none was given."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Size, origin and thickness of a part, as a user gives them.

    At most one of width: the part's extent in x, in mm; scale: mm per pixel; dpi: pixels per inch. origin: "corner"
    puts the lower left corner of the part's bounding box at (0, 0), "center" its middle, "drawing" leaves the part
    where it was drawn. thickness: mm. zero: the point, in world units, that "drawing" puts at (0, 0); None if nothing
    was drawn. Raises InputError where a number is not positive and finite, or more than one size is given.
    """

    width: float | None = None
    scale: float | None = None
    dpi: float | None = None
    origin: str = "corner"
    thickness: float | None = None
    zero: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name, value, unit in (
            ("width", self.width, " in mm"),
            ("scale", self.scale, " in mm per pixel"),
            ("dpi", self.dpi, ""),
            ("thickness", self.thickness, " in mm"),
        ):
            if value is not None and not (isfinite(value) and value > 0):
                raise InputError(f"the {name} must be a positive number{unit}, got {value:g}")
        given = [name for name in ("width", "scale", "dpi") if getattr(self, name) is not None]
        if len(given) > 1:
            raise InputError(f"expected one of width, scale and dpi, got {' and '.join(given)}")
        if self.origin not in ORIGINS:
            raise InputError(f"the origin must be {', '.join(ORIGINS[:-1])} or {ORIGINS[-1]}, got {self.origin!r}")
        if self.zero is not None and not all(isfinite(x) for x in self.zero):
            raise InputError(f"the origin of a drawing must be finite, got {self.zero}")

    @property
    def sized(self) -> bool:
        """Whether a size is given."""
        return not (self.width is None and self.scale is None and self.dpi is None)

    def place(self, outline: Sketch, canvas: Canvas, piece: Sketch | None = None) -> Sketch:
        """A sketch in world units of ``canvas`` as a part in mm; at 96 dpi if no size is given.

        piece: what to place in its stead, where it lies in the part.
        """
        xmin, ymin, xmax, ymax = outline.bounds
        factor = self.factor(outline, canvas)
        if self.origin == "drawing":
            if self.zero is None:
                raise InputError("only a part that was drawn has a drawing's origin: expected corner or center")
            x, y = self.zero
        else:
            x, y = (xmin, ymin) if self.origin == "corner" else ((xmin + xmax) / 2, (ymin + ymax) / 2)
        # Moved first: in the part's own corner the coordinates keep their digits, and the corner is exactly 0.
        return (outline if piece is None else piece).translated(-x, -y).scaled(factor, "mm")

    def factor(self, outline: Sketch, canvas: Canvas) -> float:
        """mm per world unit of ``outline`` on ``canvas``."""
        xmin, _, xmax, _ = outline.bounds
        return self.pixel_size / canvas.pixel if self.width is None else self.width / (xmax - xmin)

    @property
    def pixel_size(self) -> float:
        """mm per pixel by scale or dpi; a width says nothing about it."""
        return self.scale if self.scale is not None else INCH / (self.dpi or DEFAULT_DPI)


def stated(value: object) -> Placement:
    """The placement that a program file's settings hold as a JSON object. Raises InputError where it is none."""
    known = {f.name for f in fields(Placement)}
    if not isinstance(value, dict) or not set(value) <= known:
        raise InputError(f"its placement is not an object with some of {', '.join(sorted(known))}")
    for key, x in value.items():
        if key == "zero":
            if not (isinstance(x, list) and len(x) == 2 and all(_is_number(part) for part in x)):
                raise InputError(f"its placement has a wrong zero: {x!r}")
        elif not (isinstance(x, str) if key == "origin" else _is_number(x)):
            raise InputError(f"its placement has a wrong {key}: {x!r}")
    given: dict[str, Any] = {key: tuple(x) if key == "zero" else x for key, x in value.items()}
    return Placement(**given)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
