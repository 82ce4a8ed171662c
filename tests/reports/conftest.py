"""Maps of both cases of one small vehicle, made once."""

from collections.abc import Iterator

import pytest
from chromium import Browser
from report_case import CASE_1, CASE_2, ReportCase, case_of, solved_vehicle
from sweeps import sweep

from builder.campaign.snapshots import Snapshots
from builder.reports.build_report.build_findings import BuildReport, build_report
from builder.reports.build_report.build_page import report_page
from builder.reports.page.html import Page, page_html
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle

Parts = tuple[Vehicle, Snapshots, StructuralModel]


@pytest.fixture(scope="session")
def parts(tmp_path_factory: pytest.TempPathFactory, compiled_solver: None) -> Parts:
    return solved_vehicle(tmp_path_factory.mktemp("ogive"))


@pytest.fixture(scope="session")
def case_1(parts: Parts) -> ReportCase:
    return case_of(parts, CASE_1)


@pytest.fixture(scope="session")
def case_2(parts: Parts) -> ReportCase:
    return case_of(parts, CASE_2)


@pytest.fixture(scope="session", params=["case_1", "case_2"], ids=["case 1", "case 2"])
def case(request: pytest.FixtureRequest) -> ReportCase:
    found: ReportCase = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A browser for all pages, one after another."""
    running = Browser(tmp_path_factory.mktemp("profile"), "about:blank")
    yield running
    running.close()


@pytest.fixture(scope="session")
def page(report: BuildReport) -> Page:
    """The report's page, its figures drawn."""
    return report_page(report)


@pytest.fixture(scope="session")
def html(page: Page) -> str:
    return page_html(page)


@pytest.fixture(scope="session", params=sweep(["case_1", "case_2"], ["case_2"]))
def reported(request: pytest.FixtureRequest) -> ReportCase:
    """The case of a report, which takes seconds."""
    found: ReportCase = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="session")
def report(reported: ReportCase) -> BuildReport:
    return build_report(reported.vehicle, reported.snapshots, reported.structure, reported.inverse_map)
