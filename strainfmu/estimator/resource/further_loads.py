"""Loads beside the five as the native FMU reads them: a section of ``resources/map.bin``.

Its content is eight 32-bit sizes, the first of which is their number, then float64 values in the order of
:func:`further_section`. ``fmus/native/estimator/linear/further_loads.h`` describes them to the C code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.further_loads import FurtherLoads, is_moment
from strainfmu.estimator.linear.decomposition import Decomposition
from strainfmu.estimator.resource.sections import section, sized_numbers

SECTION = b"FURTHER\0"


def further_section(
    further: FurtherLoads, parts: Decomposition, spread_load: FloatArray, spread_unseen: FloatArray
) -> bytes:
    """Return the section of ``further`` of a map in form "dynamic_pressure".

    Parameters
    ----------
    spread_load, spread_unseen : (n_d, m) loads of the columns that stand for what has a prior, and (m,) the
        variance that these columns do not hold.
    """
    m = len(further.load_of_mean)
    fixed = np.zeros(m) if further.fixed_load is None else further.fixed_load
    numbers = (
        is_moment(len(further.section_station)).astype(float),
        parts.load_per_direction[5:].T,
        np.diag(parts.unseen)[5:],
        fixed,
        further.load_of_mean - fixed,
        further.load_per_state.T,
        spread_load,
        spread_unseen,
    )
    return section(SECTION, sized_numbers((m,), numbers))
