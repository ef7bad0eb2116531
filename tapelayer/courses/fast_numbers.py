"""Fast numbers: all numbers of a text in a few array operations."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints, Mask

_SHORT = 22  # most characters of a word that is read as an integer over a power of ten
_POWERS_OF_TEN = 10.0 ** np.arange(_SHORT)  # a double holds them exactly
_EXACT = 2**53  # a double holds the integers up to here exactly
_LARGEST = 10**18  # a power of ten below the largest 64-bit integer
_SPLITTER = 2.0**27 + 1.0


class NeedsCare(Exception):
    """The quick reader cannot tell that a file is good, so the careful one decides."""


def values_of_words(text: bytes, starts: Ints, stops: Ints) -> Floats:
    r"""Return the numbers (k,) of the words of a text from `starts` to before `stops` (k,).

    Words of up to 22 characters without exponent, which are nearly all, are read by `short_values`.

    Raises:
        NeedsCare: a word is not a number.

    Examples:
        >>> values_of_words(b"1.5 -2e3\n", np.array([0, 4]), np.array([3, 8])).tolist()
        [1.5, -2000.0]
    """
    characters = np.frombuffer(text, np.uint8)
    long = stops - starts > _SHORT
    if b"e" in text:
        long[np.searchsorted(stops, np.flatnonzero(characters == ord("e")), side="right")] = True
    if not np.any(long):
        return short_values(text, starts, stops)
    lengths = stops[long] + 1 - starts[long]  # with the blank after it, which separates the words
    ends = np.cumsum(lengths)
    inside = np.arange(ends[-1]) + np.repeat(starts[long] - (ends - lengths), lengths)
    values = np.empty(len(starts))
    values[long] = scanned(characters[inside].tobytes(), np.float64, len(lengths))
    others = characters.copy()
    others[inside] = ord(" ")
    values[~long] = short_values(others.tobytes(), starts[~long], stops[~long])
    return values


def short_values(text: bytes, starts: Ints, stops: Ints) -> Floats:
    r"""Return the numbers (k,) of words of up to 22 characters without exponent, as integers over powers of ten.

    Where a double holds the integer exactly, one division rounds like an exact reading of the text (Clinger 1990, the
    fast case), at a fraction of its cost.

    Raises:
        NeedsCare: a word is not a number.

    Examples:
        >>> short_values(b"1.5 -20\n", np.array([0, 4]), np.array([3, 7])).tolist()
        [1.5, -20.0]
    """
    characters = np.frombuffer(text, np.uint8)
    points = np.flatnonzero(characters == ord("."))
    owners: Ints | slice = slice(None)
    if len(points) != len(starts) or np.any((points < starts) | (points >= stops)):
        owners = np.searchsorted(stops, points, side="right")
        if np.any(owners[1:] == owners[:-1]):
            raise NeedsCare
    minus = characters[starts] == ord("-")
    signs = np.count_nonzero(minus) + np.count_nonzero(characters[starts] == ord("+"))
    if np.count_nonzero(characters == ord("-")) + np.count_nonzero(characters == ord("+")) != signs:
        raise NeedsCare
    scales = np.ones(len(starts))
    scales[owners] = _POWERS_OF_TEN[stops[owners] - points - 1]
    integers = scanned(text.translate(None, b"."), np.int64, len(starts))
    values: Floats = integers / scales
    values[(integers == 0) & minus] = -0.0
    rounded = np.flatnonzero((integers > _EXACT) | (integers < -_EXACT))
    if len(rounded):
        values[rounded], certain = quotients(integers[rounded], scales[rounded])
        for word in rounded[~certain].tolist():
            values[word] = float(text[starts[word] : stops[word]])
    return values


def quotients(integers: Ints, divisors: Floats) -> tuple[Floats, Mask]:
    """Return correctly rounded quotients (k,) of integers beyond 2^53, and where (k,) the rounding is certain.

    The remainder of a first quotient is computed with exact products (Dekker 1971) and divided again. The rounding is
    certain unless the quotient is too close to the midpoint of two doubles, or the integer has 19 digits.

    Examples:
        >>> values, certain = quotients(np.array([2**53 + 1]), np.array([10.0]))
        >>> values.tolist(), certain.tolist()
        ([900719925474099.2], [True])
    """
    certain = (integers < _LARGEST) & (integers > -_LARGEST)
    integers = np.where(certain, integers, _LARGEST)
    high = integers.astype(np.float64)
    low = (integers - high.astype(np.int64)).astype(np.float64)
    first = high / divisors
    product = first * divisors
    first_high, divisor_high = (_SPLITTER * factor - (_SPLITTER * factor - factor) for factor in (first, divisors))
    first_low, divisor_low = first - first_high, divisors - divisor_high
    error = first_low * divisor_low - (
        ((product - first_high * divisor_high) - first_low * divisor_high) - first_high * divisor_low
    )
    second = ((high - product) + (low - error)) / divisors
    quotients = first + second
    rest = np.abs(second - (quotients - first))
    middle = np.spacing(np.abs(quotients)) / 2
    near = np.minimum(np.abs(rest - middle), np.abs(rest - middle / 2))  # half as wide below a power of two
    return quotients, certain & (near > 1e-6 * middle)


def scanned(text: bytes, kind: type[np.generic], count: int) -> NDArray[Any]:
    r"""Return the `count` numbers of a text that ends with a line end or is empty.

    Raises:
        NeedsCare: there are more or fewer, or a word is not a number.

    Examples:
        >>> scanned(b"1 -2\n3\n", np.int64, 3).tolist()
        [1, -2, 3]
    """
    with warnings.catch_warnings():
        # At a word that is not a number NumPy raises or, depending on its version, warns and stops; then the last
        # number, the zero added here, is missing.
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            values = np.fromstring(text + b"0", dtype=kind, sep=" ")
        except ValueError:
            raise NeedsCare from None
    if len(values) != count + 1:
        raise NeedsCare
    return values[:-1]
