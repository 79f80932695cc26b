"""Parts that carry loads: problems, their finite elements, and the road from a problem to a part."""
