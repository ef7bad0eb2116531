"""Provenance: what a program was made from, as its header says it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Provenance:
    """What went into a program; never a path, never a date.

    Attributes:
        source: base name of the input file.
        source_sha256: SHA-256 of the input's bytes, hexadecimal.
        setup_sha256: SHA-256 of the effective setup, hexadecimal.
        version: version of this package.
        notes: further header lines, one comment each.
    """

    source: str
    source_sha256: str
    setup_sha256: str
    version: str
    notes: tuple[str, ...] = ()
