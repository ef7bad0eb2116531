"""Verified: a trajectory that passed verification, and the type that says so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from tapelayer.errors import VerificationFailed
from tapelayer.motion.trajectory import Trajectory

SHOWN_FAILURES = 10


class Verdict(Protocol):
    """What was measured on a trajectory, and whether it may be used."""

    @property
    def passed(self) -> bool:
        """Whether everything holds."""

    def worst(self, shown: int) -> str:
        """The first failures in words, a line each, then a count."""


Evidence_co = TypeVar("Evidence_co", bound=Verdict, covariant=True)


@dataclass(frozen=True, eq=False)
class Verified(Generic[Evidence_co]):
    """A trajectory that passed verification, with its evidence: what the writer of programs asks for.

    Attributes:
        trajectory: what was verified.
        evidence: every number that was measured.
    """

    trajectory: Trajectory
    evidence: Evidence_co

    def __post_init__(self) -> None:
        """Refuse a trajectory that failed.

        Raises:
            VerificationFailed: something does not hold; its evidence tells all.
        """
        failure = failure_of(self.evidence)
        if failure:
            raise failure


def failure_of(evidence: Verdict) -> VerificationFailed | None:
    """The error that names the worst failures; None where everything holds."""
    return None if evidence.passed else VerificationFailed(evidence.worst(SHOWN_FAILURES), evidence)
