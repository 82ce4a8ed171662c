"""The noise that an estimator FMU states, which the bridge judges its gauges by."""

import json

import numpy as np
import pytest

from strainfmu.cosim.estimators.description import noise_std_of
from strainfmu.cosim.estimators.step import noise_of
from strainfmu.interface.contents import FmuContents, contents_from

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(
    ("content", "noise"),
    [
        ({"gauge_noise_um_per_m": [0.24, 0.3]}, [0.24e-6, 0.3e-6]),
        ({"gauge_noise_um_per_m": [0.24]}, None),
        ({"gauge_noise_um_per_m": [0.24, -1.0]}, None),
        ({"gauge_noise_um_per_m": "x"}, None),
        ({}, None),
        ([], None),
    ],
)
def test_noise_is_read_or_not_known(content: object, noise: list[float] | None) -> None:
    found = noise_std_of(contents_from(json.dumps(content).encode()), 2)
    assert (found is None) == (noise is None)
    if found is not None:
        np.testing.assert_allclose(found, np.array(noise), rtol=1e-12)


def test_no_entry_and_no_attribute_are_not_known() -> None:
    assert noise_std_of(FmuContents(), 2) is None
    assert noise_of(lambda *_: None) is None
