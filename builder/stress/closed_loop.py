"""The closed loop in many flights: seeds of noise without a fault, then every third gauge failing in each way.

Each flight is a scenario of ``strainfmu fly`` with four FMUs of its own. Without a fault the autopilot gets the
plant's true coefficients, the nonlinear estimator's and the linear estimator's; with a fault it gets the nonlinear
estimator's, and takes suspect gauges out of use.

    python -m builder.stress.closed_loop builder/vehicles/ic3x_flight.toml --files demo
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from strainfmu.cosim.flight import FaultReport, FlightResult, flight_result, fly
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.scenario import FaultEvent, Scenario, load_scenario
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.fmu.flight_export import export_flight
from strainfmu.interface.plant_variables import GaugeFault

SEEDS = range(1, 6)

EVERY = 3
"""Gauges whose faults are flown: every third one, from the first."""

FAILS_AT = 10.0
"""Time of a fault [s]."""

FAULTS = {
    "dropout": (GaugeFault.DROPOUT, 0.0),
    "bias of 10 um/m": (GaugeFault.BIAS, 10e-6),
    "bias of 3 um/m": (GaugeFault.BIAS, 3e-6),
    "drift of 100 um/m per s": (GaugeFault.DRIFT, 100e-6),
    "stuck at 200 um/m": (GaugeFault.STUCK, 200e-6),
    "stuck at 0": (GaugeFault.STUCK, 0.0),
}
"""Kind and value [m/m, m/m per s] by name."""


@dataclass(frozen=True)
class Flown:
    """One flight: its score, and the numbers of the gauges that were taken out of use."""

    score: FlightResult
    out_of_use: tuple[int, ...]


def flown(scenario: Scenario, feedback: str) -> Flown:
    """Fly a scenario with ``feedback`` of "truth" or of the "estimate"."""
    with TemporaryDirectory() as folder:
        recording = fly(scenario, export_flight(scenario, Path(folder)), feedback)
    model = load_flight_model(scenario.flight_model)
    gauges = range(1, model.n_gauges + 1)
    out_of_use = tuple(gauge for gauge in gauges if not np.all(recording[f"autopilot.valid[{gauge}]"]))
    return Flown(flight_result(scenario, recording, model), out_of_use)


def without_fault(scenario: Scenario, linear_map: Path) -> dict[str, list[FlightResult]]:
    """Return the scores of every feedback over :data:`SEEDS`, by its name."""
    found: dict[str, list[FlightResult]] = {}
    for seed in SEEDS:
        sound = replace(scenario, noise_seed=seed, faults=())
        for name, feedback, of_map in (
            ("feedback of truth", "truth", sound.inverse_map),
            ("nonlinear estimator", "estimate", sound.inverse_map),
            ("linear estimator", "estimate", linear_map),
        ):
            score = flown(replace(sound, inverse_map=of_map), feedback).score
            found.setdefault(name, []).append(score)
    return found


def with_faults(scenario: Scenario) -> Iterator[tuple[str, list[Flown]]]:
    """Yield the flights of each of :data:`FAULTS`, one flight for each gauge."""
    gauges = range(1, load_flight_model(scenario.flight_model).n_strain_gauges + 1, EVERY)
    for name, (kind, value) in FAULTS.items():
        events = [FaultEvent(time=FAILS_AT, gauge=gauge, kind=kind, value=value) for gauge in gauges]
        yield name, [flown(replace(scenario, faults=(event,)), "estimate") for event in events]


def lines_of_seeds(found: dict[str, list[FlightResult]]) -> list[str]:
    """Return the table of flights without a fault: smallest and largest of the seeds [deg]."""

    def pair(values: list[float]) -> str:
        low, high = np.rad2deg([min(values), max(values)])
        return f"{low:7.3f} to {high:6.3f}"

    lines = [f"{'deg':22s}{'tracking error, rms':>20s}{'largest settled':>20s}{'inferred angle, rms':>22s}"]
    for name, results in found.items():
        parts = (
            [getattr(one, key) for one in results] for key in ("tracking_error", "settled_error", "angle_error")
        )
        lines.append(f"{name:22s}" + "".join(f"{pair(part):>20s}" for part in parts))
    return lines


def line_of_fault(name: str, flights: Sequence[Flown]) -> str:
    """Return when the flights of one fault reported it and took the gauge out of use."""
    reports = [one.score.faults[0] for one in flights]
    holds = sum(one.score.holds for one in flights)
    healthy = sum(len(set(one.out_of_use) - {one.score.faults[0].event.gauge}) for one in flights)
    return (
        f"{name:26s}holds in {holds} of {len(flights)}; reported after {_times(reports, 'reported_after')}; "
        f"isolated after {_times(reports, 'isolated_after')}; healthy gauges out of use: {healthy}"
    )


def _times(reports: Sequence[FaultReport], key: str) -> str:
    """Return quickest, median and slowest time [ms], and how many never were."""
    times = [1e3 * time for one in reports if (time := getattr(one, key)) is not None]
    never = len(reports) - len(times)
    text = f"{min(times):.0f}, {np.median(times):.0f}, {max(times):.0f} ms" if times else "-"
    return f"{text} ({never} never)" if never else text


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(
        prog="python -m builder.stress.closed_loop",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scenario", type=Path, help="scenario file of strainfmu fly")
    parser.add_argument("--files", type=Path, help="folder of map.h5 and flight_model.h5; default: the scenario's")
    options = parser.parse_args()
    scenario = load_scenario(options.scenario, options.files)
    inverse_map = load_inverse_map(scenario.inverse_map)
    if inverse_map.manifold is None:
        raise InputError(f"{scenario.inverse_map}: expected a map with tables, for the nonlinear estimator")
    with TemporaryDirectory() as folder:
        linear_map = Path(folder) / "linear.h5"
        save_inverse_map(inverse_map.without_tables(), linear_map)
        print("\n".join(lines_of_seeds(without_fault(scenario, linear_map))), flush=True)
    for name, flights in with_faults(scenario):
        print(line_of_fault(name, flights), flush=True)


if __name__ == "__main__":
    try:
        main()
    except StrainfmuError as error:
        sys.exit(f"strainfmu: {error}")
