"""Regularisation: relations of a designer found in a fitted sketch, solved for jointly, and kept if the loss allows."""

from d4cad.regularize.evidence import Evidence
from d4cad.regularize.parameters import Parameters
from d4cad.regularize.regularizing import Regularized, Scale, regularized
from d4cad.regularize.rounding import INCHES, MILLIMETRES

__all__ = ["INCHES", "MILLIMETRES", "Evidence", "Parameters", "Regularized", "Scale", "regularized"]
