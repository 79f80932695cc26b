"""The paper's tables, regenerated: its ablations as settings, many fits that are kept, and what they add up to."""
