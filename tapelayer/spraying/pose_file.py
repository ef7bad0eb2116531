"""Pose file: the gun's poses as text, pass by pass in spraying order, in the part's frame."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.provenance import Provenance
from tapelayer.spraying.passes import Pass
from tapelayer.spraying.program import Piece
from tapelayer.units import DEG, MM

DECIMALS = 4


def trajectory_text(
    passes: Sequence[Pass], pieces: Sequence[Piece], placement: tuple[Floats, Floats], provenance: Provenance
) -> bytes:
    """Return the file: `#` lines, rows `x y z theta phi` in mm and degrees, a blank line after each pass.

    Theta is unwrapped as in the program; theta in the program is the value here plus the part's rotation.

    Args:
        passes: in order.
        pieces: the pieces sprayed of them, in order.
        placement: rotation (3, 3) about z and origin (3,) in metres of the part's frame in `machine`.
        provenance: the sources named in the header.
    """
    rotation, origin = placement
    turn = np.arctan2(rotation[1, 0], rotation[0, 0])
    file = io.BytesIO()
    for line in (
        f"tapelayer {provenance.version}",
        f"source: {_plain(provenance.source)}",
        f"source sha256: {provenance.source_sha256}",
        f"setup sha256: {provenance.setup_sha256}",
        "columns: x y z theta phi, mm and deg, frame of the source",
    ):
        file.write(f"# {line}\n".encode("ascii"))
    before = -1
    for piece in pieces:
        planned = passes[piece.index]
        if piece.index != before:
            head = "" if before < 0 else "\n"
            head += f"# pass {planned.path.number} plane {planned.plane} curve {planned.curve} layer {planned.layer}\n"
            file.write(head.encode("ascii"))
        else:
            file.write(b"# split\n")
        points = (piece.joints[:, :3] - origin) @ rotation / MM
        rows = np.column_stack([points, (piece.joints[:, 3] - turn) / DEG, piece.joints[:, 4] / DEG])
        # Adding 0 removes the sign of a zero.
        np.savetxt(file, np.round(rows, DECIMALS) + 0.0, fmt=f"%.{DECIMALS}f")
        before = piece.index
    file.write(b"\n")
    return file.getvalue()


def _plain(name: str) -> str:
    """Return a file's name in printable ASCII."""
    return "".join(letter if " " <= letter <= "~" else "_" for letter in name)
