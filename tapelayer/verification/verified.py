"""Verified: the type of a trajectory that passed verification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from tapelayer.errors import VerificationFailed
from tapelayer.motion.trajectory import Trajectory

SHOWN_FAILURES = 10


class Verdict(Protocol):
    """The measurements on a trajectory, and whether it may be used."""

    @property
    def passed(self) -> bool:
        """Whether every limit is kept."""

    def worst(self, shown: int) -> str:
        """Return the first failures in words, one per line, then a count of the rest."""


Evidence_co = TypeVar("Evidence_co", bound=Verdict, covariant=True)


@dataclass(frozen=True, eq=False)
class Verified(Generic[Evidence_co]):
    """A trajectory that passed verification, with its evidence, as the program writer requires.

    Attributes:
        trajectory: the verified trajectory.
        evidence: every measured number.
    """

    trajectory: Trajectory
    evidence: Evidence_co

    def __post_init__(self) -> None:
        """Refuse a trajectory that failed.

        Raises:
            VerificationFailed: a limit or rule is broken; its evidence holds everything.
        """
        failure = failure_of(self.evidence)
        if failure:
            raise failure


def failure_of(evidence: Verdict) -> VerificationFailed | None:
    """Return the error that names the worst failures; None where every limit is kept."""
    return None if evidence.passed else VerificationFailed(evidence.worst(SHOWN_FAILURES), evidence)
