"""Array types by the kind of their values; shapes and units stand in the docstrings of what uses them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def float_or_array(values: FloatArray) -> Any:
    """Return the value of one sample as a float, the values (k,) of k samples as they are."""
    return values if values.ndim else float(values)
