"""What a fabrication check found: values that print, save and draw."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from d4cad.loop import Loop


class Status(StrEnum):
    """The outcome of one check."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True, slots=True)
class Place:
    """Where something is: ``x``, ``y`` in mm, and the ``value`` there in the finding's unit.

    ``to``: the other end of a distance.
    """

    x: float
    y: float
    value: float | None = None
    to: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Finding:
    """The outcome of one check.

    ``measured``, ``limit``: in ``unit``, None where there is no such number. ``places``: where the limit is missed, or
    of the measured value; the worst one first. ``message``: one sentence. ``details``: further numbers by name.
    """

    name: str
    status: Status
    message: str
    measured: float | None = None
    limit: float | None = None
    unit: str = "mm"
    places: tuple[Place, ...] = ()
    details: dict[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "name": self.name,
            "status": self.status.value,
            "measured": self.measured,
            "limit": self.limit,
            "unit": self.unit,
            "message": self.message,
            "places": [
                {"x": p.x, "y": p.y, "value": p.value, **({} if p.to is None else {"to": list(p.to)})}
                for p in self.places
            ],
            **({"details": self.details} if self.details else {}),
        }


@dataclass(frozen=True, slots=True)
class Report:
    """All findings about one part, and its ``loops`` in mm, which may cross."""

    findings: tuple[Finding, ...]
    loops: tuple[Loop, ...]

    @property
    def passed(self) -> bool:
        """Whether no check failed; what was not checked has not failed."""
        return not any(finding.status is Status.FAILED for finding in self.findings)

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The checks that failed."""
        return tuple(finding for finding in self.findings if finding.status is Status.FAILED)

    def __getitem__(self, name: str) -> Finding:
        """The finding of a check by its name; raises KeyError."""
        for finding in self.findings:
            if finding.name == name:
                return finding
        raise KeyError(name)

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"passed": self.passed, "findings": [finding.to_dict() for finding in self.findings]}


def not_checked(name: str, why: str, unit: str = "mm") -> Finding:
    """A check that was not made."""
    return Finding(name, Status.NOT_CHECKED, why, unit=unit)


def judged(ok: bool) -> Status:
    """Passed or failed."""
    return Status.PASSED if ok else Status.FAILED
