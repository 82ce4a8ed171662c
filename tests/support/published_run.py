"""The run that an estimator FMU publishes, read from its files alone, and what must hold of it."""

import csv
import io
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strainfmu.estimator.health import HealthState
from strainfmu.fmu.reference_run.run import TRUTH, array_elements
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
LARGEST_ERROR = 4.0
"""Standard deviations that the error of a coefficient may have anywhere in the run."""

LARGEST_RATES = {"mach_number": 0.05, "altitude": 200.0, "dynamic_pressure": 0.05}
"""Per second, what a vehicle can fly: [1], [m], of itself."""


@dataclass(frozen=True)
class PublishedRun:
    """Columns by the names of FMI 2.0, and the page."""

    inputs: dict[str, np.ndarray]
    outputs: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]
    page: str


def columns(content: bytes) -> dict[str, np.ndarray]:
    """Columns of a table; arrays, whose elements are separated by blanks, element by element."""
    names, *rows = csv.reader(io.StringIO(content.decode()))
    table = {}
    for name, column in zip(names, zip(*rows, strict=True), strict=True):
        values = np.array([cell.split() for cell in column], dtype=float)
        array = Variable(name=name, description="", causality="output", dimension=values.shape[1])
        elements = array_elements(array) if is_array(name, values.shape[1]) else (name,)
        table |= dict(zip(elements, values.T, strict=True))
    return table


def is_array(name: str, size: int) -> bool:
    return size > 1 or name in ("strain", "temperature")


def published_run(fmu: Path) -> PublishedRun:
    """Return the run of an estimator FMU."""
    with zipfile.ZipFile(fmu) as archive:
        inputs, outputs, truth = (
            columns(archive.read(name))
            for name in (f"{FOLDER}/reference_in.csv", f"{FOLDER}/reference_out.csv", TRUTH)
        )
        return PublishedRun(inputs, outputs, truth, archive.read("documentation/index.html").decode())


def check_published_run(fmu: Path, *, has_air_data: bool) -> PublishedRun:
    """Assert that the run of ``fmu`` shows the estimator at work, in a flight that a vehicle can fly."""
    run = published_run(fmu)
    _check_flight(run, has_air_data)
    state, suspect, n = run.outputs["health.state"], run.outputs["health.suspect_gauge"], len(run.truth["time"])
    # One fault: it begins after mid-run, lasts at most 30 % of it, and ends.
    bad = np.flatnonzero(state != HealthState.OK)
    assert bad[0] > n // 2
    assert bad[-1] < n - 1
    assert len(bad) == bad[-1] - bad[0] + 1
    assert len(bad) <= 0.3 * n
    is_suspicious = np.isin(state, [HealthState.INCONSISTENT, HealthState.SUSPECT])
    assert is_suspicious.sum() >= 5
    assert len(set(suspect[is_suspicious])) == 1
    assert suspect[is_suspicious][0] > 0.0
    assert set(suspect[~is_suspicious]) == {0.0}
    # What is neither is the return of the nonlinear estimator to its tables.
    assert set(state[bad][is_suspicious[bad].argmin() :]) <= {HealthState.DEGRADED, *state[is_suspicious]}
    worst = 0.0
    for name in COEFFICIENTS:
        error = np.abs(run.outputs[name] - run.truth[name]) / run.outputs[f"sigma.{name}"]
        assert np.all(error[state == HealthState.OK] < LARGEST_ERROR), name
        worst = max(worst, float(error[state == HealthState.OK].max()))
    assert np.ptp(run.outputs["C_N"]) > 5.0 * np.median(run.outputs["sigma.C_N"])
    _check_page(run, is_suspicious, worst)
    return run


def _check_flight(run: PublishedRun, has_air_data: bool) -> None:
    """It is one that a vehicle can fly: slow changes of speed, height and attitude."""
    step = run.truth["time"][1]
    rates = {
        name: np.abs(np.diff(run.inputs[name])) / step
        for name in ("mach_number", "altitude")
        if name in run.inputs
    }
    assert len(rates) == (2 if has_air_data else 0)
    pressure = run.inputs["dynamic_pressure"]
    rates["dynamic_pressure"] = np.abs(np.diff(np.log(pressure))) / step
    angle = run.truth.get("air_data.angle_of_attack")
    if angle is not None:
        assert np.degrees(np.ptp(angle)) > 1.0
        assert np.degrees(np.abs(np.diff(angle))).max() / step < 5.0
    for name, rate in rates.items():
        assert rate.max() <= LARGEST_RATES[name], name
    for name in COEFFICIENTS:
        assert np.abs(np.diff(run.truth[name])).max() < 0.3 * np.ptp(run.truth[name]) + 1e-12, name


def _check_page(run: PublishedRun, is_suspicious: np.ndarray, worst: float) -> None:
    """The text of the page is that of the files."""
    text = re.sub(r"<[^>]+>", " ", run.page)
    time, gauge = run.truth["time"], int(run.outputs["health.suspect_gauge"].max())
    n_good, n_ok = (~is_suspicious).sum(), (run.outputs["health.state"] == HealthState.OK).sum()
    first, last = time[np.flatnonzero(is_suspicious)[[0, -1]]]
    states = ", ".join(
        HealthState(int(state)).name for state in sorted(set(run.outputs["health.state"][is_suspicious]))
    )
    for words in (
        f"From {first:g} to {last:g} s (shaded)",
        f"number {gauge}, reads",
        f"health.state is then {states}, and health.suspect_gauge {gauge}.",
        f"In {n_ok} of the {n_good} samples",
        f"is {worst:.1f} sigma",
    ):
        assert words in text, words
    figure = run.page[run.page.index("<svg") : run.page.index("</svg>")]
    for words in (*COEFFICIENTS, "true", "reading", "OK", states):
        assert f">{words}" in figure, words
