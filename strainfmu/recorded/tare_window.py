"""The readings of a window of a recording, and the zeros that follow."""

from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.tare import KnownStrain, Tare, TareLimits, refusal
from strainfmu.recorded.estimators import MapBlocks
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.recorder_errors import disagreements, reading_errors
from strainfmu.recorded.samples import open_recording


def tare(
    inverse_map: str | PathLike[str],
    recording: str | PathLike[str],
    window: tuple[float, float],
    output: str | PathLike[str] = "zeros.toml",
    *,
    channels: str | PathLike[str] | None = None,
    date_order: Literal["day", "month"] | None = None,
    max_dynamic_pressure: float = 100.0,
    largest_zero: float = 2e-3,
    largest_drift: float = 2e-6,
    known: KnownStrain | None = None,
    known_of: Mapping[str, str | float] | None = None,
    accept: bool = False,
) -> Tare:
    """Find the zero offsets of the gauges: mean of a window of a recording, with standard deviations.

    The window has 64 samples or more. The command refuses a window in which the loads are not known: with
    dynamic pressure, with readings that drift or move, or with values too large for zero offsets.

    Own weight and ambient pressure are loads too. State them with ``vehicle``, or every estimate includes them
    with the wrong sign.

    On the command line::

        strainfmu tare map.h5 ground.csv --window 0:10 -o zeros.toml
        strainfmu tare map.h5 ground.tdms --window 5:65 --channels channels.toml --vehicle my_vehicle.toml
            --weight-up-roll-deg 0 --ambient-pressure 101325

    Parameters
    ----------
    inverse_map : inverse map (map.h5).
    recording : CSV, HDF5, MDF, TDMS, MAT, Parquet, as for ``estimate``.
    window : first and last time [s] of the recording in which the loads are known.
    output : zero offsets to write (TOML).
    channels, date_order : as :func:`estimate` takes them.
    max_dynamic_pressure : largest dynamic pressure in the window [Pa].
    largest_zero : largest plausible zero offset [m/m].
    largest_drift : largest drift over the window [m/m].
    known : strain of the loads that act meanwhile, as :func:`builder.known_strain` gives it.
    known_of : what that is made from, for the file.
    accept : write the zero offsets although a check refuses them.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong, or the window leaves the recording or holds too few samples.
    StrainfmuError
        A check refuses them, and the notes of the error say more; the reader of the recording's kind is not
        installed, or there is no compiled estimator.
    """
    loaded, path = load_inverse_map(Path(inverse_map)), Path(recording)
    if not window[0] < window[1]:
        raise InputError(f"window: expected a begin before its end, got {window[0]:g} to {window[1]:g} s")
    limits = TareLimits(dynamic_pressure=max_dynamic_pressure, zero=largest_zero, drift=largest_drift)
    estimator = Estimator(loaded.without_tables())
    wanted = replace(MapBlocks(estimator).wanted, needs_pressure=False, date_order=date_order)
    time, strain, pressure = _read(path, wanted, window, None if channels is None else Path(channels))
    try:
        result = estimator.tare(strain, pressure, limits, known)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    result = replace(result, notes=(*result.notes, *disagreements(reading_errors(time, strain), loaded)))
    against = refusal(result)
    if against and not accept:
        refused = StrainfmuError(f"{recording}: {against}; no zeros written")
        for note in result.notes:
            refused.add_note(note)
        raise refused
    made_from: dict[str, str | float] = {
        "recording": str(recording),
        "from_s": window[0],
        "to_s": window[1],
        "samples": float(result.samples),
        **(known_of or {}),
        **({"accepted": against} if against else {}),
    }
    write_zeros(Path(output), loaded.gauge_names[: loaded.n_strain_gauges], result.zeros, made_from)
    return result


def _read(
    path: Path, wanted: Wanted, window: tuple[float, float], channels: Path | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times (n,), strain (n, n_d) and q_inf (n,) in the window; NaN where there is no q_inf."""
    strains, pressures, times = [np.empty((0, len(wanted.gauge_names)))], [np.empty(0)], [np.empty(0)]
    with open_recording(path, wanted, channels) as recording:
        for block in recording.blocks:
            times.append(block.time)
            inside = (block.time >= window[0]) & (block.time <= window[1])
            strains.append(block.strain[inside])
            pressures.append(block.dynamic_pressure[inside])
            if block.time[-1] > window[1]:
                break
    time = np.concatenate(times)
    # Within a sample's time, which is the median: a recording that paused for long does not reach further.
    reach = 1.5 * float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if len(time) and (window[0] < time[0] - reach or window[1] > time[-1] + reach):
        raise InputError(
            f"{path}: window: expected within the recording, {time[0]:g} to {time[-1]:g} s, got "
            f"{window[0]:g} to {window[1]:g} s"
        )
    inside = (time >= window[0]) & (time <= window[1])
    return time[inside], np.concatenate(strains), np.concatenate(pressures)
