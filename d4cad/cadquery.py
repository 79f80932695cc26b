"""CadQuery plugin: importing it gives `cadquery.Workplane` the methods `d4sketch` and `fitImage`.

>>> import cadquery as cq  # doctest: +SKIP
>>> import d4cad.cadquery  # doctest: +SKIP
>>> plate = cq.Workplane().rect(200, 100).extrude(6)  # doctest: +SKIP
>>> plate.faces(">Z").workplane().fitImage("logo.png", width=40).cutBlind(-1)  # doctest: +SKIP
"""

from __future__ import annotations

from os import PathLike
from typing import Any

from numpy.typing import NDArray

from d4cad.exporters.cadquery import attach, to_cadquery
from d4cad.exporters.parts import Part
from d4cad.fitting import fit_image

Workplane = Any
"""cadquery.Workplane, which only the exporters import."""


def d4sketch(self: Workplane, *parts: Part) -> Workplane:
    """Place sketches (mm), fits or program files at each point of the stack, for `extrude` or `cutBlind` to use.

    Raises as :func:`d4cad.exporters.cadquery.to_cadquery`.
    """
    return self.placeSketch(*(to_cadquery(part) for part in parts))


def fitImage(
    self: Workplane,
    image: str | PathLike[str] | NDArray[Any],
    width: float | None = None,
    *,
    scale: float | None = None,
    dpi: float | None = None,
    centered: bool = True,
    **options: Any,
) -> Workplane:
    """Fit a part to a picture and place its outline at each point of the stack, for `extrude` or `cutBlind` to use.

    Size as for :meth:`d4cad.Fit.sketch`: the part's width in mm, mm per pixel, or pixels per inch. centered: the
    middle of the part's bounding box lies at the point, else its lower left corner. options: those of
    :func:`d4cad.fit_image`, as ``invert`` or ``threshold``. Raises InputError for what cannot be used.
    """
    fit = fit_image(image, **options)
    return self.placeSketch(to_cadquery(fit.sketch(width, scale, dpi, "center" if centered else "corner")))


attach(d4sketch, fitImage)
