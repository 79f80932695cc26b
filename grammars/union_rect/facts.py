"""Facts of the Union-Rect grammar's rewrites; tests/test_union_rect_rules.py holds them."""

from d4cad.protocols import RuleFacts

FACTS = {
    "split-h": RuleFacts("a rectangle in two, cut across its own x", inverse="merge", exact=True),
    "split-v": RuleFacts("a rectangle in two, cut across its own y", inverse="merge", exact=True),
    "add-rect": RuleFacts("a new rectangle", inverse="remove"),
    "add-hole": RuleFacts("a box emptied: at most four pieces of every rectangle that it reaches", inverse="add-rect"),
    "merge": RuleFacts(
        "two rectangles become the smallest box around both",
        "their circumscribed circles are near each other; the size of the box, if limited",
    ),
    "remove": RuleFacts("a rectangle goes", "more than one rectangle; its size, if limited", inverse="add-rect"),
}
