"""Grammars of shape programs."""
