"""Estimates of any recording: of the columns of a recorder, or of the log of a bus, which is computed again."""

from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Any, Literal

from strainfmu.can.bus_file import read_bus
from strainfmu.can.log_frames import is_bus_log
from strainfmu.can.replay import ReplaySummary, replay_described
from strainfmu.errors import InputError
from strainfmu.recorded.run import File, Progress, estimate_file
from strainfmu.recorded.summary import EstimationSummary


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
    date_order: Literal["day", "month"] | None = None,
    filter_seconds: float | None = None,
    smooth: bool = False,
    zeros: File | None = None,
    bus: File | None = None,
    progress: Progress | None = None,
) -> EstimationSummary | ReplaySummary:
    """Estimate loads from recorded strains.

    Columns have the names of the gauges or strain[1] .., with the unit in brackets: 'strain[1] [um/m]'.
    Without a unit they are in m/m, Pa, m and s. Other names and units stand in a channel file: ``channels``.

    Other columns: dynamic_pressure, dynamic_pressure_std, mach_number, altitude. HDF5: data sets strain (n,
    n_d), time, dynamic_pressure .. with the attribute unit.

    A CAN log takes ``bus``, ``dynamic_pressure`` and ``zeros`` alone.

    On the command line::

        strainfmu estimate map.h5 flight.csv -o loads.csv
        strainfmu estimate estimator.fmu flight.h5 -o loads.h5 --dynamic-pressure 95800
        strainfmu estimate map.h5 flight.csv -o loads.csv --residuals --ignore-columns 'temperature*,operator'
        strainfmu estimate map.h5 flight.csv -o loads.csv --exclude axial_180deg_7,'strain[12]'
        strainfmu estimate map.h5 recorder.tdms -o loads.csv --channels channels.toml
        strainfmu estimate map.h5 flight.csv -o loads.parquet --report flight.html
        strainfmu estimate map.h5 flight.csv -o loads.h5 --filter 10 --smooth
        strainfmu estimate estimator.fmu run.blf -o loads.h5
        strainfmu estimate map.h5 flight.csv -o loads.h5 --field pressure.vtkhdf --field-every 10
        strainfmu estimate map.h5 flights/ -o loads.parquet --workers 2

    Parameters
    ----------
    source : estimator FMU, or inverse map.
    data : CSV, HDF5, MF4, TDMS, MAT, Parquet, or a CAN log: BLF, ASC, log, MF4; on the command line also a
        folder.
    output : estimates to write: CSV, HDF5, Parquet or MF4.
    dynamic_pressure : dynamic pressure of the whole file [Pa], instead of its column; nan: not known.
    columns : "plain": time, loads, angles in degrees, health in words. Default: plain for CSV, all for others.
    residuals : write the standardised residual of every gauge.
    ignore_columns : columns not to read; ``*`` for all unknown ones.
    accept_strain_level : estimate although the strains are far from the range of the map.
    accept_held : estimate rows in which no gauge changes; they are INVALID otherwise.
    exclude : gauges to leave out, by name, number or column; "auto": gauges that stand still.
    field : write the surface pressure, for ParaView. The map needs keep_field = true.
    field_every : with ``field``: write every N-th sample.
    channels : which channel of the recorder is which gauge, and its unit or bridge.
    date_order : what stands first in dates of figures, such as 03/04/2026.
    filter_seconds : average each sample with those before, over this time at most [s].
    smooth : with ``filter_seconds``: filter from both ends.
    zeros : zero offsets of the gauges, of 'strainfmu tare'; subtracted.
    bus : bus file of a CAN log that strainfmu did not record.
    progress : takes how much is done, and how much there is.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong.
    StrainfmuError
        Something needed is not installed, the FMU failed, or the output cannot be written.
    """
    path = Path(data)
    options: dict[str, Any] = {
        "channels": channels,
        "filter_seconds": filter_seconds,
        "columns": columns,
        "residuals": residuals,
        "ignore_columns": ignore_columns,
        "accept_strain_level": accept_strain_level,
        "accept_held": accept_held,
        "exclude": exclude,
        "date_order": date_order,
        "field": field,
        "smooth": smooth,
    }
    if is_bus_log(path):
        for name, value in options.items():
            if value:
                option = "filter" if name == "filter_seconds" else name.replace("_", "-")
                raise InputError(f"{path}: --{option}: expected none with a CAN log")
        if dynamic_pressure is not None and isnan(dynamic_pressure):
            raise InputError(f"{path}: --dynamic-pressure: expected a pressure with a CAN log, got nan")
        option_values = {"input.dynamic_pressure_pa": dynamic_pressure, "zeros.file": zeros and Path(zeros)}
        described = read_bus(None if bus is None else Path(bus), (), option_values)
        return replay_described(path, source, output, described, progress)
    if bus is not None:
        raise InputError(f"{path}: --bus: expected with a CAN log, got it with columns")
    options["columns"] = columns or ("plain" if Path(output).suffix.lower() == ".csv" else "all")
    options |= {"field_every": field_every or 1, "zeros": zeros}
    return estimate_file(source, path, output, dynamic_pressure, progress, **options)
