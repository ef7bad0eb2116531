"""Result: what a job of any kind made, and how it is reported."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Protocol

from rich.table import Table

from tapelayer.errors import VerificationFailed
from tapelayer.language import Language
from tapelayer.progress import UNSEEN, Steps
from tapelayer.provenance import sealed
from tapelayer.reporting.subject import Occasion

UNTOLD = Occasion()


class Result(ABC):
    """The result of a job: its product, and the measurements made when judging it.

    Attributes:
        text: bytes of the product; empty where there is none.
        remarks: sentences to print beside the verdict.
    """

    text: bytes
    remarks: tuple[str, ...]

    @property
    @abstractmethod
    def failure(self) -> VerificationFailed | None:
        """Why the product may not be used; None where it passed."""

    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """Return the verdict and all that was measured, as plain values for JSON."""

    @abstractmethod
    def summary(self, language: Language = "en") -> Table:
        """Return the report as a table for a terminal."""

    @abstractmethod
    def page(self, occasion: Occasion = UNTOLD, language: Language = "en") -> str:
        """Return the report as one HTML page with plots, titled with the product's name."""

    @abstractmethod
    def report(self, occasion: Occasion = UNTOLD) -> dict[str, Any]:
        """Return the report as plain values for JSON: the same for the same job, product and occasion."""

    def report_file(self, occasion: Occasion = UNTOLD) -> bytes:
        """Return the report as the bytes of a JSON file, with the hash of its own text as the last key."""
        text = json.dumps(self.report(occasion), indent=2, allow_nan=False).removesuffix("\n}").encode() + b",\n}\n"
        return sealed(text, len(text) - len("}\n"), '  "text_sha256": "', '"')

    def page_file(self, occasion: Occasion = UNTOLD, language: Language = "en") -> bytes:
        """Return the report as the bytes of an HTML file, with the hash of its own text as the last comment."""
        text = self.page(occasion, language).encode()
        return sealed(text, len(text), "<!-- text sha256: ", " -->")

    def notes(self, language: Language = "en") -> tuple[str, ...]:
        """Return sentences to print beside the report's table."""
        return ()

    def files(self) -> Mapping[str, bytes]:
        """Return the contents of further files, by file name."""
        return {}

    def told(self) -> dict[str, Any]:
        """Return what a list of jobs tells that the report's numbers do not."""
        return {}


class Makes(Protocol):
    """A job: everything that a product is made from."""

    def make(self, name: str, steps: Steps = UNSEEN) -> Result:
        """Make the product of that name, and judge it; `Result.failure` is None if it may be used."""
