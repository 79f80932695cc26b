"""The Arc-Line grammar."""

from pathlib import Path

from d4cad.raster import HERE, drop_stale_kernels

drop_stale_kernels(Path(__file__).parent, HERE)

from d4cad.grammars.arc_line.facts import FACTS as FACTS  # noqa: E402  # kernels load as they are imported
from d4cad.grammars.arc_line.grammar import ArcLine as ArcLine  # noqa: E402
from d4cad.grammars.arc_line.structure import Structure as Structure  # noqa: E402
from d4cad.grammars.arc_line.structure import sagitta_metric as sagitta_metric  # noqa: E402
