"""Arrays of samples: rows are samples, and nobody changes them after they are made."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only view of `array`; the array itself is left as it is.

    Args:
        array: any shape, any unit.
    """
    view = array.view()
    view.flags.writeable = False
    return view
