"""What the nonlinear estimator knows over the envelope: deviations, where air data are identified, page."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from builder.figures.uncertainty import AccuracyMap, accuracy_maps
from builder.reports.build_report.build_sections import flight_accuracy as accuracy_section
from builder.reports.findings.envelope_states import (
    ALL,
    NAVIGATION,
    ROLLS,
    FlightAccuracy,
    flight_accuracy,
    flight_accuracy_table,
)
from builder.reports.page.html import Page, page_html
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS


@pytest.fixture(scope="module")
def whole_map() -> InverseMap:
    return replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-3))


@pytest.fixture(scope="module")
def accuracy(whole_map: InverseMap) -> FlightAccuracy:
    found = flight_accuracy(whole_map)
    assert found is not None
    return found


def test_a_map_without_tables_has_none(whole_map: InverseMap) -> None:
    assert flight_accuracy(replace(whole_map, manifold=None)) is None


def test_navigation_never_makes_a_deviation_larger(accuracy: FlightAccuracy) -> None:
    """To 1e-3: with less navigation the estimate ends nearer to the middle of the ranges, at other deviations."""
    given, alone = accuracy.coefficient_std
    assert np.all(given <= alone * (1.0 + 1e-3))
    assert np.max(alone / given) > 1.5
    given, alone = accuracy.air_data_std
    assert np.all(given <= alone * (1.0 + 1e-3))


@pytest.mark.parametrize("known", NAVIGATION)
def test_deviations_are_those_of_estimates_there(
    whole_map: InverseMap, accuracy: FlightAccuracy, known: str
) -> None:
    """A search of the tables, from the strain of the closed form that they were made of."""
    i, m, n = 2, 1, NAVIGATION.index(known)
    mach, incidence = float(accuracy.mach_number[m]), float(accuracy.total_incidence[i])
    roll, pressure = 2.0 * np.pi * np.arange(ROLLS) / ROLLS, accuracy.static_pressure
    strain = [
        exact_response(mach, incidence * np.cos(one), incidence * np.sin(one), pressure)[:N_D] for one in roll
    ]
    air = {"mach_number": mach, "static_pressure": pressure} if known == ALL else {}
    found = Estimator(whole_map).estimate(
        np.array(strain), 0.7 * mach**2 * pressure, q_source="independent", **air
    )
    rms = np.sqrt(np.mean(found.coefficients_std**2, axis=0))
    np.testing.assert_allclose(accuracy.coefficient_std[n, i, m], rms, rtol=0.02)
    rms = np.sqrt(np.mean(found.air_data.std**2, axis=0))
    np.testing.assert_allclose(accuracy.air_data_std[n, i, m], rms, rtol=0.02)


def test_the_roll_angle_is_not_identified_near_zero_incidence(accuracy: FlightAccuracy) -> None:
    identified = accuracy.is_identified("wind_roll_angle")[0]
    assert np.all(identified[-1] == 1.0)
    std = accuracy.air_data("wind_roll_angle")[0]
    assert np.all(std[0] > 2.0 * std[-1])


def test_the_table_holds_every_state(accuracy: FlightAccuracy) -> None:
    table = flight_accuracy_table(accuracy)
    assert len(table.rows) == len(NAVIGATION) * len(accuracy.total_incidence) * len(accuracy.mach_number)
    row = table.rows[-1]
    assert row[0] == NAVIGATION[-1]
    assert row[3] == accuracy.coefficient_std[-1, -1, -1, 0]
    assert row[9] == accuracy.air_data_std[-1, -1, -1, AIR_DATA_NAMES.index("mach_number")]


def test_figures_show_what_is_not_identified() -> None:
    std = np.arange(12.0).reshape(2, 2, 3)
    part = np.ones((2, 2, 3))
    part[1, 0] = 0.25
    mach, incidence = np.array([5.0, 6.0, 7.0]), np.array([2.0, 4.0])
    maps = [
        AccuracyMap(label="C_A [1]", std=std, identified=None),
        AccuracyMap(label="Mach number [1]", std=std, identified=part),
        AccuracyMap(label="p_inf [kPa]", std=std, identified=part),
    ]
    shown = accuracy_maps(mach, incidence, NAVIGATION, maps)
    panels = shown.figure.axes[:6]
    assert [one.get_title() for one in panels] == ["$C_A$ [1]", "Mach number [1]", "$p_\\infty$ [kPa]", "", "", ""]
    assert "$p_\\infty$" in panels[0].get_ylabel()
    hatched = [sum(bool(of.get_hatch()) for of in one.patches) for one in panels]
    assert hatched == [0, 0, 0, 0, 3, 3]
    places = shown.places()
    assert len(places) == 12
    assert all(len(one.rectangles) == 3 for one in places)
    assert places[7].text.splitlines() == [
        f"M 6, incidence 2 deg, given {NAVIGATION[1]}",
        "sigma of C_A [1] 7",
        "sigma of Mach number [1] 7, identified at 25 % of the roll angles",
        "sigma of p_inf [kPa] 7, identified at 25 % of the roll angles",
    ]
    assert "identified" not in places[10].text


def test_many_quantities_stand_in_blocks() -> None:
    std = np.ones((2, 2, 3))
    maps = [AccuracyMap(label=f"quantity {k}", std=std, identified=None) for k in range(10)]
    shown = accuracy_maps(np.array([5.0, 6.0, 7.0]), np.array([2.0, 4.0]), NAVIGATION, maps)
    first, last = shown.places()[0], shown.places()[-1]
    assert len(first.rectangles) == len(last.rectangles) == 10
    assert first.rectangles[5][1] > first.rectangles[0][1] + 0.4


@pytest.mark.usefixtures("undrawn")
def test_the_section_stands_on_a_page(accuracy: FlightAccuracy) -> None:
    table = flight_accuracy_table(accuracy)
    html = page_html(Page("Report", (), (accuracy_section(accuracy, {table.name: table}),)))
    assert "The nonlinear estimator over the envelope" in html
    assert "q_inf only" in html
