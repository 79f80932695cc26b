"""The Union-Rect grammar."""

from pathlib import Path

from d4cad.grammars import arc_line
from d4cad.raster import HERE, drop_stale_kernels

drop_stale_kernels(Path(__file__).parent, HERE, Path(arc_line.__file__).parent)

from d4cad.grammars.union_rect.facts import FACTS as FACTS  # noqa: E402  # kernels load as they are imported
from d4cad.grammars.union_rect.grammar import UnionRect as UnionRect  # noqa: E402
from d4cad.grammars.union_rect.structure import Structure as Structure  # noqa: E402
from d4cad.grammars.union_rect.structure import angle_metric as angle_metric  # noqa: E402
