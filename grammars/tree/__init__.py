"""The Tree grammar."""

from pathlib import Path

from d4cad.raster import HERE, drop_stale_kernels

drop_stale_kernels(Path(__file__).parent, HERE)

from d4cad.grammars.tree.facts import FACTS as FACTS  # noqa: E402  # kernels load as they are imported
from d4cad.grammars.tree.grammar import Tree as Tree  # noqa: E402
from d4cad.grammars.tree.structure import Limits as Limits  # noqa: E402
from d4cad.grammars.tree.structure import Structure as Structure  # noqa: E402
from d4cad.grammars.tree.structure import bounds as bounds  # noqa: E402
from d4cad.grammars.tree.structure import subtree_metric as subtree_metric  # noqa: E402
