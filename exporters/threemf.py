"""3MF: what slicers prefer to STL, with unit, name and colour. The package is written here: trimesh's writer
needs lxml, and gives neither a colour nor the same bytes twice."""

from __future__ import annotations

import zipfile
from io import BytesIO
from pathlib import Path
from xml.sax.saxutils import quoteattr

from d4cad.exporters.color import hexadecimal
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.mesh import CHORD_TOLERANCE, Mesh, mesh
from d4cad.exporters.names import printable
from d4cad.files import replacing
from d4cad.sketch import Sketch

TYPES = """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""

RELATIONS = """<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="rel0" Target="/3D/3dmodel.model" \
Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""


def write_3mf(
    sketch: Sketch,
    path: str | Path,
    *,
    thickness: float,
    tolerance: float = CHORD_TOLERANCE,
    name: str = "part",
    color: str | None = None,
    form: Form = PLAIN,
) -> None:
    """Writes the sketch (mm), by default extruded from z = 0, as a 3MF file in mm whose bytes are reproducible.

    ``name``: the object's. ``color``: #rrggbb or a CSS name. Raises as :func:`d4cad.exporters.mesh.mesh` does, and
    InputError for an unknown colour. https://github.com/3MFConsortium/spec_core
    """
    model = _model(mesh(sketch, thickness, tolerance, form), printable(name), color)
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w") as package:
        for member, text in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            ("3D/3dmodel.model", model),
        ):
            entry = zipfile.ZipInfo(member)  # dated 1980-01-01
            entry.create_system = 3  # Unix, wherever it is written
            package.writestr(entry, text, zipfile.ZIP_DEFLATED)
    with replacing(path) as temporary:
        temporary.write_bytes(buffer.getvalue())


def _model(body: Mesh, name: str, color: str | None) -> str:
    vertices, triangles = body
    # nine digits tell any two 32-bit floats apart, which is what readers keep
    corners = "\n".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in (vertices + 0.0).tolist())
    facets = "\n".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles.tolist())
    label = quoteattr(name)
    materials, material = "", ""
    if color is not None:
        shown = hexadecimal(color)
        materials = f'<basematerials id="2"><base name="{shown}" displaycolor="{shown}"/></basematerials>\n'
        material = ' pid="2" pindex="0"'
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<model unit="millimeter" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">\n'
        '<metadata name="Application">d4cad</metadata>\n'
        f'<resources>\n{materials}<object id="1" type="model" name={label}{material}>\n'
        f"<mesh>\n<vertices>\n{corners}\n</vertices>\n<triangles>\n{facets}\n</triangles>\n</mesh>\n</object>\n"
        '</resources>\n<build><item objectid="1"/></build>\n</model>\n'
    )
