"""Points whose coordinates are linear in parameters."""

from __future__ import annotations

from math import copysign, pi, tan

from d4cad.exporters.source.linear import Linear

QUARTER = tan(pi / 8)
"""Bulge of a quarter of a circle; of a half it is 1."""
BULGE = 1e-9
"""Difference within which a bulge is one of these."""

Place = tuple[Linear, Linear]


def exact(bulge: float) -> float:
    """The bulge without its rounding if it is that of a quarter or half of a circle."""
    return next((copysign(known, bulge) for known in (QUARTER, 1.0) if abs(abs(bulge) - known) <= BULGE), bulge)


def middle(start: Place, end: Place, bulge: float) -> Place:
    """The point halfway along an arc that keeps its sweep."""
    (x0, y0), (x1, y1) = start, end
    return (
        (x0 + x1).times(0.5) + (y1 - y0).times(bulge / 2),
        (y0 + y1).times(0.5) + (x0 - x1).times(bulge / 2),
    )


def center(start: Place, end: Place, bulge: float) -> Place:
    """The centre of an arc that keeps its sweep, as ezdxf.math.bulge_center has it."""
    (x0, y0), (x1, y1) = start, end
    lift = (1 - bulge * bulge) / (4 * bulge)
    return (x0 + x1).times(0.5) + (y0 - y1).times(lift), (y0 + y1).times(0.5) + (x1 - x0).times(lift)
