"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Output = Annotated[
    list[Path] | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="File to write: .step .stp .stl .brep .svg .json .png; repeatable.",
        show_default=False,
    ),
]
Width = Annotated[float | None, typer.Option(metavar="MM", help="Width of the part in mm.", show_default=False)]
Scale = Annotated[float | None, typer.Option(metavar="MM_PER_PX", help="Millimetres per pixel.", show_default=False)]
Dpi = Annotated[
    float | None,
    typer.Option(metavar="N", help="Pixels per inch; by default what the picture states, else 96.", show_default=False),
]
Thickness = Annotated[float | None, typer.Option(metavar="MM", help="Thickness of solids in mm.", show_default="3")]
Origin = Annotated[
    str | None,
    typer.Option(
        metavar="WHERE", help="corner or center of the part at (0, 0), or as in the drawing.", show_default="corner"
    ),
]
Grammar = Annotated[str, typer.Option(metavar="NAME", help="Language of shapes: arc-line.")]
Method = Annotated[str, typer.Option(metavar="NAME", help="fast, or paper for the published settings.")]
Seed = Annotated[int, typer.Option(metavar="N", help="Seed of all randomness.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else.")]
