"""The report's page and files: one set of numbers in three forms, for any case, structure and gauges."""

import csv
import json
import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from page_checks import assert_self_contained
from report_case import CASE_1, ReportCase, case_of

from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots, snapshots_on
from builder.figures.observability_figures import unrolled_pressure
from builder.inverse.build import build_inverse_map
from builder.inverse.mode_choice import mode_choice_lines
from builder.inverse.noise.model import nuisance_modes
from builder.reports.build_report.build_findings import BuildReport, build_report, exclusions
from builder.reports.build_report.build_page import first_screen, report_page, write_numbers
from builder.reports.build_report.build_sections import blind_line, blindness_text
from builder.reports.build_report.build_tables import report_tables
from builder.reports.page.html import Page, Paragraph, Section, page_html, picture
from builder.reports.page.origin import input_files
from builder.reports.page.page_tables import Column, shown
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, save_inverse_map
from strainfmu.estimator.map.sensors import STRAIN, SensorRows
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.version import __version__

Parts = tuple[Vehicle, Snapshots, StructuralModel]

SECTIONS = [
    "what-this-layout-observes",
    "blindness",
    "uncertainty-of-each-coefficient",
    "value-of-each-gauge",
    "cost-of-a-lost-gauge",
    "weight-of-the-prior",
    "aerodynamics",
    "noise-terms",
    "validity-range",
    "errors-not-included",
    "numbers",
]


def test_sections_of_the_page_in_order(report: BuildReport, html: str) -> None:
    page = assert_self_contained(html)
    sections = [name for name in page.anchors if not name.startswith("table-")]
    expected = [name for name in SECTIONS if report.gamma or name != "weight-of-the-prior"]
    assert sections == expected
    assert "nan" not in page.text.lower().replace("nano", "").split()
    assert len(page.alternatives) == (12 if report.gamma else 10)
    assert blind_line(report) in page.text


def test_json_and_csv_hold_what_the_page_shows(report: BuildReport, html: str, tmp_path: Path) -> None:
    write_numbers(report, tmp_path)
    content = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    page = assert_self_contained(html)
    checked = 0
    for name, table in content["tables"].items():
        with (tmp_path / "report_tables" / f"{name}.csv").open(encoding="utf-8", newline="") as stream:
            headings, *rows = list(csv.reader(stream))
        assert len(rows) == len(table["rows"])
        for from_csv, from_json in zip(rows, table["rows"], strict=True):
            for one, other in zip(from_csv, from_json, strict=True):
                if isinstance(other, float):
                    assert float(one) == other
        if f"table-{name}" not in page.tables:
            continue
        shown_headings, *shown_rows = page.tables[f"table-{name}"]
        assert shown_headings == headings
        columns = report_tables(report)[name].columns
        for texts, values in zip(shown_rows, table["rows"], strict=False):
            for text, value, column in zip(texts, values, columns, strict=True):
                assert text == shown(value, column)
                checked += 1
    assert checked > 500
    assert content["blind_classes"] == ["odd in y, odd in z"]
    assert len(content["excluded"]) >= 6


def test_the_page_has_no_negative_zero(report: BuildReport) -> None:
    """Sentences on what is not removed, and on fractions that round to 0."""
    observed = replace(report.observability, removed=-1e-9, class_removed=np.full(4, -1e-9))
    lines = first_screen(replace(report, in_use=replace(report.in_use, pressure_removed=-1e-9))).as_json()
    texts = [line for group in lines.values() for line in group]
    texts += [block.text for block in blindness_text(replace(report, observability=observed))]
    assert any(" 0.0 %, is inferred" in text for text in texts)
    assert "Surface pressure: the data remove 0 % of the variance of the snapshots." in texts
    assert not any(re.search(r"-0(\.0*)?(?![.\d])", text) for text in texts)


@pytest.mark.usefixtures("undrawn")
def test_the_page_states_what_it_was_made_from(
    case: ReportCase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Version, date, and the hash of each file as sha256sum prints it."""
    if case.inverse_map.case == 2:
        pytest.skip("the page lists files alike for both cases, and takes seconds to make")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1735689600")
    (tmp_path / "ogive.toml").write_bytes(b"name = 'ogive'\n")
    save_inverse_map(case.inverse_map, tmp_path / "map.h5")
    files = input_files({"vehicle file": tmp_path / "ogive.toml", "map": tmp_path / "map.h5"})
    made = build_report(case.vehicle, case.snapshots, case.structure, case.inverse_map, files=files)
    rows = [
        (content, name, sha256((tmp_path / name).read_bytes()).hexdigest())
        for content, name in (("vehicle file", "ogive.toml"), ("map", "map.h5"))
    ]
    assert report_tables(made)["made_from"].rows == tuple(rows)
    page = report_page(made)
    assert Paragraph(f"Made by strainfmu {__version__} on 2025-01-01 00:00 UTC.") in page.opening
    assert [section.title for section in page.sections][-2:] == ["Made from", "Numbers"]
    write_numbers(made, tmp_path)
    content = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert content["made"]["version"] == __version__
    assert content["made"]["date"] == "2025-01-01 00:00 UTC"
    assert [tuple(one.values()) for one in content["made"]["files"]] == rows
    with pytest.raises(InputError, match=r"none.toml: cannot be read: No such file"):
        input_files({"vehicle file": tmp_path / "none.toml"})


def test_modes_that_went_are_named_as_in_the_build(report: BuildReport, html: str, tmp_path: Path) -> None:
    """By their numbers in the table of modes, with the lines of the map: a mode has one number everywhere."""
    lines = mode_choice_lines(report.inverse_map.provenance)
    assert bool(lines) == (report.inverse_map.case == 1)
    shown_text = assert_self_contained(html).text
    write_numbers(report, tmp_path)
    content = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert content["mode_choice"] == [f"{line}." for line in lines]
    assert all(line in shown_text for line in lines)
    states = [row[0] for row in report_tables(report)["modes"].rows if row[1]]
    if lines:
        assert states == report.inverse_map.provenance["mode_choice"]["kept"]
        assert f": {states[0]}, " in lines[0]
        fractions = [float(row[3]) for row in report_tables(report)["modes"].rows]
        for line in lines[1:-1]:
            number, percent = re.findall(r"mode (\d+), ([\d.e-]+) % of the variance", line)[0]
            assert float(percent) == pytest.approx(fractions[int(number) - 1], rel=0.06)
    else:
        assert len(states) == len(report_tables(report)["modes"].rows)


def test_tables_say_what_the_map_says(reported: ReportCase, report: BuildReport) -> None:
    """Sigma and range of each coefficient, by source and by group; fractions add up to 100 %; all gauges."""
    tables, one = report_tables(report), reported.inverse_map
    area, length, q = one.reference_area, one.reference_length, one.nominal_dynamic_pressure
    std = np.sqrt(np.diag(load_covariance(one))) / (q * area * np.array([1, 1, 1, length, length]))
    for i, row in enumerate(tables["coefficients"].rows):
        low, high = one.coefficient_range[i]
        assert row[0] == COEFFICIENT_NAMES[i]
        assert row[1:5] == pytest.approx((std[i], low, high, 100.0 * std[i] / (high - low)))
        assert row[8] == pytest.approx(np.sqrt(load_covariance(one)[i, i]))
        largest = max(tables["sources"].rows, key=lambda source, column=3 + i: source[column])
        assert row[5:7] == (largest[0], pytest.approx(largest[3 + i]))
    sources = np.array([row[3:] for row in tables["sources"].rows], dtype=float)
    np.testing.assert_allclose(sources.sum(axis=0), 100.0, rtol=1e-9)
    *groups, total = (np.array(row[1:], dtype=float) for row in tables["source_groups"].rows)
    np.testing.assert_allclose(total, std)
    for (name, *_), sigma in zip(tables["source_groups"].rows, groups, strict=False):
        fractions = sources[[row[1] == name for row in tables["sources"].rows]].sum(axis=0)
        np.testing.assert_allclose(sigma, std * np.sqrt(0.01 * fractions))
    entries = {row[0]: row[2] for row in tables["sources"].rows}
    assert entries["gauge noise"] == "noise.std_um_per_m"
    noise = np.array([row[1] for row in tables["noise"].rows], dtype=float)
    assert noise.sum() == pytest.approx(100.0, rel=1e-9)
    assert [row[0] for row in tables["gauges"].rows] == list(one.gauge_names)
    growth = np.array([row[7:12] for row in tables["gauges"].rows], dtype=float)
    costliest = tables["worst_losses"].rows
    for i in range(5):
        assert costliest[i][2] == pytest.approx(growth[:, i].max())
        assert costliest[i][1] == one.gauge_names[int(growth[:, i].argmax())]
    validity = {row[0]: row[1:] for row in tables["validity"].rows}
    assert validity["Mach number"] == (4.0, 5.0, "1")
    if one.provenance["symmetry"] == "listed":
        assert validity["angle of attack"] == pytest.approx((0.0, 6.0, "deg"))
        assert validity["altitude"] == (22.0, 22.0, "km")
    else:
        assert validity["total incidence, at any roll angle"][1] == pytest.approx(6.706, abs=1e-3)
        assert validity["altitude"] == (0.0, 40.0, "km")


def test_names_of_gauges_are_no_markup(report: BuildReport) -> None:
    """A gauge and a title with tags in their names: escaped on the page."""
    names = ("<b>one</b>", *report.inverse_map.gauge_names[1:])
    named = replace(report, inverse_map=replace(report.inverse_map, gauge_names=names))
    tables = Section("Tables", tuple(report_tables(named).values()))
    page = assert_self_contained(page_html(Page("A & <i>B</i>", (), (tables,))))
    assert not {"b", "i"} & set(page.tags)
    assert page.tables["table-gauges"][1][0] == "<b>one</b>"


def test_a_structure_on_a_free_mesh(parts: Parts) -> None:
    """The same strains on triangles, as of the solid model: classes and sigmas as on the grid, within 0.5 %."""
    # Triangles are not rolled, and have no displaced gauges.
    vehicle, snapshots, fourier = parts
    plain = vehicle.model_copy(update={"noise": vehicle.noise.without_hardware_errors()})
    case = case_of((plain, snapshots, fourier), CASE_1.model_copy(update={"symmetry": "listed"}))
    layout = case.vehicle.gauges.layout
    grid = case.structure.surface
    mesh = mesh_of_grid(grid)
    structure = MappedStructure(
        surface=mesh,
        description="solid",
        layouts=case.structure.layouts,
        operators={layout: case.structure.strain_operator(layout)},
    )
    snapshots = replace(
        case.snapshots,
        point=mesh.point,
        triangle=mesh.triangle,
        station=None,
        radius=None,
        meridian_angle=None,
        pressure=snapshots_on(case.snapshots, grid).pressure,
    )
    inverse_map = build_inverse_map(case.vehicle, snapshots, structure)
    report = build_report(case.vehicle, snapshots, structure, inverse_map)
    expected = build_report(case.vehicle, case.snapshots, case.structure, case.inverse_map)
    np.testing.assert_allclose(
        report.observability.class_fraction, expected.observability.class_fraction, rtol=5e-3, atol=1e-6
    )
    np.testing.assert_allclose(report.observability.removed, expected.observability.removed, rtol=5e-3)
    assert report.blind_classes == expected.blind_classes
    observed = report.observability
    drawn = unrolled_pressure(
        report.surface,
        removed=observed.node_removed,
        mean=observed.node_mean,
        std=observed.node_std,
        inverse_map=report.inverse_map,
    )
    assert picture(drawn, "caption", "words").content.startswith(b"\x89PNG")


def test_a_map_of_something_else_is_refused(case_1: ReportCase) -> None:
    """A map with other noise, and one with other states."""
    case = case_1
    noise = case.vehicle.noise.model_copy(update={"std_um_per_m": 0.4})
    for other in (
        case.vehicle.model_copy(update={"noise": noise}),
        case.vehicle.model_copy(update={"map": MapEntry(modes=2)}),
    ):
        with pytest.raises(InputError, match="was not built from these"):
            build_report(other, case.snapshots, case.structure, case.inverse_map)


def test_nuisance_terms_are_causes(parts: Parts) -> None:
    """Apparent strain of 5 um/m, alike at all gauges, given beside the vehicle file."""
    plain = parts[0].model_copy(update={"noise": parts[0].noise.without_hardware_errors()})
    case = case_of((plain, *parts[1:]), CASE_1)
    n = case.inverse_map.n_gauges
    thermal = (nuisance_modes("thermal strain", np.ones((n, 1)), np.array([5e-6])),)
    warm = build_inverse_map(case.vehicle, case.snapshots, case.structure, thermal)
    report = build_report(case.vehicle, case.snapshots, case.structure, warm, thermal)
    found = report.in_use.coefficients
    assert "thermal strain" in found.names
    terms = report.inverse_map.provenance["noise_terms"]
    assert [term["name"] for term in terms] == [
        "gauge noise",
        "thermal strain",
        "truncated modes",
    ]
    np.testing.assert_allclose(found.variance.sum(axis=0), found.std**2, rtol=1e-9)


def test_a_zero_has_no_sign() -> None:
    assert shown(-1e-9, Column("a", "", ".1f")) == "0.0"
    assert shown(-0.06, Column("a", "", ".1f")) == "-0.1"


def test_what_is_excluded_follows_the_noise_section(parts: Parts) -> None:
    vehicle = parts[0]

    def excluded(**entries: object) -> str:
        noise = vehicle.noise.without_hardware_errors().model_copy(update=entries)
        return " ".join(exclusions(vehicle.model_copy(update={"noise": noise}), "newtonian"))

    assert "noise.gauge_gain_percent is 0" in excluded()
    assert "noise.gauge_gain_percent" not in excluded(gauge_gain_percent=1.0)
    for entry in ("common_gain_percent", "layout_roll_deg", "wall_thickness_percent", "internal_pressure_percent"):
        assert f"noise.{entry} is 0" in excluded()
        assert f"noise.{entry}" not in excluded(**{entry: 1.0})
    assert "or 2 % (noise.dynamic_pressure_percent)" in excluded(dynamic_pressure_percent=2.0)
    assert "noise.apparent_strain_um_per_m is 0" in excluded()
    assert "noise.apparent_strain_um_per_m" not in excluded(nuisance_file="thermal.csv")
    assert "Truncated pressure modes" not in excluded()
    assert "Truncated pressure modes" in excluded(truncated_modes=False)
    assert "newtonian" in excluded()


def test_further_sensors_have_a_table_in_their_units(reported: ReportCase, report: BuildReport) -> None:
    one = reported.inverse_map
    n, scale = one.n_gauges - 2, np.array([4e8, 2e6])
    rows = SensorRows(
        kind=(*(STRAIN,) * n, "pressure", "force"),
        unit=(*("m/m",) * n, "Pa", "N"),
        scale=np.append(np.ones(n), scale),
        largest=np.append(np.ones(n), 0.1 * scale),
        thrust_response=np.zeros(n + 2),
    )
    held = replace(one, sensors=rows)
    assert "sensors" not in report_tables(report)
    tables = report_tables(build_report(reported.vehicle, reported.snapshots, reported.structure, held))
    assert [row[0] for row in tables["gauges"].rows] == list(one.gauge_names[:n])
    assert [row[:3] for row in tables["sensors"].rows] == [
        (one.gauge_names[n], "pressure", "Pa"),
        (one.gauge_names[n + 1], "force", "N"),
    ]
    assert [row[6] for row in tables["sensors"].rows] == pytest.approx((scale * one.noise_std[n:]).tolist())
