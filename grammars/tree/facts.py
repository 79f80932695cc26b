"""Facts of the Tree grammar's rewrites; tests/test_tree.py holds them."""

from d4cad.protocols import RuleFacts

FACTS = {
    "add-leaf": RuleFacts("a new childless node", "a node with fewer than two children", inverse="remove-leaf"),
    "split": RuleFacts("a node on a branch, which stays straight", inverse="remove-branch"),
    "remove-leaf": RuleFacts(
        "a childless node goes", "three nodes besides the root; a small leaf or a short branch, if guarded", "add-leaf"
    ),
    "remove-branch": RuleFacts(
        "a node with one child goes, and one straight branch replaces two",
        "three nodes besides the root; the straight branch and the turns after it keep to the limits",
        "split",
    ),
    "add-anywhere": RuleFacts(
        "a chain of nodes to a point of the canvas", "a node with fewer than two children", inverse="remove-leaf"
    ),
}
