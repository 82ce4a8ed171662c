"""Compatibility information of an FMU, as the FMI project asks exporters to publish it.

A folder with ``{M}.fmu``, ``{M}_in.csv``, ``{M}_ref.csv``, ``{M}_ref.opt`` and ``Readme.txt``, which lists
importers, their versions and results. Source: fmi-standard.org, CONTRIBUTING, "Compatibility Information"; the
file formats follow the FMI Cross-Check rules 4.1.
"""

import os
import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from platform import machine, system

import numpy as np

from strainfmu.cosim.systems.instance import safe_temporary_parent
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically
from strainfmu.fmu.checks.contents import read_fmu
from strainfmu.fmu.checks.importers import IMPORTERS, Table, read_table

RELATIVE_TOLERANCE = 1e-5
"""Of the largest value of a signal: the reference has 6 digits."""

DEFAULT_SOURCE = "the numpy estimator"
"""What computed the reference of an FMU that does not state it."""

_FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
_TIME_LIMIT = 300.0
_FMU_SAYS = re.compile(r"^\[(?:ERROR|FATAL)\] (.*?)(?=^\[[A-Z]+\] |\Z)", re.DOTALL | re.MULTILINE)
"""An FMU's message as fmpy prints it, of one line or several."""
_FOLDER_OF_THE_FMU = re.compile(r"[^\s'\"]+[/\\](?=resources[/\\])")


@dataclass(frozen=True)
class ImporterResult:
    """What one importer did.

    Attributes
    ----------
    importer : its name and version.
    outcome : "passed", "failed" or "not run".
    detail : largest difference, or why.
    """

    importer: str
    outcome: str
    detail: str

    @property
    def line(self) -> str:
        return f"{self.importer:<20} {self.outcome:<8} {self.detail}"


def crosscheck(fmu: str | PathLike[str], output: str | PathLike[str] = "crosscheck") -> list[ImporterResult]:
    """Run an FMU in every importer that is installed; leave input, reference, options and results.

    Importers: fmpy, and ecospy and libcosimpy if they are installed. Ends with exit code 1 if a result differs
    from the reference.

    On the command line::

        strainfmu crosscheck estimator.fmu -o compatibility

    Parameters
    ----------
    fmu : any FMU exported by this program.
    output : folder to write.

    Raises
    ------
    InputError
        The FMU is missing or damaged, or holds no reference run.
    StrainfmuError
        A file could not be written.
    """
    fmu, folder = Path(fmu), Path(output)
    description, contents, files = read_fmu(fmu)
    names = [f"{_FOLDER}/reference_{which}.csv" for which in ("in", "out")]
    missing = [name for name in names if name not in files]
    if missing:
        raise InputError(f"{fmu}: holds no reference run, {missing[0]} is missing")
    with zipfile.ZipFile(fmu) as archive:
        inputs, reference = (archive.read(name) for name in names)
    reference_run = _reference_run(fmu, reference)
    model = re.sub(r"[^\w.-]", "_", description.modelName).lstrip(".")  # never another folder's file
    experiment = description.defaultExperiment
    write_bytes_atomically(folder / f"{model}.fmu", fmu.read_bytes())
    write_bytes_atomically(folder / f"{model}_in.csv", inputs)
    write_bytes_atomically(folder / f"{model}_ref.csv", reference)
    time = [row[0] for row in reference_run["time"]]
    options = {"StartTime": time[0], "StopTime": time[-1], "StepSize": time[1] - time[0]}
    lines = [*(f"{name},{value:g}" for name, value in options.items()), f"RelTol,{RELATIVE_TOLERANCE:g}"]
    write_bytes_atomically(folder / f"{model}_ref.opt", ("\n".join(lines) + "\n").encode())
    results = [
        _result(
            name,
            fmi_version=description.fmiVersion,
            fmu=folder / f"{model}.fmu",
            inputs=folder / f"{model}_in.csv",
            reference=reference_run,
        )
        for name in IMPORTERS
    ]
    tolerance = experiment.tolerance if experiment is not None else None
    source = contents.get("reference", DEFAULT_SOURCE)
    readme = _readme(model=model, description=description, results=results, tolerance=tolerance, source=source)
    write_bytes_atomically(folder / "Readme.txt", readme.encode())
    return results


def _reference_run(fmu: Path, content: bytes) -> Table:
    """Return the table of a reference run: "time" of two points or more, and signals."""
    with tempfile.TemporaryDirectory(prefix="strainfmu_") as folder:
        path = Path(folder) / "reference.csv"
        path.write_bytes(content)
        try:
            table = read_table(path)
            points = len(table["time"])
        except (KeyError, ValueError, IndexError) as error:
            raise InputError(f"{fmu}: damaged, its reference run is not a table with a column 'time'") from error
    if points < 2:
        raise InputError(f"{fmu}: reference run: expected at least 2 points in time, got {points}")
    return table


def check_results(results: Sequence[ImporterResult]) -> None:
    """Raise StrainfmuError if an importer that ran did not agree with the reference."""
    failed = [result.importer for result in results if result.outcome == "failed"]
    if failed:
        raise StrainfmuError(f"cross-check: {', '.join(failed)} failed")


def _result(name: str, *, fmi_version: str, fmu: Path, inputs: Path, reference: Table) -> ImporterResult:
    """Run one importer in a process of its own and compare."""
    package, versions, _ = IMPORTERS[name]
    try:
        importer = f"{name} {version(package)}"
    except PackageNotFoundError:
        return ImporterResult(name, "not run", f"{package} is not installed")
    if fmi_version not in versions:
        return ImporterResult(importer, "not run", f"not driven with FMI {fmi_version}")
    parent = safe_temporary_parent()
    with tempfile.TemporaryDirectory(prefix="strainfmu_", dir=parent) as folder:
        results = Path(folder) / "found.csv"
        # Importers unzip in the folder for temporary files, by whichever name they look it up.
        environment = {**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(parent))}
        command = [sys.executable, "-m", "strainfmu.fmu.checks.importers", name]
        command += [str(path.resolve()) for path in (fmu, inputs, results)]
        try:
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, timeout=_TIME_LIMIT
            )
        except subprocess.TimeoutExpired:
            return ImporterResult(importer, "failed", f"not finished after {_TIME_LIMIT:g} s")
        if not results.exists():
            lacks_library = "cannot open shared object file" in done.stderr
            outcome = "not run" if lacks_library else "failed"
            message = failure_message(done.stdout, done.stderr)
            return ImporterResult(importer, outcome, f"exit code {done.returncode}: {message}")
        deviation, where = largest_deviation(read_table(results), reference)
    outcome = "passed" if deviation <= RELATIVE_TOLERANCE else "failed"
    return ImporterResult(importer, outcome, f"largest difference {deviation:.1e} of the signal's size ({where})")


def failure_message(output: str, errors: str) -> str:
    """Return in one line why an importer failed: the FMU's own last words if it said any, then the importer's."""
    importers = (errors.strip() or "no message").splitlines()[-1]
    said = _FMU_SAYS.findall(output)
    if not said:
        return importers
    words = _FOLDER_OF_THE_FMU.sub("", " ".join(said[-1].split()))
    return f"{words} ({importers})"


def largest_deviation(results: Table, reference: Table) -> tuple[float, str]:
    """Return the largest difference, of the largest value of its signal, and the signal; infinite if one lacks.

    Signals that an importer does not give at all, as enumerations, are not compared; nor are rows it leaves empty.
    """
    worst, where = 0.0, "none"
    for name, expected in reference.items():
        if name == "time" or name not in results:
            continue
        rows = [(a, b) for a, b in zip(results[name], expected, strict=True) if a]
        size = max((abs(v) for cell in expected for v in cell), default=0.0) or 1.0
        errors = [np.max(np.abs(np.subtract(a, b))) for a, b in rows]
        error = float(np.max(errors)) / size if errors else np.inf  # NaN if one is
        if not error <= worst:
            worst, where = (error if np.isfinite(error) else np.inf), name
    compared = sum(name in results for name in reference)
    return (worst, where) if compared > 1 else (np.inf, "no signal in common")


def _readme(
    model: str, description: object, results: Sequence[ImporterResult], tolerance: object, source: str
) -> str:
    """Return what a reader of the folder must know."""
    return "\n".join(
        [
            f"{model}.fmu, FMI {getattr(description, 'fmiVersion', '')} co-simulation",
            f"exported by {getattr(description, 'generationTool', '')}",
            "",
            f"{model}_in.csv    inputs; those that are not in it keep their start values",
            f"{model}_ref.csv   outputs, 6 digits, computed without the FMU by {source}",
            f"{model}_ref.opt   start, stop, step size, and the tolerance of the comparison",
            "",
            "Inputs are set at the start of each step and held; outputs are read at its end. So row k of the",
            "reference belongs to the inputs of row k - 1, row 0 to the inputs of row 0.",
            f"The FMU adapts no step to an error; its default tolerance, {tolerance}, is without effect.",
            "",
            f"Importers, on {system()} {machine()}:",
            *(result.line for result in results),
            "",
        ]
    )
