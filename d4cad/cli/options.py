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
        help="File to write: .step .stp .brep .stl .3mf .glb .py .scad .dxf .svg .json .png; repeatable.",
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
Name = Annotated[
    str | None, typer.Option(metavar="NAME", help="Name of the part in the file.", show_default="the file's name")
]
Color = Annotated[
    str | None, typer.Option(metavar="COLOR", help="#rrggbb or a CSS name; .step .3mf .glb .svg.", show_default=False)
]
Schema = Annotated[str | None, typer.Option(metavar="NAME", help="STEP schema, AP214 or AP242.", show_default="AP214")]
Tolerance = Annotated[
    float | None,
    typer.Option(metavar="MM", help="Facets from the exact arcs, in mm; .stl .3mf .glb .scad.", show_default="0.01"),
]
Kerf = Annotated[
    float | None,
    typer.Option(metavar="MM", help="Width in mm that the cutter takes away; .dxf .svg.", show_default=False),
]
Style = Annotated[
    str | None, typer.Option(metavar="NAME", help="fill, or cut for hairlines; .svg.", show_default="fill")
]
Dialect = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="Language of .py: build123d, build123d-algebra or cadquery.", show_default="build123d"
    ),
]
Grammar = Annotated[
    str,
    typer.Option(
        metavar="NAME", help="Language of shapes: arc-line, union-rect, tree, or another's: docs/grammar-authoring.md."
    ),
]
ScriptGrammar = Annotated[
    str | None,
    typer.Option(
        "--grammar",
        metavar="FILE.py:OBJECT",
        help="The script's grammar that the program is in, which runs then.",
        show_default=False,
    ),
]
Branches = Annotated[
    str | None,
    typer.Option(
        metavar="LENGTH",
        help="Join a tree's leaves by branches of this width into one part: 2mm, 3px.",
        show_default=False,
    ),
]
Separate = Annotated[
    bool,
    typer.Option(
        "--separate", help="Every rectangle of union-rect as a body or loop by itself; .step .brep .dxf .svg."
    ),
]
Variant = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Some of its rewrites only; `d4cad grammars` lists them.", show_default="all"),
]
Method = Annotated[str, typer.Option(metavar="NAME", help="fast, or paper for the published settings.")]
Seed = Annotated[int, typer.Option(metavar="N", help="Seed of all randomness.")]
Snap = Annotated[
    bool | None,
    typer.Option(
        "--snap/--no-snap",
        help="Make relations exact that the picture makes likely: horizontal, tangent, equal, round ...",
        show_default="snap, but with --method paper",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else.")]
