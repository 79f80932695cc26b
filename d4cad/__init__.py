"""d4cad: a picture of a part becomes an exact CAD part of lines and arcs.

>>> import d4cad
>>> fit = d4cad.fit_image("bracket.png")            # doctest: +SKIP
>>> fit.save("bracket.step", width=80, thickness=6)  # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from d4cad.canvas import Canvas as Canvas
    from d4cad.errors import D4cadError as D4cadError
    from d4cad.fit import Fit as Fit
    from d4cad.fitting import fit_coverage as fit_coverage
    from d4cad.fitting import fit_image as fit_image
    from d4cad.programs import load_program as load_program
    from d4cad.sketch import Sketch as Sketch
    from d4cad.text import fit_text as fit_text

__version__ = "0.1.0"

_HOMES = {
    "Canvas": "canvas",
    "D4cadError": "errors",
    "Fit": "fit",
    "Sketch": "sketch",
    "fit_coverage": "fitting",
    "fit_image": "fitting",
    "fit_text": "text",
    "load_program": "programs",
}


def __getattr__(name: str) -> object:
    """The public names, each imported at its first use: `import d4cad` alone must stay fast."""
    if name not in _HOMES:
        raise AttributeError(f"module 'd4cad' has no attribute {name!r}")
    return getattr(import_module(f"d4cad.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
