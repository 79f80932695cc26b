"""A picture inside a CadQuery workflow: a tag with an eye for the ring and the picture cut into its top.

python examples/keychain_cadquery.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import cadquery as cq

import d4cad.cadquery  # noqa: F401  (gives Workplane its methods fitImage and d4sketch)

PICTURE = Path(__file__).parent / "pictures" / "letter.png"
DEPTH = 0.8


def main(out: Path = Path("out")) -> dict[str, float]:
    """Writes keychain.step; its volume in mm3, and that of the engraving."""
    out.mkdir(parents=True, exist_ok=True)
    tag = cq.Workplane().slot2D(46, 24).extrude(3).edges("|Z or >Z").fillet(0.8)
    tag = tag.faces(">Z").workplane(origin=(-16, 0, 3)).hole(5)
    engraved = tag.faces(">Z").workplane(origin=(4, 0, 3)).fitImage(PICTURE, width=14).cutBlind(-DEPTH)
    cq.exporters.export(engraved, str(out / "keychain.step"))
    return {"volume": engraved.val().Volume(), "engraving": tag.val().Volume() - engraved.val().Volume()}


if __name__ == "__main__":
    print(main(*map(Path, sys.argv[1:])))
