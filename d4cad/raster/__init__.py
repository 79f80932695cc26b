"""Compiled kernels and the raster that every grammar makes."""
