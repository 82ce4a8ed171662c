"""From loads applied and readings, without a model, to load equations and their map: ``strainfmu equations``."""

from dataclasses import dataclass
from pathlib import Path

from builder.calibration.after_test.equations_map import FittedEquations, equations_map, fit_equations
from builder.calibration.ground_test.equations_file import applied_test, equations_file
from builder.pipeline.calibrate import check_output
from builder.pipeline.calibration_report import report_files
from builder.reports.calibration_page.equations_page import (
    equations_page,
    equations_table_of,
    redundancy_line,
    verdict_lines,
)
from builder.reports.page.html import without_packages, write_page
from builder.reports.page.origin import input_files, origin_of
from builder.reports.page.page_tables import table_csv
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.files import write_bytes_atomically


@dataclass(frozen=True, eq=False, kw_only=True)
class Equations:
    """Load equations, their map, the files that were written, and lines for the user."""

    found: FittedEquations
    inverse_map: InverseMap
    files: tuple[Path, ...]
    lines: tuple[str, ...]


def equations(test: str | Path, output: str | Path = "equations.h5", *, accept: bool = False) -> Equations:
    """Fit load equations to applied loads and readings, and make their map. No model is needed.

    Each load is a sum of gauge readings by least squares over the rows of a table: all gauges, gauges chosen by
    their T values, or a ridge. Rows without load are the zeros, marked rows are predicted and not fitted.

    The map estimates the same loads as the equations, in FMUs, recordings and on the bus. Redundant gauges check
    each other; a report and the coefficients with their standard errors are written next to the map (.html, .pdf,
    .csv).

    On the command line::

        strainfmu equations wing_test.toml -o wing.h5

    Parameters
    ----------
    test : file of the test without a model.
    output : the map.
    accept : write the map although the equations do not predict the loads.

    Raises
    ------
    InputError
        The file, its table, or the name of the map is wrong.
    StrainfmuError
        The equations do not predict the loads, and that is not accepted; the report is written.
    """
    test, output = Path(test), Path(output)
    check_output(output)
    file = equations_file(test)
    fitted = fit_equations(applied_test(file))
    made = equations_map(fitted)
    page_path, pdf_path, csv_path = report_files(output)
    page = equations_page(
        fitted, origin_of(input_files({"file": file.path, "table": file.beside(file.readings.table)}))
    )
    write_page(page, page_path)
    write_bytes_atomically(csv_path, table_csv(equations_table_of(fitted)).encode("utf-8"))
    files, line = [page_path, csv_path], without_packages(page_path.name)
    if not line:
        from builder.reports.page.pdf import write_pdf

        write_pdf(page, pdf_path)
        files.append(pdf_path)
    good, reasons = verdict_lines(fitted)
    if not good and not accept:
        raise StrainfmuError(
            f"{test}: {'; '.join(reasons)}; see {page_path.name}; no map written, --accept writes it"
        )
    save_inverse_map(made, output)
    lines = (*reasons, redundancy_line(fitted), *([line] if line else []))
    return Equations(found=fitted, inverse_map=made, files=(output, *files), lines=lines)
