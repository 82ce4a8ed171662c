"""A trial of the closed loop: seeds of noise without a fault, then faults of single gauges.

Each flight is a scenario of ``strainfmu fly`` with four FMUs of its own. Without a fault the autopilot gets the
plant's true coefficients, the nonlinear estimator's and the linear estimator's; with a fault it gets the nonlinear
estimator's, and takes suspect gauges out of use.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from builder.reporting import Reporter
from builder.trial.cases import Case, ClosedLoop, LoopFault
from builder.trial.faults import MICRO
from builder.trial.run import labelled
from builder.trial.score import Row
from strainfmu.cosim.flight import FlightResult, flight_result, fly
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.scenario import FaultEvent, Scenario, load_scenario
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.fmu.flight_export import export_flight
from strainfmu.interface.plant_variables import GaugeFault

QUANTITIES = {
    "tracking error, rms": "tracking_error",
    "settled error, largest": "settled_error",
    "angle error, rms": "angle_error",
}
"""Of a flight without a fault: entries of its score [rad] by the name of a row."""


def closed_loop_rows(
    loop: ClosedLoop, scenario_path: Path, map_path: Path | None, only: Sequence[str], reporter: Reporter
) -> tuple[str, list[Row]]:
    """Fly a scenario in all ways of ``loop``, of ``only`` these faults; return its name and the rows.

    Map and flight model are next to the map that is given, or where the scenario says.

    Raises
    ------
    InputError
        A file is missing or wrong, or the map has no tables.
    """
    scenario = load_scenario(scenario_path, map_path and map_path.parent)
    inverse_map = load_inverse_map(scenario.inverse_map)
    if inverse_map.manifold is None:
        raise InputError(f"{scenario.inverse_map}: expected a map with tables, for the nonlinear estimator")
    faults = [fault for fault in loop.fault if not only or fault.error in only]
    with TemporaryDirectory() as scratch, reporter.stage("Closed loop: seeds of noise, faults") as progress:
        linear = replace(scenario, inverse_map=Path(scratch) / "linear.h5")
        save_inverse_map(inverse_map.without_tables(), linear.inverse_map)
        sound = {"truth": scenario, "nonlinear": scenario, "linear": linear}
        flights = [partial(without_fault, flown, feedback, loop) for feedback, flown in sound.items()]
        flights += [partial(with_fault, scenario, fault, loop) for fault in faults]
        rows = list[Row]()
        for number, fly_all in enumerate(flights, start=1):
            rows += fly_all()
            progress(number, len(flights))
    return scenario.name, rows


def flown(scenario: Scenario, feedback: str) -> tuple[FlightResult, set[int]]:
    """Fly a scenario with ``feedback`` of "truth" or of the "estimate"; return the numbers of gauges that were
    taken out of use, too."""
    with TemporaryDirectory() as folder:
        recording = fly(scenario, export_flight(scenario, Path(folder)), feedback)
    model = load_flight_model(scenario.flight_model)
    gauges = range(1, model.n_gauges + 1)
    out_of_use = {gauge for gauge in gauges if not np.all(recording[f"autopilot.valid[{gauge}]"])}
    return flight_result(scenario, recording, model), out_of_use


def without_fault(scenario: Scenario, feedback: str, loop: ClosedLoop) -> list[Row]:
    """Return smallest and largest errors [deg] over the seeds, a row for each quantity."""
    sound, how = replace(scenario, faults=()), "truth" if feedback == "truth" else "estimate"
    results = [flown(replace(sound, noise_seed=seed), how)[0] for seed in range(1, loop.seeds + 1)]
    rows = list[Row]()
    for load, key in QUANTITIES.items():
        values = np.degrees([getattr(result, key) for result in results])
        extremes = {"smallest_deg": float(values.min()), "largest_deg": float(values.max())}
        rows.append({"load": load, "samples": len(results), **extremes})
    return _labelled("no fault", f"feedback of {feedback}", rows)


def with_fault(scenario: Scenario, fault: LoopFault, loop: ClosedLoop) -> list[Row]:
    """Return when the flights of one fault, of every so many-th gauge, reported it and took the gauge out of
    use."""
    gauges = range(1, load_flight_model(scenario.flight_model).n_strain_gauges + 1, loop.every)
    time, kind = loop.fails_at * scenario.stop_time, GaugeFault[fault.kind.upper()]
    events = [FaultEvent(time=time, gauge=gauge, kind=kind, value=MICRO * fault.value) for gauge in gauges]
    flights = [flown(replace(scenario, faults=(event,)), "estimate") for event in events]
    healthy = sum(len(lost - {event.gauge}) for (_, lost), event in zip(flights, events, strict=True))
    row: Row = {
        "load": "flight",
        "samples": len(flights),
        "holds": sum(bool(result.holds) for result, _ in flights),
        **_times("reported", [result.faults[0].reported_after for result, _ in flights]),
        **_times("isolated", [result.faults[0].isolated_after for result, _ in flights]),
        "healthy_out_of_use": healthy,
    }
    return _labelled(fault.error, "feedback of nonlinear", [row])


def _labelled(error: str, estimator: str, rows: list[Row]) -> list[Row]:
    return labelled(Case.model_validate({"error": error, "class": "unobservable"}), estimator, rows)


def _times(name: str, after: Sequence[float | None]) -> Row:
    """Return quickest, median and slowest time [ms], and how many never were."""
    known = [1e3 * time for time in after if time is not None] or [float("nan")]
    times = {"first": min(known), "median": float(np.median(known)), "last": max(known)}
    never = sum(time is None for time in after)
    return {**{f"{name}_{which}_ms": time for which, time in times.items()}, f"{name}_never": never}
