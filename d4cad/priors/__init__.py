"""Denoisers that know what words look like: the embedded one, the trained one, Stable Diffusion."""
