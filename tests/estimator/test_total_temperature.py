"""Total temperature as air data: the Mach number it gives, alone and beside another, by every way; refusals."""

from ctypes import byref, c_int, c_size_t
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import exact_response
from raw_fmu import OK, Fmu2, write_resource
from recorded_case import read_csv, write_csv

from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, AIR_INPUT_NAMES, LAST_INPUTS
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.estimator.reference.air import air_inputs_of, mach_by_temperature
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast

MACH, ALTITUDE = 6.0, 20e3
PRESSURE, TEMPERATURE = pressure_and_temperature(ALTITUDE)
TOTAL = TEMPERATURE * (1.0 + 0.2 * MACH**2)
N_D = whole_map().n_gauges
STRAIN = exact_response(MACH, 0.03, 0.01, PRESSURE)[:N_D]
M = AIR_DATA_NAMES.index("mach_number")


def estimated(**flow: Any) -> Estimate:
    return Estimator(whole_map()).estimate(STRAIN, altitude=ALTITUDE, **flow)


def test_it_gives_the_mach_number_of_a_perfect_gas() -> None:
    """The closed form, its deviation by drawn errors of both temperatures, and nothing where there is no flow."""
    mach, std = mach_by_temperature(TOTAL, 20.0, ALTITUDE)
    assert mach == pytest.approx(MACH, rel=1e-14)
    draw = np.random.default_rng(5).standard_normal((2, 100_000))
    drawn = np.sqrt(5.0 * ((TOTAL + 20.0 * draw[0]) / (TEMPERATURE * (1.0 + 0.03 * draw[1])) - 1.0))
    assert std == pytest.approx(drawn.std(), rel=0.02)
    for total, altitude in ((0.9 * TEMPERATURE, ALTITUDE), (TOTAL, np.nan), (TOTAL, 80e3), (np.inf, ALTITUDE)):
        assert np.isnan(mach_by_temperature(total, 20.0, altitude)).all()


@pytest.mark.parametrize(
    ("total", "mach"),
    [(TOTAL, {}), (TOTAL, {"mach_number": 6.05, "mach_number_std": 0.1}), (1.2 * TOTAL, {"mach_number": 6.0})],
    ids=["alone", "beside a Mach number", "that contradicts it"],
)
def test_the_core_joins_it_as_the_reference_does(total: float, mach: dict[str, float]) -> None:
    """Equal to the estimate of the one Mach number that the reference makes of both."""
    given = dict.fromkeys(AIR_INPUT_NAMES, np.nan) | mach
    given |= {"altitude": ALTITUDE, "total_temperature": total, "total_temperature_std": 20.0}
    joined = air_inputs_of(whole_map(), given)
    found = estimated(total_temperature=total, total_temperature_std=20.0, **mach)
    expected = estimated(mach_number=joined.value[0], mach_number_std=joined.std[0])
    np.testing.assert_allclose(found.loads, expected.loads, rtol=1e-9)
    np.testing.assert_allclose(found.air_data.std, expected.air_data.std, rtol=1e-9)
    assert found.health == expected.health


def test_it_informs_and_a_contradiction_widens() -> None:
    without, alone = estimated(), estimated(total_temperature=TOTAL)
    assert alone.air_data.std[M] < without.air_data.std[M]
    assert abs(alone.air_data.value[M] - MACH) < 3.0 * alone.air_data.std[M]
    given = dict.fromkeys(AIR_INPUT_NAMES, np.nan) | {"altitude": ALTITUDE, "mach_number": MACH}
    one, both, apart = (
        air_inputs_of(whole_map(), given | {"total_temperature": total}).std[0]
        for total in (np.nan, TOTAL, 2.0 * TOTAL)
    )
    assert both < one < apart


def test_what_could_not_act_is_refused() -> None:
    linear = Estimator(whole_map().without_tables())
    for estimator, flow, line in (
        (Estimator(whole_map()), {}, "total_temperature: expected the altitude with it, got none"),
        (linear, {"altitude": ALTITUDE}, "total_temperature: expected none, a linear map does not take it"),
    ):
        with pytest.raises(InputError, match=line):
            estimator.estimate(STRAIN, 1e5, total_temperature=TOTAL, **flow)
        with pytest.raises(InputError, match=line):
            estimator.track(STRAIN[None], 1e5, total_temperature=np.array([TOTAL]), **flow)
    with pytest.raises(InputError, match="total_temperature_std: expected numbers from 0 on, got -1"):
        estimated(total_temperature=TOTAL, total_temperature_std=-1.0)
    # Of samples along time one may lose the altitude; it says that the Mach number was not used.
    one = Estimator(whole_map()).track(STRAIN, total_temperature=TOTAL, altitude=np.nan)
    assert not one.air_data_used[0]


def test_by_fmu_and_recording(tmp_path: Path) -> None:
    inverse_map = whole_map()
    interface = [one.name for one in estimator_interface(inverse_map)]
    place = interface.index("total_temperature")
    assert interface[place:] == ["total_temperature", "total_temperature_std", *LAST_INPUTS, "health.usable"]
    fmu = Fmu2(write_resource(inverse_map, tmp_path).as_uri(), N_D).start()
    fmu.set_strain(STRAIN)
    flow = {"altitude": ALTITUDE, "total_temperature": TOTAL, "total_temperature_std": 20.0}
    assert fmu.set_reals([interface.index(name) for name in flow], list(flow.values())) == OK
    assert fmu.step() == OK
    names = ("C_N", "air_data.mach_number", "sigma.air_data.mach_number")
    of_fmu = fmu.get_reals([interface.index(name) for name in names])
    used, flag = fmu.references([interface.index("navigation_used.mach_number")]), c_int()
    for altitude, expected in ((ALTITUDE, 1), (0.0, 0)):
        assert fmu.set_reals([interface.index("altitude")], [altitude]) == OK
        assert fmu.step() == OK
        assert fmu.call("GetBoolean", used, c_size_t(1), byref(flag)) == OK
        assert flag.value == expected, "without an altitude it states no Mach number"
    fmu.free()
    found = estimated(total_temperature=TOTAL, total_temperature_std=20.0)
    expected = [found.coefficients[1], found.air_data.value[M], found.air_data.std[M]]
    np.testing.assert_allclose(of_fmu, expected, rtol=1e-9)
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    headings = [*inverse_map.gauge_names, "altitude [m]", "total_temperature [K]", "total_temperature_std [K]"]
    values = np.tile([*STRAIN, *flow.values()], (2, 1))
    data = write_csv(tmp_path / "d.csv", ["time", *headings], np.array([0.0, 0.01]), values)
    estimate_file(tmp_path / "map.h5", data, tmp_path / "o.csv", float("nan"))
    table = read_csv(tmp_path / "o.csv")
    assert table["total_temperature [K]"] == pytest.approx([TOTAL] * 2)
    first = [table[name][0] for name in ("C_N [1]", "air_data.mach_number [1]", "sigma.air_data.mach_number [1]")]
    np.testing.assert_allclose(first, expected, rtol=1e-9)


def test_a_recording_with_it_is_refused_for_a_linear_map(tmp_path: Path) -> None:
    inverse_map = whole_map().without_tables()
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    headings = [*inverse_map.gauge_names, "dynamic_pressure [Pa]", "total_temperature [K]"]
    values = np.tile([*STRAIN, 1e5, TOTAL], (2, 1))
    data = write_csv(tmp_path / "d.csv", ["time", *headings], np.array([0.0, 0.01]), values)
    with pytest.raises(InputError, match="total_temperature"):
        estimate_file(tmp_path / "map.h5", data, tmp_path / "o.csv")
    estimate_file(tmp_path / "map.h5", data, tmp_path / "o.csv", ignore_columns=("total_temperature",))
