"""The raster as a torch function, for losses written in torch.

>>> import torch
>>> from d4cad.canvas import Canvas
>>> from d4cad.grammars.arc_line import ArcLine
>>> canvas = Canvas.square(64)
>>> diamond = ArcLine().axiom(canvas)
>>> params = torch.tensor(diamond.params, requires_grad=True)
>>> optimizer = torch.optim.Adam([params], lr=0.05)
>>> for _ in range(200):
...     optimizer.zero_grad()
...     area = soft_raster(params, diamond, canvas).sum() * canvas.pixel**2
...     loss = (area - 1) ** 2
...     loss.backward()
...     _ = optimizer.step()
>>> round(area.item(), 3)
1.0
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.grammars.arc_line import ArcLine
from d4cad.program import Program
from d4cad.protocols import Grammar

try:
    import torch
    from torch import Tensor
    from torch.autograd.function import once_differentiable
except ImportError as error:
    raise ImportError("d4cad.torch needs torch: pip install d4cad[torch]") from error

FLOATS = (torch.float32, torch.float64)


def soft_raster(params: Tensor, program: Any, canvas: Canvas, grammar: Grammar[Any] | None = None) -> Tensor:
    """Coverage (height, width) in [0, 1] of a program on ``canvas``, row 0 lowest, differentiable by ``params``.

    params: (n,) float32 or float64 in the grammar's layout and units (Arc-Line: x, y of every vertex in world units,
    then the bulge of every arc). program: a Program, of which only the structure counts, or a structure. grammar: what
    draws it, by default Arc-Line. The result has the dtype and device of ``params``; the work is done in float64 on the
    CPU. First derivatives only. Raises InputError for other shapes or dtypes.
    """
    structure = program.structure if isinstance(program, Program) else program
    size = program.params.size if isinstance(program, Program) else params.numel()
    if params.shape != (size,) or params.dtype not in FLOATS:
        found = f"{tuple(params.shape)} and {params.dtype}"
        raise InputError(f"expected params of shape ({size},) and dtype float32 or float64, got {found}")
    draw: Callable[..., Tensor] = _SoftRaster.apply
    return draw(params, structure, canvas, ArcLine() if grammar is None else grammar)


class _SoftRaster(torch.autograd.Function):
    """Forward: the grammar's kernel. Backward: the pull-back of its band."""

    @staticmethod
    def forward(ctx: Any, params: Tensor, structure: Any, canvas: Canvas, grammar: Grammar[Any]) -> Tensor:
        values = params.detach().to("cpu", torch.float64).numpy()
        ctx.band = grammar.rasterize(Program(structure, values), canvas)
        return torch.from_numpy(ctx.band.coverage).to(params)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        dense = gradient.to("cpu", torch.float64).contiguous().numpy()
        pulled = torch.from_numpy(np.asarray(ctx.band.pull_back(dense)))
        return pulled.to(gradient), None, None, None
