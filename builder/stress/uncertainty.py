"""Whether stated uncertainties are as large as the errors, on flows of the independent model and on other ones.

Vehicles have installation errors drawn, at conditions between the snapshots'. Flows are

- ``own``: the flows of FLOWS, the vehicle's flow model solved on a finer grid;
- ``newtonian``: modified newtonian theory at the same conditions, another flow model;
- ``drawn``: own flows plus the difference of newtonian flow times a standard normal number.

A map without model-form error, ``map.model_form_percent = 0``, is for own flows alone. The bound is the Cramer-Rao
bound of the tables with installation errors, without errors of the flow.

    python -m builder.stress.uncertainty VEHICLE MAP FLOWS -o uncertainty.json
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from builder.stress.flows import newtonian_flows
from builder.stress.run import vehicle_and_flows
from builder.stress.study import run_study, study_parser
from builder.trial.bound import cramer_rao_bound
from builder.trial.readings import ReadFlights, read_flights
from builder.trial.run import estimates
from builder.trial.score import Score, by_name, score_of
from builder.trial.vehicles import drawn_vehicles
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure, true_structure
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.files import write_bytes_atomically

FLOWS = ("own", "newtonian", "drawn")

AMPLITUDES = 40
"""Numbers that the difference is multiplied by, of drawn flows."""


def uncertainty(
    inverse_map: InverseMap,
    vehicle: Vehicle,
    structure: TrueStructure,
    table: FlowTable,
    *,
    conditions: int,
    vehicles: int,
    seed: int = 1,
) -> Iterator[tuple[str, str, Score]]:
    """Return flows, estimator and score of ``vehicles`` in each of ``conditions``, for all flows and estimators.

    Raises
    ------
    InputError
        ``table`` does not cover the map, or the Fourier model cannot do the vehicle.
    """
    maps = {"linear": inverse_map.without_tables()}
    if inverse_map.manifold is not None:
        maps["nonlinear"] = inverse_map
    for name in FLOWS:
        parts = _tables(name, vehicle, table, np.random.default_rng([seed, 1]))
        each = max(1, conditions // len(parts))
        flown = [
            read_flights(
                inverse_map,
                vehicle,
                part,
                partial(drawn_vehicles, vehicle, structure, part),
                seed=[seed, number],
                vehicles=vehicles,
                conditions=each,
            )
            for number, part in enumerate(parts)
        ]
        for estimator, one in maps.items():
            yield name, estimator, _score(one, inverse_map, flown)


def _tables(name: str, vehicle: Vehicle, own: FlowTable, random: np.random.Generator) -> list[FlowTable]:
    """Return the flows ``name``, one table or one for each amplitude."""
    if name == "own":
        return [own]
    other = newtonian_flows(vehicle, own)
    if name == "newtonian":
        return [other]
    difference = other.harmonic - own.harmonic
    amplitudes = random.standard_normal(AMPLITUDES)
    return [replace(own, harmonic=own.harmonic + one * difference) for one in amplitudes.tolist()]


def _score(used: InverseMap, whole: InverseMap, flown: list[ReadFlights]) -> Score:
    """Return the score of the map ``used``; the bound is the bound of the tables of ``whole``."""
    estimator = Estimator(used)
    found = [estimates(estimator, one) for one in flown]
    truth = np.concatenate([np.repeat(one.coefficients, one.vehicles, axis=0) for one in flown])
    known, vehicles = tuple(flown[0].known), flown[0].vehicles
    bound = cramer_rao_bound(whole, [one for part in flown for one in part.conditions], known)
    return score_of(
        COEFFICIENT_NAMES,
        np.concatenate([one.coefficients for one in found]) - truth,
        np.concatenate([one.std for one in found]),
        truth=truth,
        health=np.concatenate([one.health for one in found]),
        bound=None if bound is None else np.repeat(bound, vehicles, axis=0),
    )


def entry_of(flows: str, estimator: str, score: Score) -> dict[str, Any]:
    """Return the figures of a score by name, as in the file."""
    columns = {
        "rms": score.rms,
        "rms_z": score.rms_z,
        "coverage_1": score.coverage_1,
        "coverage_3": score.coverage_3,
    }
    if score.rms_of_bound is not None:
        columns["rms_over_bound"] = score.rms_of_bound
    return {
        "flows": flows,
        "estimator": estimator,
        "samples": score.samples,
        **{key: by_name(score.names, value) for key, value in columns.items()},
        "undetected_percent": 100.0 * score.undetected,
        "ok_percent": 100.0 * score.healthy,
    }


def line_of(entry: dict[str, Any]) -> str:
    """Return a line of the table: rms of z, smallest coverage at 3 sigma, undetected errors, health OK."""
    z = " ".join(f"{value:5.2f}" for value in entry["rms_z"].values())
    least = 100.0 * min(entry["coverage_3"].values())
    over = " ".join(f"{value:5.2f}" for value in entry.get("rms_over_bound", {}).values())
    name = f"{entry['flows']:10s}{entry['estimator']:10s}"
    return f"{name}{z}  {least:6.2f}{entry['undetected_percent']:7.2f}{entry['ok_percent']:7.1f}  {over}"


def main() -> None:
    """Print the table, and write it with ``-o``."""
    parser = study_parser("uncertainty", __doc__)
    parser.add_argument("--conditions", type=int, default=400)
    parser.add_argument("--vehicles", type=int, default=20, help="vehicles as built at each condition")
    parser.add_argument("-o", "--output", type=Path, help="JSON file with all figures")
    options = parser.parse_args()
    if min(options.conditions, options.vehicles) < 1 or options.seed < 0:
        raise InputError("expected --conditions and --vehicles from 1 on and --seed from 0 on")
    inverse_map = load_inverse_map(options.map)
    vehicle, table = vehicle_and_flows(options.vehicle, inverse_map, options.map, options.flows)
    trial = {"conditions": options.conditions, "vehicles": options.vehicles, "seed": options.seed}
    entries: list[dict[str, Any]] = []
    names = " ".join(f"{name:>5s}" for name in COEFFICIENT_NAMES)
    print(f"{'rms of z [1]':20s}{names}  inside 3 sigma, undetected, OK [%]; rms error over bound")
    for found in uncertainty(inverse_map, vehicle, true_structure(vehicle), table, **trial):
        entries.append(entry_of(*found))
        print(line_of(entries[-1]), flush=True)
    if options.output is not None:
        write_bytes_atomically(options.output, (json.dumps(entries, indent=1) + "\n").encode())


if __name__ == "__main__":
    run_study(main)
