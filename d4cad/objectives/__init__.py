"""Objectives: what a program is optimised for."""
