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
    "split-three": RuleFacts("an arc becomes three lines through the thirds of its sweep", "an arc"),
    "pinch": RuleFacts("a slit or a thin wall closes", "two edges near to each other that run back to back"),
    "round": RuleFacts("a tangent arc comes between two edges", "a corner"),
    "chamfer": RuleFacts("a line comes between two edges", "a corner"),
    "circle": RuleFacts("a loop becomes a circle of two arcs", "a loop that is nearly one"),
    "smooth": RuleFacts("a vertex becomes a smooth joint", "a small kink", inverse="sharpen"),
    "sharpen": RuleFacts("a smooth joint may kink again", "a smooth joint", inverse="smooth", exact=True),
    "fillet": RuleFacts("both ends of an arc become smooth", "small kinks there"),
    "straighten": RuleFacts(
        "an arc becomes a line, smooth where it meets arcs", "a nearly straight arc", inverse="bend"
    ),
    "bend": RuleFacts("a line becomes an arc with smooth ends", "a line between edges that it can be tangent to"),
    "bridge": RuleFacts("a line with smooth ends comes between two edges", "a kink beside an arc"),
}
