"""Rolling moment and section loads of the native library: those of Python, whatever else changes."""

from __future__ import annotations

import numpy as np
import pytest
from native_case import NativeCase
from other_load_maps import STATIONS, with_own_further
from raw_fmu import N_OUTPUTS, OK, Fmu2, first_zero, write_resource
from scaled_maps import whole_scaled_map
from thermal_maps import REFERENCE, with_temperature

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module", params=["case 1", "case 2"])
def six(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> NativeCase:
    plain = whole_scaled_map(*{"case 1": (1, 4, 30, 5), "case 2": (2, 4, 27, 40)}[request.param])
    held = with_temperature(with_own_further(plain), k=5, n_t=3)
    return NativeCase(held, write_resource(held, tmp_path_factory.mktemp("six")))


def first_further(n: int) -> int:
    """Behind zeros, three temperatures and the time constant of the filter."""
    return first_zero(n) + 2 * n + 1 + 3 + 1


@pytest.mark.parametrize("deviation", [0.0, 4e3])
@pytest.mark.parametrize("lost", [False, True])
def test_derivatives_against_differences(six: NativeCase, deviation: float, lost: bool) -> None:
    """By strains, pressure with its deviation, settings, zeros and temperatures."""
    fmu, random, n = Fmu2(six.uri, six.n).start(), np.random.default_rng(5), six.n
    strain = six.inverse_map.mean_strain + 5.0 * six.inverse_map.noise_std * random.normal(size=n)
    valid = np.ones(n, dtype=bool)
    if lost:
        valid[1], strain[3] = False, np.nan
    fmu.set_strain(strain)
    fmu.set_valid(valid)
    assert fmu.set_scalars(0, 1.1e5, deviation, 6.0, 2e4, 0.05, 1.3, 0.25, 0.6, 0.4) == OK
    sensors = range(first_zero(n) + 2 * n + 1, first_further(n) - 1)
    assert fmu.set_reals(sensors, REFERENCE + 5.0 * random.normal(size=3)) == OK
    scalars = N_OUTPUTS + 2 * n
    known = [
        *range(N_OUTPUTS, N_OUTPUTS + n),
        *range(scalars, scalars + 9),
        *range(first_zero(n), first_zero(n) + n),
    ]
    known += sensors
    first = first_further(n)
    outputs = [first, first + 2, *range(first + 4, first + 4 + 6 * len(STATIONS))]
    scales = [1e4, deviation, 1.0, 1e3, 0.0, 1.0, 0.2, 0.5, 1.0]
    size = np.concatenate([six.inverse_map.noise_std, scales, six.inverse_map.noise_std, np.ones(3)])
    centre = fmu.get_reals(known)
    for _ in range(4):
        direction = size * random.normal(size=len(size))
        exact, sides = fmu.derivative(outputs, known, direction), []
        for step in (1e-5, -1e-5):
            assert fmu.set_reals(known, centre + step * direction) == OK
            sides.append(fmu.get_reals(outputs))
        assert fmu.set_reals(known, centre) == OK
        difference = (sides[0] - sides[1]) / 2e-5
        scale = np.abs(sides[0]) + np.abs(difference)
        k = 3 * len(STATIONS)
        for group in (slice(0, 1), slice(1, 2), slice(2, 2 + k), slice(2 + k, 2 + 2 * k)):
            assert np.all(np.abs(exact - difference)[group] <= 1e-7 * np.linalg.norm(scale[group])), group
    assert fmu.set_scalars(0, 0.0) == OK
    assert np.isnan(fmu.derivative(outputs, known, size)).all()
    fmu.free()
