"""The report judges the estimator that a map is used with: of a map with tables the nonlinear one."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from field_maps import field_map
from flight_maps import ROWS, STATIONS, flight_map
from page_checks import assert_self_contained
from scaled_maps import scaled_map
from scipy.stats import norm
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from builder.inverse.noise.model import gauge_noise
from builder.reports.build_report.build_findings import BuildReport
from builder.reports.build_report.build_page import first_screen, report_page, write_numbers
from builder.reports.build_report.build_tables import report_tables
from builder.reports.findings.envelope_states import ALL, FEW, envelope, estimated_at, flight_accuracy, strain_at
from builder.reports.findings.estimator_in_use import (
    OF_GAUGES,
    InUse,
    NamedErrors,
    estimator_in_use,
    source_variances,
)
from builder.reports.findings.gauge_value import gauge_value
from builder.reports.page.html import page_html
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH
from strainfmu.estimator.map.inverse_map import InverseMap

N_D = STATIONS * ROWS


@pytest.fixture(scope="module")
def nonlinear_map() -> InverseMap:
    """Errors of every kind that a map with tables holds, each as large as the others."""
    random = np.random.default_rng(1)
    manifold = flight_map(discrepancy=1e-3, hardware=True)
    common = 1e-12 * random.standard_normal((2, 6, N_D))
    own = 1e-24 * random.random((21, N_D))
    return replace(scaled_map(2, 1, N_D), manifold=replace(manifold, common_error=common, gauge_error_product=own))


def errors_of(inverse_map: InverseMap) -> NamedErrors:
    """All errors of a kind under one name."""
    manifold = inverse_map.manifold
    assert manifold is not None
    columns = np.hstack([np.vstack([manifold.error_strain, manifold.error_load]), manifold.considered_columns])
    common = np.concatenate([manifold.common_error, manifold.considered_common])
    return NamedErrors(
        fixed=[gauge_noise(manifold.gauge_covariance)],
        off_tables={"pressure off the tables": columns},
        of_gauges={},
        common={"wall thickness": common},
    )


LINEAR: Any = None
"""What judges the linear map, of no concern to the other."""


@pytest.fixture(scope="module")
def in_use(nonlinear_map: InverseMap) -> InUse:
    nothing: Any = None
    return estimator_in_use(nonlinear_map, LINEAR, nothing, np.ones(1), errors_of(nonlinear_map))


@pytest.mark.fast
@pytest.mark.parametrize(
    "made", [lambda one: one, with_sensors, with_temperature], ids=["gauges", "sensors", "thermal"]
)
def test_the_sources_add_up_to_the_stated_variance(
    nonlinear_map: InverseMap, made: Callable[[InverseMap], InverseMap]
) -> None:
    """At every flight state and for every coefficient, 1e-9; every kind of error has a part.

    The core states these variances to 5e-3: its estimates end a little nearer to the middle of the ranges. Of
    auxiliary sensors it takes readings, in their units.
    """
    inverse_map = made(nonlinear_map)
    state = envelope(inverse_map.manifold, 3, 3).flown
    found = estimated_at(Estimator(inverse_map), state, ALL)
    parts, covariance = source_variances(inverse_map, errors_of(inverse_map), state)
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(sum(parts.values()), variance, rtol=1e-9)
    np.testing.assert_allclose(variance, found.coefficients_std**2, rtol=5e-3)
    assert not found.is_linear.any()
    assert all(np.max(part / found.coefficients_std**2) > 1e-6 for part in parts.values())
    assert {"gauge noise", "gauge gain", "common gain", "wall thickness", OF_GAUGES} < set(parts)


@pytest.mark.fast
def test_a_source_is_what_its_errors_do(nonlinear_map: InverseMap) -> None:
    """Twice the error of the common gain adds three times its part, where it hardly changes the weights."""
    small = replace(nonlinear_map.manifold, common_gain_std=1e-5)
    maps = [replace(nonlinear_map, manifold=replace(small, common_gain_std=std)) for std in (1e-5, 2e-5)]
    state = envelope(small, 2, 2).flown
    (parts, found), (_, other) = (source_variances(one, errors_of(one), state) for one in maps)
    part = parts["common gain"]
    change = np.diagonal(other - found, axis1=1, axis2=2)
    assert np.max(part) > 0.0
    np.testing.assert_allclose(change, 3.0 * part, rtol=1e-3, atol=1e-9 * np.max(found))


def test_the_nonlinear_estimator_of_a_map_with_tables(nonlinear_map: InverseMap, in_use: InUse) -> None:
    """Its rms sigma is that of estimates over the envelope, the cost of a gauge that of estimates without it."""
    assert in_use.is_nonlinear
    estimator, manifold = Estimator(nonlinear_map), nonlinear_map.manifold
    found = estimated_at(estimator, envelope(manifold).flown, ALL)
    rms = np.sqrt(np.mean(found.coefficients_std**2, axis=0))
    np.testing.assert_allclose(in_use.coefficients.std, rms, rtol=1e-3)
    np.testing.assert_allclose(in_use.largest_std, found.coefficients_std.max(axis=0), rtol=1e-3)
    np.testing.assert_allclose(in_use.coefficients.variance.sum(axis=0), in_use.coefficients.std**2, rtol=1e-9)
    assert in_use.pressure_removed is None


def test_the_value_of_a_gauge_is_to_the_nonlinear_estimator(nonlinear_map: InverseMap) -> None:
    """Growth of sigma is that of estimates without the gauge, or without two, over the same flight states."""
    estimator, manifold, value = Estimator(nonlinear_map), nonlinear_map.manifold, gauge_value(nonlinear_map)
    assert value.growth.shape == (N_D, 5)
    assert np.all(value.growth >= 1.0 - 1e-9)
    assert value.growth.max() > 1.001
    assert np.all((value.leverage > 0.0) & (value.leverage < 1.0))
    few, lost = envelope(manifold, *FEW).flown, int(np.argmax(value.growth[:, 1]))
    pair = int(np.argmax(value.pair_growth[:, 1]))
    mach, pressure = few[:, MACH], np.exp(few[:, LOG_PRESSURE])
    air = {"dynamic_pressure": 0.5 * HEAT_CAPACITY_RATIO * mach**2 * pressure, "mach_number": mach}
    whole, one, two = (
        np.mean(
            estimator.estimate(
                strain_at(manifold, few), valid=valid, static_pressure=pressure, q_source="independent", **air
            ).coefficients_std
            ** 2,
            axis=0,
        )
        for valid in (None, np.arange(N_D) != lost, ~np.isin(np.arange(N_D), value.pairs[pair]))
    )
    np.testing.assert_allclose(value.growth[lost], np.sqrt(one / whole), rtol=1e-4)
    np.testing.assert_allclose(value.pair_growth[pair], np.sqrt(two / whole), rtol=1e-4)


def test_a_bias_that_shows_is_that_of_the_residual_at_the_flight_states(nonlinear_map: InverseMap) -> None:
    """A bias of the stated size shifts z of its gauge by the alarm level and the tail of 1 miss in 100, to 5 %."""
    manifold, value = nonlinear_map.manifold, gauge_value(nonlinear_map)
    state = envelope(manifold, *FEW).flown
    estimator, k = Estimator(nonlinear_map), int(np.argmin(value.detectable_bias))
    strain = strain_at(manifold, state)
    mach, pressure = state[:, MACH], np.exp(state[:, LOG_PRESSURE])
    air = {"dynamic_pressure": 0.5 * HEAT_CAPACITY_RATIO * mach**2 * pressure, "mach_number": mach}
    biased = strain + np.where(np.arange(N_D) == k, value.detectable_bias[k], 0.0)
    found = estimator.estimate(biased, static_pressure=pressure, q_source="independent", **air)
    shift = norm.isf(0.5e-4 / N_D) + norm.isf(0.01)
    assert np.sqrt(np.mean(found.standardised_residual[:, k] ** 2)) == pytest.approx(shift, rel=0.05)


def test_pressure_is_judged_where_the_map_holds_it() -> None:
    """The variance that is left, over that of pressure that varies by 1000 Pa at each node."""
    one = field_map()
    n_p = len(one.point)
    observed = cast(Any, SimpleNamespace(node_std=np.full(n_p, 1000.0)))
    found = estimated_at(Estimator(one), envelope(one.manifold, *FEW).flown, ALL)
    scale = one.nominal_dynamic_pressure / found.air_data.value[:, -1]
    left = np.mean([(scale[k] * found[k].pressure().std) ** 2 for k in range(len(scale))]) / 1000.0**2
    removed = estimator_in_use(one, LINEAR, observed, np.ones(n_p), errors_of(one)).pressure_removed
    assert removed == pytest.approx(1.0 - left)
    assert 0.0 < left < 0.1


def test_the_linear_estimator_of_any_other_map(report: BuildReport) -> None:
    used = report.in_use
    assert not used.is_nonlinear
    assert used.node_removed is report.observability.node_removed
    assert used.pressure_removed == report.observability.removed
    assert "largest sigma" not in [column.heading for column in report_tables(report)["coefficients"].columns]


@pytest.mark.usefixtures("undrawn")
def test_page_and_numbers_state_the_nonlinear_sigma(
    report: BuildReport, nonlinear_map: InverseMap, in_use: InUse, tmp_path: Path
) -> None:
    """In the first screen; sentences, figures and tables of the linear map alone are left out."""
    if report.gamma is None:
        pytest.skip("the first screen is made alike for both cases, and takes seconds to make")
    limits = report.in_use.coefficients.range
    range_of = replace(in_use.coefficients, range=limits)
    growth = np.ones((report.inverse_map.n_gauges, 5))
    growth[3, 1] = 1.25
    used = replace(in_use, coefficients=range_of)
    judged = replace(
        report, in_use=used, gauges=replace(report.gauges, growth=growth), flight=flight_accuracy(nonlinear_map)
    )
    screen = first_screen(judged)
    lines = [line for group in screen.as_json().values() for line in group]
    width = np.ptp(limits, axis=1)
    stated = next(line for line in lines if line.startswith("C_A,"))
    assert f"sigma {used.coefficients.std[0]:.2g} rms, {used.largest_std[0]:.2g} at most" in stated
    percent = re.search(r"([\d.]+) % of the range", stated)
    assert percent is not None
    assert float(percent[1]) == pytest.approx(100.0 * used.coefficients.std[0] / width[0], rel=0.05)
    assert not any("best linear map" in line or "noise terms" in line or "no state" in line for line in lines)
    assert any(
        f"is {report.inverse_map.gauge_names[3]}: without it 25 % more sigma of C_N" in line for line in lines
    )
    largest = used.coefficients.names[int(np.argmax(used.coefficients.variance[:, 0]))]
    assert any(line.startswith("The source to reduce first is ") for line in lines)
    page = assert_self_contained(page_html(report_page(judged)))
    assert "3 sigma over the range of the snapshots" in page.text  # the figure of the sources
    assert "The first POD modes" not in page.text
    assert not {"table-modes", "table-eigenvalues"} & set(page.tables)
    assert not any("removed" in heading for heading in page.tables["table-classes"][0])
    assert "estimator: nonlinear, and the linear map (Case" in page.text
    assert largest in page.text
    write_numbers(judged, tmp_path)
    content = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert content["estimator"] == "nonlinear"
    rows = content["tables"]["coefficients"]["rows"]
    assert [row[1] for row in rows] == pytest.approx(used.coefficients.std.tolist())
    fractions = np.array([row[3:] for row in content["tables"]["sources"]["rows"]])
    np.testing.assert_allclose(fractions.sum(axis=0), 100.0)
