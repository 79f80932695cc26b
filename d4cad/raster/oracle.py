"""The raster's definition in dense torch: every pixel against every edge, differentiated by autograd.

It is what the scanline kernel is tested against, so it shares no formula with it. Points are complex numbers, y up,
in pixels: the pixel (row, col) has its centre at (col + 0.5) + i (row + 0.5). An edge runs from z0 to z1 with bulge
b = tan(sweep / 4) and is the Moebius curve

    z(t) = (z0 (1 - t) + w z1 t) / ((1 - t) + w t),    w = (1 - ib)^2 / (1 + b^2) = exp(-i sweep / 2),    t in [0, 1]

for lines (b = 0) and arcs alike. Three facts follow, none of which divides by the bulge:

- Winding. Numerator and denominator of z(t) - q are straight segments, so that the angle through which the edge is
  seen from q is arg(w (z1 - q) / (z0 - q)) + sweep / 2, without cases.
- Distance. By the inscribed angle theorem q lies on the edge's circle where F = Im((z1 - q) conj(q - z0) w) is 0;
  dF/dz has the length |z1 - z0| + 2 d sin(sweep / 2) at the signed distance d (positive right of travel), and
  d = 2 F / (|z1 - z0| + that length).
- Feet. A point f of the circle is z(t) for t / (1 - t) = (f - z0) / (w (z1 - f)): on the edge where that is >= 0.
"""

from __future__ import annotations

import torch
from torch import Tensor

ON_EDGE = 1e-9
"""A pixel centre nearer to its edge than this (px) lies on it."""


def coverage(x: Tensor, y: Tensor, b: Tensor, nxt: Tensor, r0: int, r1: int, c0: int, c1: int, ramp: float) -> Tensor:
    """Coverage (r1 - r0, c1 - c0) of loops at the pixels of rows [r0, r1) and columns [c0, c1).

    x, y, b: (n,) float64, vertices in pixels and bulges. nxt: (n,) int64, the vertex at which the edge from vertex i
    ends. ramp: half-width of the ramp in pixels. Coverage is clip(1/2 - d / (2 ramp), 0, 1) for the distance d to the
    nearest edge, negative where the winding number is not 0. Its derivative is 0 where |d| >= ramp; within ``ON_EDGE``
    of an edge it is that of an edge with its inside left of travel.
    """
    columns, rows = (torch.arange(a, z, dtype=torch.float64) + 0.5 for a, z in ((c0, c1), (r0, r1)))
    q = torch.complex(columns[None, :, None], rows[:, None, None])
    start = torch.complex(x, y)
    end = start[nxt]
    w = torch.complex(1 - b * b, -2 * b) / (1 + b * b)
    d = signed_distance(q, start, end, b, w)
    d = d.gather(2, d.detach().abs().argmin(2, keepdim=True))[:, :, 0]
    inside = winding(q, start, end, b, w) != 0
    outward = torch.where(d.abs() < ON_EDGE, 1.0, torch.where(inside, -1.0, 1.0) * d.detach().sign())
    return torch.where(d.abs() < ramp, 0.5 - outward * d / (2 * ramp), inside.double())


def signed_distance(q: Tensor, z0: Tensor, z1: Tensor, b: Tensor, w: Tensor) -> Tensor:
    """Distance of points q (..., 1) to edges (n,): positive right of travel, and where a vertex is nearest."""
    chord = (z1 - z0).abs()
    to_circle = ((z1 - q) * (q - z0).conj() * w).imag
    sin, cos = -w.imag, w.real
    normal = 2 * sin * (q - (z0 + z1) / 2) - 1j * (z1 - z0) * cos  # dF/dz
    steepness = normal.abs()
    nonzero = torch.where(chord + steepness > 0, chord + steepness, 1.0)
    d = 2 * to_circle / nonzero
    with torch.no_grad():
        foot = q - d * normal / torch.where(steepness > 0, steepness, 1.0)
        on_edge = ((foot - z0) * (w * (z1 - foot)).conj()).real >= 0
    return torch.where(on_edge, d, torch.minimum((q - z0).abs(), (q - z1).abs()))


@torch.no_grad()
def winding(q: Tensor, z0: Tensor, z1: Tensor, b: Tensor, w: Tensor) -> Tensor:
    """Winding number of closed loops of edges (n,) around points q (..., 1); any integer for a point on an edge."""
    seen = (w * (z1 - q) * (z0 - q).conj()).angle() + 2 * b.atan()
    return (seen.sum(-1) / (2 * torch.pi)).round()
