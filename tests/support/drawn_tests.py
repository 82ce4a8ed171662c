"""Ground tests without readings, and tests whose vehicle, loads and pads are drawn from a model's tolerances."""

from collections.abc import Sequence

import numpy as np

from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.ground_test.candidate_cases import known_loads
from builder.calibration.ground_test.load_test import LoadCase, LoadErrors, LoadTest
from builder.calibration.score.ground_rows import AppliedTest
from builder.calibration.score.simulated_test import standard_load_cases
from builder.structure.as_built.as_built_structure import OF_MASS
from strainfmu.arrays import FloatArray


def blank_test(gauges: Sequence[str], errors: LoadErrors, std: float, count: int = 10) -> LoadTest:
    """Return a test of ``count`` pads and four attitudes without readings, whose noise is ``std`` [m/m]."""
    zero = np.zeros(len(gauges))
    cases = tuple(
        LoadCase(name=case.name, loads=known_loads(case, errors), reading=zero, reading_std=zero + std)
        for case in standard_load_cases(count, 3.6)
    )
    return LoadTest(gauge_names=tuple(gauges), cases=cases, errors=errors)


def drawn_readings(
    model: ReadingsModel, random: np.random.Generator, added: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the readings (n_cases, n_d) of a drawn vehicle, and its vector; ``added`` (n,) is added to that."""
    vector = model.std * random.standard_normal(len(model.std))
    if added is not None:
        vector = vector + added
    noise = model.test.reading_stds
    return model.readings(vector) + noise * random.standard_normal(noise.shape), vector


def applied_by(model: ReadingsModel, vector: FloatArray) -> AppliedTest:
    """Return the test of the vehicle ``vector`` (n,) of a model."""
    as_built = model.built(vector)
    errors = model.errors(vector)
    zero = errors.zero[model.group_of_case]
    zero += np.outer(model.time, errors.drift)
    weight = np.zeros_like(zero)
    for (case, known), strain in zip(model.loads, model.load_strains(as_built), strict=True):
        weight[case] += strain if isinstance(known.load, OF_MASS) else 0.0
    return AppliedTest(
        test=model.test,
        strain=model.readings(vector) - zero,
        weight=weight,
        zero=zero,
        of_load=lambda load, stated: model.structure.response_strain(as_built, model.structure.response(load)),
    )
