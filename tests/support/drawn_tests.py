"""Ground tests whose vehicle, loads and pads are drawn from the tolerances of a model."""

from __future__ import annotations

import numpy as np

from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.score.ground_rows import AppliedTest
from builder.structure.as_built.structure import OF_MASS
from strainfmu.arrays import FloatArray


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
    built = model.built(vector)
    errors = model.errors(vector)
    zero = errors.zero[[model.groups.index(case.group) for case in model.test.cases]]
    zero += np.outer(model.time, errors.drift)
    weight = np.zeros_like(zero)
    for (case, known), own in zip(model.loads, model.load_strains(built), strict=True):
        weight[case] += own if isinstance(known.load, OF_MASS) else 0.0
    return AppliedTest(
        test=model.test,
        strain=model.readings(vector) - zero,
        weight=weight,
        zero=zero,
        of_load=lambda load, stated: model.structure.response_strain(built, model.structure.response(load)),
    )
