"""Fabrication checks: whether a part can be made, and where it cannot."""

from d4cad.exporters.checks.limits import PROCESSES, Limits, Process, process
from d4cad.exporters.checks.report import Finding, Place, Report, Status
from d4cad.exporters.checks.run import CHECKS, check, check_loops

__all__ = [
    "CHECKS",
    "PROCESSES",
    "Finding",
    "Limits",
    "Place",
    "Process",
    "Report",
    "Status",
    "check",
    "check_loops",
    "process",
]
