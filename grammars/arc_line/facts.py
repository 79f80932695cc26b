"""Facts of the Arc-Line grammar's rewrites; tests/test_rewrites.py holds them."""

from d4cad.protocols import RuleFacts

FACTS = {
    "split": RuleFacts("an edge in two of its kind, at its middle", inverse="merge-line, merge-arc", exact=True),
    "to-arc": RuleFacts("a line becomes an arc of bulge 0", "a line", inverse="to-line", exact=True),
    "to-line": RuleFacts("an arc becomes its chord", "a small sagitta"),
    "merge-line": RuleFacts("two edges become a line", "the outline moves little"),
    "merge-arc": RuleFacts("two edges become an arc", "the outline moves little"),
    "close": RuleFacts("an edge shrinks to a point", "a short edge"),
    "add-loop": RuleFacts("a new circle of four arcs, or a circular hole", inverse="remove-loop"),
    "remove-loop": RuleFacts("a loop goes", "more than one loop", inverse="add-loop"),
    "split-lines": RuleFacts("an arc becomes two lines through its apex", "an arc"),
    "pinch": RuleFacts("a slit or a thin wall closes", "two edges near to each other that run back to back"),
}
