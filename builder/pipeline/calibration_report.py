"""The report of a calibration as files: a page, the same as PDF, and the load equations as CSV."""

from collections.abc import Mapping
from pathlib import Path

from builder.calibration.after_test.calibrated_map import calibrated_structure
from builder.calibration.estimate.case_faults import Fault
from builder.calibration.estimate.check_loads import check_loads, cross_validation
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.load_steps import stepped_cases
from builder.calibration.estimate.outside_terms import OutsideModel
from builder.calibration.estimate.regression import load_equations
from builder.calibration.ground_test.load_entries import NO_LOAD_CELL
from builder.calibration.ground_test.load_test_file import LoadTestFile
from builder.calibration.plan.load_plan import PlanParts
from builder.calibration.plan.worth_of_test import worth_of_test
from builder.campaign.snapshots import Snapshots
from builder.reports.calibration_page.ground_test_page import calibration_page
from builder.reports.calibration_page.ground_test_tables import equations_table
from builder.reports.calibration_page.verdict import CalibrationFindings, UsedCell
from builder.reports.page.html import without_packages, write_page
from builder.reports.page.origin import input_files, origin_of
from builder.reports.page.page_tables import table_csv
from builder.structure.as_built.displaced_structure import AnyAsBuilt
from builder.vehicle.file import Vehicle
from strainfmu.files import write_bytes_atomically

PAGE, PDF, EQUATIONS = ".html", ".pdf", "_load_equations.csv"
"""Ends of the names of the report's files next to the map."""


def report_files(output: Path) -> tuple[Path, Path, Path]:
    """Return where page, PDF and load equations of a calibrated map are written."""
    return output.with_suffix(PAGE), output.with_suffix(PDF), output.with_name(f"{output.stem}{EQUATIONS}")


def calibration_findings(
    estimate: Estimate,
    faults: tuple[Fault, ...],
    outside: OutsideModel,
    *,
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyAsBuilt,
    file: LoadTestFile,
    files: Mapping[str, Path],
    accepted: str = "",
) -> CalibrationFindings:
    """Return what the report of a calibration is made from.

    Parameters
    ----------
    file : of the test.
    files : that the calibration was made from, by what they are; recordings and channels follow from ``file``.

    Raises
    ------
    InputError
        A file cannot be read.
    """
    station = vehicle.reference.moment_station_m
    equations = load_equations(estimate, station)
    nominal = calibrated_structure(structure, structure.exactly_built(), vehicle.gauges.layout, {})
    parts = PlanParts(vehicle=vehicle, snapshots=snapshots, structure=nominal, as_built=structure)
    return CalibrationFindings(
        title=f"{vehicle.name}: calibration by the ground test '{file.name}'",
        estimate=estimate,
        faults=faults,
        outside=outside,
        left_out=tuple(cross_validation(estimate)),
        equations=tuple(equations),
        checks=tuple(check_loads(estimate, equations, station)),
        steps=tuple(stepped_cases(estimate.model.test)),
        worth=worth_of_test(parts, estimate),
        origin=origin_of(input_files({**files, **recorded_files(file)})),
        tested_on="" if file.tested_on is None else file.tested_on.isoformat(),
        cells=used_cells(file),
        accepted=accepted,
    )


def recorded_files(file: LoadTestFile) -> dict[str, Path]:
    """Return the file of a test, its recordings and their channels, by what they are."""
    files = {"file of the test": file.path}
    names = [(case.recording or file.readings.recording, "recording") for case in file.case]
    names += [(file.readings.channels, "channels of the recording")]
    names += [(case.channels, "channels of the recording") for case in file.case]
    distinct = [entry for entry in dict.fromkeys(names) if entry[0] is not None]
    for name, what in distinct:
        files[f"{what} {name}"] = file.beside(str(name))
    return files


def used_cells(file: LoadTestFile) -> tuple[UsedCell, ...]:
    """Return the load cells that the file states or its loads name."""
    read = [load.load_cell for case in file.case for load in case.load if load.kind not in NO_LOAD_CELL]
    stated = {cell.name: cell for cell in file.load_cell}
    cells = []
    for name in dict.fromkeys([*stated, *read]):
        cell = stated.get(name)
        on = None if cell is None else cell.calibrated_on
        cells.append(
            UsedCell(
                name=name,
                serial_number="" if cell is None else cell.serial_number or "",
                calibrated_on="" if on is None else on.isoformat(),
                loads=read.count(name),
            )
        )
    return tuple(cells)


def write_report(findings: CalibrationFindings, output: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write the report next to the map at ``output``; return its files, and lines for the user.

    Raises
    ------
    StrainfmuError
        A file could not be written.
    """
    page_path, pdf_path, equations_path = report_files(output)
    page = calibration_page(findings)
    write_page(page, page_path)
    table = equations_table(findings.estimate, findings.equations)
    write_bytes_atomically(equations_path, table_csv(table).encode("utf-8"))
    line = without_packages(page_path.name)
    if line:
        return (page_path, equations_path), (line,)
    from builder.reports.page.pdf import write_pdf

    write_pdf(page, pdf_path)
    return (page_path, pdf_path, equations_path), ()
