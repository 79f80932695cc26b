"""From world units to a part's millimetres: how large it is and where its origin lies."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

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

    def place(self, outline: Sketch, canvas: Canvas) -> Sketch:
        """A sketch in world units of ``canvas`` as a part in mm; at 96 dpi if no size is given."""
        xmin, ymin, xmax, ymax = outline.bounds
        factor = self.pixel_size / canvas.pixel if self.width is None else self.width / (xmax - xmin)
        if self.origin == "drawing":
            if self.zero is None:
                raise InputError("only a part that was drawn has a drawing's origin: expected corner or center")
            x, y = self.zero
        else:
            x, y = (xmin, ymin) if self.origin == "corner" else ((xmin + xmax) / 2, (ymin + ymax) / 2)
        # Moved first: in the part's own corner the coordinates keep their digits, and the corner is exactly 0.
        return outline.translated(-x, -y).scaled(factor, "mm")

    @property
    def pixel_size(self) -> float:
        """mm per pixel by scale or dpi; a width says nothing about it."""
        return self.scale if self.scale is not None else INCH / (self.dpi or DEFAULT_DPI)
