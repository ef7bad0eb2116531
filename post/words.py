"""Fixed-point words: columns of numbers to NC text, without a Python step per block.

A word is a few *cells* of four bytes, looked up in tables and padded with NUL; rows of cells become text by dropping
the NULs. Numbers are integers once `rounded`, so the text is exact, has no exponent and never reads -0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

Cells = tuple[NDArray[np.uint32], ...]

_CELL = np.dtype("<u4")
_GROUP_DIGITS = 4
_GROUP = 10**_GROUP_DIGITS
_EXACT = 2.0**53
_EVERY_ROW = slice(None)


def rounded(values: NDArray[np.float64], decimals: int) -> NDArray[np.int64]:
    """Round to whole units of the last decimal, half away from zero.

    The product of value and 10^decimals in double precision is rounded, so that 1.0005 at three decimals becomes 1.001
    although its double lies slightly below the tie.

    Args:
        values: any shape, in the written unit.
        decimals: digits after the point.

    Raises:
        ValueError: a value is not finite, or too large for its last decimal to mean anything (2^53 units).
    """
    scaled = values * 10.0**decimals
    # A NaN anywhere is the maximum, and fails the comparison.
    if not np.abs(scaled).max(initial=0.0) < _EXACT:
        raise ValueError(f"{values[~(np.abs(scaled) < _EXACT)][0]} has no fixed-point word with {decimals} decimals")
    whole = np.rint(scaled)
    off = np.abs(scaled - whole)
    if off.max(initial=0.0) == 0.5:
        ties = off == 0.5
        whole[ties] = scaled[ties] + np.copysign(0.5, scaled[ties])
    return whole.astype(np.int64)


def words(address: bytes, numbers: NDArray[np.int64], decimals: int) -> Cells:
    """Return the cells of one word per row.

    Args:
        address: text before the number, including its leading space: b" X", b" Q1=".
        numbers: (m,) integers in units of the last decimal, as `rounded` gives them.
        decimals: digits after the point; 0 writes no point.
    """
    signs = literals([address, address + b"-"])
    negative = (numbers < 0).view(np.uint8)
    whole = np.abs(numbers)
    # 32-bit division is the faster one, and holds 2,147 m in micrometres.
    whole = whole.astype(np.uint32 if whole.max(initial=0) < 2**32 else np.uint64)
    cells = [sign[negative] for sign in signs]
    if not decimals:
        return (*cells, *_whole(whole))
    scale = whole.dtype.type(10**decimals)
    digits = whole // scale
    fraction = whole - digits * scale
    return (*cells, *_whole(digits), *_fraction(fraction, decimals))


def literals(texts: Sequence[bytes]) -> Cells:
    """Return the cells of fixed texts: index each with text numbers to choose a text per row; empty ones write nothing.

    Args:
        texts: m texts without NUL.
    """
    width = -(-max(len(text) for text in texts) // _CELL.itemsize)
    table = np.array(texts, dtype=f"S{max(width, 1) * _CELL.itemsize}").view(_CELL).reshape(len(texts), -1)
    return tuple(np.ascontiguousarray(table.T))


def join(rows: int, columns: Iterable[tuple[NDArray[np.int64] | None, Cells]]) -> bytes:
    """Return the text of a table of words, row by row, with line ends only where a column provides them.

    Args:
        rows: number of rows.
        columns: for each column the (m,) rows that carry its word (None: every row) and the m words' cells.
    """
    placed = [(_EVERY_ROW if at is None else at, cell) for at, cells in columns for cell in cells]
    page = bytearray(rows * len(placed) * _CELL.itemsize)
    table = np.frombuffer(page, dtype=_CELL).reshape(rows, -1)
    for column, (at, cell) in enumerate(placed):
        table[:, column][at] = cell
    return bytes(page.translate(None, b"\0"))


def _whole(digits: NDArray[np.unsignedinteger]) -> Cells:
    """Return the cells of whole numbers without leading zeros."""
    most = int(digits.max(initial=0))
    if most < _GROUP:
        return (_table(0)[digits],)
    group = digits.dtype.type(_GROUP)
    high = digits // group
    low = digits - high * group
    above = _whole(high)
    # Where the group above is 0, it is not written, and the group below has no leading zeros.
    for cell in above:
        cell[high == 0] = 0
    return (*above, np.where(high == 0, _table(0)[low], _table(_GROUP_DIGITS)[low]))


def _fraction(digits: NDArray[np.unsignedinteger], width: int) -> Cells:
    """Return the cells of a point and `width` digits after it."""
    first = width % _GROUP_DIGITS
    scale = digits.dtype.type(10 ** (width - first))
    head = digits // scale
    cells = [_table(first, point=True)[head]]
    rest = digits - head * scale
    for left in range(width - first - _GROUP_DIGITS, -1, -_GROUP_DIGITS):
        scale = digits.dtype.type(10**left)
        group = rest // scale
        rest = rest - group * scale
        cells.append(_table(_GROUP_DIGITS)[group])
    return tuple(cells)


@cache
def _table(width: int, point: bool = False) -> NDArray[np.uint32]:
    """Return every group of `width` digits with leading zeros (0: up to four without), after an optional point."""
    if not width and not point:
        texts = [b"%d" % i for i in range(_GROUP)]
    else:
        texts = [b"." * point + (b"%0*d" % (width, i) if width else b"") for i in range(10**width)]
    return np.array(texts, dtype="S4").view(_CELL)
