"""Estimates of any recording: the log of a bus computed again, and columns of a recorder."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from os import PathLike
from pathlib import Path
from typing import Literal

from strainfmu.can.bus_file import BusDescription, read_bus
from strainfmu.can.log_frames import is_bus_log
from strainfmu.can.options import BridgeOptions
from strainfmu.can.replay import ReplaySummary, estimate_log
from strainfmu.errors import InputError
from strainfmu.recorded.run import EstimationSummary, Progress, estimate_file
from strainfmu.text_cells import DateOrder

File = str | PathLike[str]


def replay(
    log: File,
    fmu: File,
    output: File,
    *,
    bus: File | None = None,
    settings: Sequence[str] = (),
    profile: str | None = None,
    progress: Progress | None = None,
) -> ReplaySummary:
    """Compute the results of a recorded run again, off line, from its time stamps.

    Parameters
    ----------
    log : recording of a bus: BLF, ASC, candump's log or MF4.
    fmu : estimator FMU, or map.
    output : results to write: CSV or HDF5.
    bus, settings, profile : as :func:`bridge` takes them, for a log that no bridge recorded.
    progress : takes how much is done, and how much there is.

    Raises
    ------
    InputError, StrainfmuError
        A file or an entry is wrong.
    """
    described = read_bus(None if bus is None else Path(bus), settings, {"input.profile": profile})
    return _replayed(Path(log), fmu, output, described, progress)


def _replayed(
    log: Path, fmu: File, output: File, described: BusDescription, progress: Progress | None
) -> ReplaySummary:
    """Replay a log; what ``described`` does not state is as in the recorded run."""

    def options(recorded: BridgeOptions | None) -> BridgeOptions:
        return described.options(recorded or BridgeOptions(interface="replay", channel=log.name))

    zeros = described.stated.get("zeros")
    return estimate_log(Path(fmu), log, output=Path(output), options=options, progress=progress, zeros=zeros)


def estimate(
    source: File,
    data: File,
    output: File,
    *,
    dynamic_pressure: float | None = None,
    columns: Literal["plain", "all"] | None = None,
    residuals: bool = False,
    ignore_columns: Sequence[str] = (),
    accept_strain_level: bool = False,
    accept_held: bool = False,
    exclude: Sequence[str] = (),
    field: File | None = None,
    field_every: int | None = None,
    channels: File | None = None,
    date_order: DateOrder | None = None,
    filter_seconds: float | None = None,
    smooth: bool = False,
    zeros: File | None = None,
    bus: File | None = None,
    progress: Progress | None = None,
) -> EstimationSummary | ReplaySummary:
    """Estimate loads from recorded strains: columns of a recorder, or the log of a CAN bus.

    Parameters
    ----------
    source : estimator FMU, or map.
    data : CSV, HDF5, MF4, TDMS, MAT, Parquet, or a CAN log: BLF, ASC, log, MF4.
    output : estimates to write: CSV, HDF5, Parquet or MF4.
    dynamic_pressure : of the whole file [Pa], instead of its column; NaN where it is not known.
    columns : "plain": time, loads, angles in degrees, health in words; None for "plain" in CSV, "all" in others.
    residuals : whether the standardised residual of every gauge is written.
    ignore_columns : names of columns not to read, ``*`` for all unknown ones.
    accept_strain_level, accept_held : whether to estimate strains far from the range of the map, and rows in which
        no gauge changes.
    exclude : gauges to leave out, by name, number or column; "auto" for those that stand still.
    field : surface pressure to write (VTKHDF), of every ``field_every``-th sample.
    channels : which channel of the recorder is which gauge (TOML).
    date_order : what stands first in dates of figures.
    filter_seconds, smooth : time constant of a filter [s], and whether it filters from both ends.
    zeros : zero offsets of the gauges (TOML), subtracted.
    bus : bus file of a CAN log that no bridge recorded. A log takes ``dynamic_pressure`` and ``zeros`` too.
    progress : takes how much is done, and how much there is.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong.
    StrainfmuError
        Something needed is not installed, the FMU failed, or the output cannot be written.
    """
    path = Path(data)
    if is_bus_log(path):
        only_of_columns = {
            "--channels": channels,
            "--filter": filter_seconds,
            "--columns": columns,
            "--residuals": residuals,
            "--ignore-columns": ignore_columns,
            "--accept-strain-level": accept_strain_level,
            "--accept-held": accept_held,
            "--exclude": exclude,
            "--date-order": date_order,
            "--field": field,
        }
        for name, value in only_of_columns.items():
            if value:
                raise InputError(f"{path}: {name}: expected none with a CAN log")
        if dynamic_pressure is not None and isnan(dynamic_pressure):
            raise InputError(f"{path}: --dynamic-pressure: expected a pressure with a CAN log, got nan")
        given = {"input.dynamic_pressure_pa": dynamic_pressure, "zeros.file": zeros and Path(zeros)}
        described = read_bus(None if bus is None else Path(bus), (), given)
        return _replayed(path, source, output, described, progress)
    if bus is not None:
        raise InputError(f"{path}: --bus: expected with a CAN log, got it with columns")
    return estimate_file(
        source,
        path,
        output,
        dynamic_pressure,
        progress,
        residuals=residuals,
        ignore_columns=ignore_columns,
        check_level=not accept_strain_level,
        field_output=field,
        field_every=field_every or 1,
        channels=channels,
        time_constant=filter_seconds,
        smooth=smooth,
        zeros=zeros,
        accept_held=accept_held,
        exclude=exclude,
        columns=columns or ("plain" if Path(output).suffix.lower() == ".csv" else "all"),
        date_order=date_order,
    )
