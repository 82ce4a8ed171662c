"""A ground test that is simulated: a vehicle as built reads loads that are not quite as they are stated.

The vehicle is a structure of its own, finer than the map's. What the recorder writes is a recording, a
channels.toml and a loadtest.toml, as a test brings them home.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.calibration.ground_test.candidate_cases import LoadLimits, PlannedCase, known_loads
from builder.calibration.ground_test.load_changes import cell_force, elsewhere, scaled
from builder.calibration.ground_test.load_test import KnownLoad, LoadErrors
from builder.calibration.ground_test.load_test_file import WrittenCase, WrittenStep, error_entries, write_load_test
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.displaced_structure import AnyAsBuilt
from builder.structure.loads.applied import Load, PadForce, Weight
from strainfmu.arrays import FloatArray
from strainfmu.files import write_bytes_atomically

SAMPLE_RATE = 25.0
"""Samples per second [Hz]."""

WINDOW, BETWEEN = 25, 10
"""Samples of a case while the load stands, and until the next one stands."""

CHANNELS_PER_CARD = 16


@dataclass(frozen=True, kw_only=True)
class CellErrors:
    """Errors of a load cell: relative gain [1], and reading without load [N]."""

    gain: float = 0.0
    offset: float = 0.0


def as_applied(known: KnownLoad, errors: LoadErrors, cell: CellErrors, random: np.random.Generator) -> Load:
    """Return a load with drawn errors; ``cell`` holds the errors of its load cell."""
    size, along, around, longer, first, second = random.standard_normal(6).tolist()
    factor, force = 1.0 + known.std * size, cell_force(known.load)
    if known.on_load_cell:
        factor = factor * (1.0 + cell.gain) + (cell.offset / force if force > 0.0 else 0.0)
    error = [errors.pad_position * along, errors.pad_roll * around, errors.pad_shape * max(longer, -3.0)]
    return elsewhere(scaled(known.load, factor), np.array([*error, errors.tilt * first, errors.tilt * second]))


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedStep:
    """A step of a case: part of its loads [1], and readings (n_samples, n_d) while it stood [m/m]."""

    part: float
    unloading: bool
    strain: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class GroundTest:
    """A simulated test.

    Attributes
    ----------
    gauge_names : n_d names.
    cases : as stated.
    errors : how exactly the loads are known.
    strain : (n_cases, n_samples, n_d) readings while each load stood [m/m].
    steps : of each case, in the order of time; none by default.
    checks : names of the cases that are check loads.
    """

    gauge_names: tuple[str, ...]
    cases: tuple[PlannedCase, ...]
    errors: LoadErrors
    strain: FloatArray
    steps: tuple[tuple[SimulatedStep, ...], ...] = ()
    checks: tuple[str, ...] = ()


def simulate_ground_test(
    structure: AnyAsBuilt,
    parameters: AsBuilt,
    cases: Sequence[PlannedCase],
    errors: LoadErrors,
    noise_std: FloatArray,
    *,
    random: np.random.Generator,
    loading: Sequence[float] = (),
    checks: Sequence[str] = (),
) -> GroundTest:
    """Apply ``cases`` to a vehicle as built and read its gauges.

    Parameters
    ----------
    structure, parameters : the vehicle.
    errors : standard deviations that the errors of the loads are drawn with.
    noise_std : (n_d,) of one sample [m/m].
    loading : parts of the loads that are read on the way to them, and in reverse on the way back [1].
    checks : names of the cases that are check loads.
    """
    gain, offset = random.standard_normal(2).tolist()
    cell = CellErrors(gain=errors.common * gain, offset=errors.cell_offset * offset)
    parts = [(part, False) for part in loading] + [(part, True) for part in reversed(loading)]
    acting, noise, parts_of_case = list[list[Load]](), list[FloatArray](), []
    for case in cases:
        stated = known_loads(case, errors)
        loads = [as_applied(known, errors, cell, random) for known in stated]
        parts_of_case.append(parts if any(known.on_load_cell for known in stated) else [])
        for part in (1.0, *(part for part, _ in parts_of_case[-1])):
            of_part = zip(stated, loads, strict=True)
            acting.append([scaled(load, part) if known.on_load_cell else load for known, load in of_part])
            noise.append(noise_std * random.standard_normal((WINDOW, len(noise_std))))
    structure.solve_for([load for loads in acting for load in loads])
    readings = (
        structure.reading(parameters, loads) + of_loads for loads, of_loads in zip(acting, noise, strict=True)
    )
    strain, steps = [], []
    for of_case in parts_of_case:
        strain.append(next(readings))
        steps.append(
            tuple(
                SimulatedStep(part=part, unloading=unloading, strain=next(readings)) for part, unloading in of_case
            )
        )
    return GroundTest(
        gauge_names=structure.gauges.names,
        cases=tuple(cases),
        errors=errors,
        strain=np.array(strain),
        steps=tuple(steps),
        checks=tuple(checks),
    )


def write_ground_test(test: GroundTest, folder: Path, name: str, vehicle: str | None = None) -> Path:
    """Write ``loadtest.toml``, ``channels.toml`` and ``loadtest.csv`` into ``folder``; return the first's path.

    ``vehicle`` is the path of the vehicle file from there.
    """
    channels = [f"AI{k // CHANNELS_PER_CARD}/ch{k % CHANNELS_PER_CARD}" for k in range(len(test.gauge_names))]
    steps = test.steps or ((),) * len(test.cases)
    time, rows, window = _recording(test.strain, steps)
    lines = [",".join(["Time", *channels]), ",".join(["s", *["um/m"] * len(channels)])]
    lines += [
        f"{t:.2f}," + ",".join(f"{1e6 * value:.4f}" for value in row) for t, row in zip(time, rows, strict=True)
    ]
    write_bytes_atomically(folder / "loadtest.csv", ("\n".join(lines) + "\n").encode())
    entries = ["time.channel = 'Time'", "[defaults]", "unit = 'um/m'"]
    for channel, gauge in zip(channels, test.gauge_names, strict=True):
        entries += ["", "[[channel]]", f"name = '{channel}'", f"gauge = '{gauge}'"]
    write_bytes_atomically(folder / "channels.toml", ("\n".join(entries) + "\n").encode())
    written = [
        WrittenCase(
            name=case.name,
            loads=case.loads,
            window=next(window_of_case),
            check=case.name in test.checks,
            steps=tuple(
                WrittenStep(part=step.part, unloading=step.unloading, window=next(window_of_case))
                for step in of_case
            ),
        )
        for case, of_case, window_of_case in zip(test.cases, steps, map(iter, window), strict=True)
    ]
    path = folder / "loadtest.toml"
    readings = {"recording": "loadtest.csv", "channels": "channels.toml"}
    write_load_test(path, name, written, readings, error_entries(test.errors), vehicle=vehicle)
    return path


def _recording(
    strain: FloatArray, steps: Sequence[Sequence[SimulatedStep]]
) -> tuple[FloatArray, FloatArray, list[list[tuple[float, float]]]]:
    """Return times (n,) [s] and readings (n, n_d) of the whole test, and of each case the first and last time [s]
    of its own reading and of its steps."""
    parts, first, windows = list[FloatArray](), 0, [[(0.0, 0.0)] * (1 + len(of_case)) for of_case in steps]
    for case, of_case in enumerate(steps):
        own = sum(not step.unloading for step in of_case)
        readings = [(1 + n, step.strain) for n, step in enumerate(of_case)]
        for number, reading in (*readings[:own], (0, strain[case]), *readings[own:]):
            if parts:
                share = (np.arange(BETWEEN) + 1.0)[:, None] / (BETWEEN + 1.0)
                before = parts[-1][:BETWEEN]
                parts.append(before + share * (reading[:BETWEEN] - before))
                first += BETWEEN
            parts.append(reading)
            last = first + len(reading) - 1
            windows[case][number] = _rounded(first / SAMPLE_RATE), _rounded(last / SAMPLE_RATE)
            first = last + 1
    rows = np.concatenate(parts)
    return np.arange(len(rows)) / SAMPLE_RATE, rows, windows


def _rounded(value: float) -> float:
    return float(f"{value:.9g}")


STANDARD_STATIONS = (0.14, 0.28, 0.43, 0.67, 0.86)
"""Of the pads, over the length of the body."""

PUSH = 1000.0
"""Force of a pad at the foremost station [N]; the aft half of the body takes twice as much."""

STANDARD_ROLL_ANGLES = (0.0, 90.0, 180.0, 270.0, 45.0, 135.0, 225.0, 315.0)
"""In the order in which pads are added [deg]."""


def pads(count: int, length: float) -> list[PadForce]:
    """Return the first ``count`` pads that press inwards on a body of ``length`` [m].

    Pairs of stations and planes come first, so that few pads see the whole body already.
    """
    order = [(2, 0), (0, 1), (4, 1), (0, 0), (4, 0), (2, 1), (1, 0), (3, 1), (1, 1), (3, 0)]
    order += [(k, turn) for turn in (2, 3, 4, 5, 6, 7) for k in (2, 0, 4, 1, 3)]
    forces = []
    for station, turn in order[:count]:
        roll = float(np.deg2rad(STANDARD_ROLL_ANGLES[turn]))
        push = PUSH * (1.0 if station < 3 else 2.0)
        force = (0.0, -push * float(np.sin(roll)), -push * float(np.cos(roll)))
        forces.append(
            PadForce(
                station=STANDARD_STATIONS[station] * length,
                roll_angle=roll,
                half_length=LoadLimits.half_length,
                half_angle=LoadLimits.half_angle,
                force=force,
            )
        )
    return forces


def standard_load_cases(count: int, length: float, weighs: bool = True) -> list[PlannedCase]:
    """Return ``count`` pads, the vehicle upright, and own weight in four attitudes; where the vehicle ``weighs``
    nothing, no load and the pads."""
    upright = (Weight(),) if weighs else ()
    named: list[tuple[str, tuple[Load, ...]]]
    named = [(f"pad {number}", (pad, *upright)) for number, pad in enumerate(pads(count, length), start=1)]
    of_weight = [
        (f"attitude {number}", (Weight(up_roll_angle=float(np.deg2rad(roll))),))
        for number, roll in enumerate(STANDARD_ROLL_ANGLES[:4], start=1)
    ]
    named = [*named, *of_weight] if weighs else [("no load", ()), *named]
    return [PlannedCase(name=name, loads=loads) for name, loads in named]
