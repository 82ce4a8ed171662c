"""Further parameters of the flow as the native FMU reads them: a section of ``resources/map.bin``.

Its content is eight 32-bit sizes, the first of which is their number, float64 values in the order of
:func:`parameter_section`, and a name of :data:`NAME_SIZE` bytes each, which ends by zeros.
``fmus/native/estimator/map/flow_parameters.h`` describes them to the C code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.linear.flow_parameters import LARGEST_SCORE, PARAMETER_TOLERANCE, FlowParameters
from strainfmu.estimator.resource.sections import section, sized_numbers

SECTION = b"PARAMS\0\0"
NAME_SIZE = 48


def parameter_section(known: FlowParameters) -> bytes:
    """Return the section of the parameters ``known`` to a map.

    Raises
    ------
    InputError
        A name is too long.
    """
    names = [name.encode() for name in known.names]
    long = next((name for name in names if len(name) >= NAME_SIZE), None)
    if long is not None:
        raise InputError(f"parameters: expected names shorter than {NAME_SIZE} bytes, got {long.decode()}")
    scalars = np.array([PARAMETER_TOLERANCE, LARGEST_SCORE])
    content = sized_numbers((len(names),), (scalars, known.minimum, known.maximum, known.span))
    return section(SECTION, content + b"".join(name.ljust(NAME_SIZE, b"\0") for name in names))
