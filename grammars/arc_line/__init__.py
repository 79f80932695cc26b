"""The Arc-Line grammar."""

from d4cad.grammars.arc_line.grammar import ArcLine as ArcLine
from d4cad.grammars.arc_line.structure import Structure as Structure
from d4cad.grammars.arc_line.structure import sagitta_metric as sagitta_metric
