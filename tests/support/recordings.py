"""One flight recorded by many programs, in formats, units and clocks of their own, each with its channels.toml."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from recorded_case import NAMES, samples

GAUGE_FACTOR = 2.08
N = 60
ZERO = 150e-6
"""Strain of every gauge at the beginning, which the channels have and the estimates must not."""


def flown() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (n,) [s], strains (n, n_d) [m/m] and q_inf (n,) [Pa]."""
    time, strain, _ = samples(N)
    return time, strain, np.linspace(9e4, 9.2e4, N)  # a straight line, which interpolation gives again


def quarter_ratio(strain: np.ndarray) -> np.ndarray:
    """Return the output of a quarter bridge [mV/V]: that of a divider whose one arm has changed."""
    arm = 1.0 + GAUGE_FACTOR * strain
    return 1e3 * (arm / (1.0 + arm) - 0.5)


def channels_toml(folder: Path, entries: str, names: list[str], **more: str) -> Path:
    """Write a channels.toml with ``names`` for the gauges in turn; ``entries`` stand ahead."""
    text = entries + "".join(
        f"\n[[channel]]\nname = '{name}'\ngauge = '{gauge}'\n{more.get(gauge, '')}\n"
        for name, gauge in zip(names, NAMES, strict=True)
    )
    path = folder / "channels.toml"
    path.write_text(text, encoding="utf-8")
    return path


FLOW = "\n[[flow]]\nname = 'q'\nquantity = 'dynamic_pressure'\nunit = 'kPa'\n"
PORTS = [f"AI0/ch{i}" for i in range(len(NAMES))]
Files = tuple[Path, Path]


def csv_by_hand(folder: Path) -> Files:
    """Semicolons, decimal commas, header block, row of units, Latin-1."""
    time, strain, pressure = flown()
    lines = ["Messung;7", "Kanalzahl;8", "", ";".join(["Zeit", *PORTS, "q"])]
    lines += [";".join(["ms", *["µm/m"] * len(NAMES), "kPa"])]
    table = np.column_stack([1e3 * time, 1e6 * (strain + ZERO), 1e-3 * pressure])
    lines += [";".join(repr(float(v)) for v in row).replace(".", ",") for row in table]
    path = folder / "d.csv"
    path.write_bytes("\r\n".join(lines).encode("latin-1"))
    return path, channels_toml(folder, f"time.channel = 'zeit'\ndefaults.zero = 150\n{FLOW}", PORTS)


def csv_pandas(folder: Path) -> Files:
    """Data frame with an index of dates and times, UTF-16, m/m."""
    pandas = __import__("pandas")
    time, strain, pressure = flown()
    index = pandas.Timestamp("2026-03-01T12:00:00Z") + pandas.to_timedelta(time, unit="s")
    frame = pandas.DataFrame(strain + ZERO, index=index, columns=PORTS)
    frame["q"] = 1e-3 * pressure
    frame.to_csv(folder / "d.csv", encoding="utf-16", index_label="Stamp", sep="\t")
    head = f"time.channel = 'STAMP'\n[defaults]\nunit = 'm/m'\nzero = {ZERO}\n{FLOW}"
    return folder / "d.csv", channels_toml(folder, head, PORTS)


def csv_mach(folder: Path) -> Files:
    """No dynamic pressure: Mach number and static pressure in psf; signs turned."""
    pandas = __import__("pandas")
    time, strain, pressure = flown()
    frame = pandas.DataFrame(-1e3 * (strain + ZERO), columns=[f" ai0 / CH{i}" for i in range(len(NAMES))])
    frame.insert(0, "t", time)
    frame["Ma"] = 6.0
    frame["Ps"] = pressure / (0.7 * 36.0) / 47.88025898033584
    frame.to_csv(folder / "d.csv", index=False)
    head = f"[defaults]\nunit = 'mm/m'\nsign = -1\nzero = {-1e3 * ZERO}\n"
    head += "[[flow]]\nname = 'MA'\nquantity = 'mach_number'\n"
    head += "[[flow]]\nname = 'ps'\nquantity = 'static_pressure'\nunit = 'psf'\n"
    return folder / "d.csv", channels_toml(folder, head, PORTS)


BRIDGE = f"[defaults]\nunit = 'mV/V'\ngauge_factor = {GAUGE_FACTOR}\n"


def _bridge_zeros() -> dict[str, str]:
    zero = float(quarter_ratio(np.array(ZERO)))
    return dict.fromkeys(NAMES, f"zero = {zero!r}\ntemperature_compensation = 'self'")


def _bridge(strain: np.ndarray) -> np.ndarray:
    """Return the output of quarter bridges [mV/V] with a zero of their own."""
    return quarter_ratio(strain) + quarter_ratio(np.array(ZERO))


def tdms_waveform(folder: Path) -> Files:
    """Quarter bridges in mV/V, times by the waveform; q at a fifth of the rate, straight between its samples."""
    nptdms = __import__("nptdms")
    _, strain, pressure = flown()
    start = np.datetime64("2026-03-01T12:00:00")
    objects = [
        nptdms.ChannelObject(
            "AI0",
            f"ch{i}",
            values,
            {"wf_increment": 1e-3, "wf_start_time": start, "wf_start_offset": 0.0, "unit_string": "mV/V"},
        )
        for i, values in enumerate(_bridge(strain).T)
    ]
    slow = {"wf_increment": 5e-3, "wf_start_time": start, "wf_start_offset": 0.0, "unit_string": "kPa"}
    slow_pressure = 1e-3 * (pressure[0] + (pressure[1] - pressure[0]) * np.arange(0.0, N + 1.0, 5.0))
    objects.append(nptdms.ChannelObject("air", "q", slow_pressure, slow))
    with nptdms.TdmsWriter(folder / "d.tdms") as writer:
        writer.write_segment(objects)
    return folder / "d.tdms", channels_toml(folder, BRIDGE + FLOW, PORTS, **_bridge_zeros())


def tdms_time(folder: Path) -> Files:
    """A channel of time in ms, volts with a scale."""
    nptdms = __import__("nptdms")
    time, strain, pressure = flown()
    channels = {
        "Time": 1e3 * time,
        **dict(zip(PORTS, 1e6 * (strain + ZERO).T / 400.0, strict=True)),
        "q": 1e-3 * pressure,
    }
    with nptdms.TdmsWriter(folder / "d.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("g", name, values) for name, values in channels.items()])
    head = f"time.unit = 'ms'\n[defaults]\nunit = 'V'\nscale_um_per_m_per_V = 400\nzero = {1e6 * ZERO / 400.0}\n"
    return folder / "d.tdms", channels_toml(folder, head + FLOW, PORTS)


def hdf5_groups(folder: Path) -> Files:
    """Data sets in groups with units as attributes."""
    time, strain, pressure = flown()
    with h5py.File(folder / "d.h5", "w") as file:
        file["run1/time"] = time
        for name, values in zip(PORTS, 1e6 * (strain + ZERO).T, strict=True):
            file[f"run1/{name}"] = values
            file[f"run1/{name}"].attrs["unit"] = "um/m"
        file["run1/q"] = 1e-3 * pressure
    return folder / "d.h5", channels_toml(folder, f"[defaults]\nzero = 150\n{FLOW}", PORTS)


def hdf5_matrix(folder: Path) -> Files:
    """One matrix, volts of quarter bridges behind an amplifier, a rate in place of times."""
    _, strain, pressure = flown()
    with h5py.File(folder / "d.hdf5", "w") as file:
        file["data"] = np.column_stack([1e-3 * 5.0 * 200.0 * _bridge(strain), 1e-3 * pressure])
    zero = 5.0 * 200.0 * 1e-3 * float(quarter_ratio(np.array(ZERO)))
    head = (
        "time.rate_hz = 1000\n" + BRIDGE.replace("mV/V", "V") + f"excitation_V = 5\ngain = 200\nzero = {zero!r}\n"
    )
    names = [f"data[{i}]" for i in range(1, len(NAMES) + 1)]
    return folder / "d.hdf5", channels_toml(folder, head + FLOW.replace("'q'", f"'data[{len(NAMES) + 1}]'"), names)


def mat_old(folder: Path) -> Files:
    """scipy's writer: a structure, percent."""
    time, strain, pressure = flown()
    fields = {f"ch{i}": values for i, values in enumerate(100.0 * (strain + ZERO).T)}
    savemat = __import__("scipy.io").io.savemat
    savemat(folder / "d.mat", {"t": time, "AI0": fields, "q": 1e-3 * pressure, "comment": "a flight"})
    names = [f"AI0.ch{i}" for i in range(len(NAMES))]
    return folder / "d.mat", channels_toml(folder, f"[defaults]\nunit = '%'\nzero = {100.0 * ZERO}\n{FLOW}", names)


def mat_new(folder: Path) -> Files:
    """Version 7.3 as MATLAB lays it out: columns as rows; a recorder set to a gauge factor of 2."""
    time, strain, pressure = flown()
    with h5py.File(folder / "d.mat", "w", userblock_size=512) as file:
        for name, values in (
            ("t", time),
            ("strain", 1e6 * (strain + ZERO) * GAUGE_FACTOR / 2.0),
            ("q", 1e-3 * pressure),
        ):
            file[name] = np.atleast_2d(values.T)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["comment"] = np.atleast_2d(np.frombuffer(b"a flight", np.uint8).astype(np.uint16))
        file["comment"].attrs["MATLAB_class"] = np.bytes_("char")
    with (folder / "d.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(512))
    zero = 150.0 * GAUGE_FACTOR / 2.0
    head = (
        f"[defaults]\nunit = 'um/m'\nzero = {zero}\ngauge_factor = {GAUGE_FACTOR}\nrecorder_gauge_factor = 2.0\n"
    )
    names = [f"strain[{i}]" for i in range(1, len(NAMES) + 1)]
    return folder / "d.mat", channels_toml(folder, head + FLOW, names)


def parquet_pandas(folder: Path) -> Files:
    """pandas' data frame with dates and times; q where it was sampled, every fifth row, else nothing."""
    pandas = __import__("pandas")
    time, strain, pressure = flown()
    frame = pandas.DataFrame(1e6 * (strain + ZERO), columns=[f"{port} [um/m]" for port in PORTS])
    frame["time"] = pandas.Timestamp("2026-03-01") + pandas.to_timedelta(time, unit="s")
    is_sampled = (np.arange(N) % 5 == 0) | (np.arange(N) == N - 1)
    frame["q"] = np.where(is_sampled, 1e-3 * pressure, np.nan)
    frame.to_parquet(folder / "d.parquet")
    return folder / "d.parquet", channels_toml(folder, f"[defaults]\nzero = 150\n{FLOW}", PORTS)


def parquet_arrow(folder: Path) -> Files:
    """pyarrow's own writer, units in the metadata of the columns."""
    arrow = __import__("pyarrow")
    parquet = __import__("pyarrow.parquet").parquet
    time, strain, pressure = flown()
    columns = {"t": (1e6 * time, "us"), "q": (1e-3 * pressure, "kPa")}
    columns |= {port: (1e3 * (strain[:, i] + ZERO), "mm/m") for i, port in enumerate(PORTS)}
    schema = arrow.schema([arrow.field(n, arrow.float64(), metadata={"unit": u}) for n, (_, u) in columns.items()])
    parquet.write_table(arrow.table([v for v, _ in columns.values()], schema=schema), folder / "d.parquet")
    return folder / "d.parquet", channels_toml(folder, f"[defaults]\nzero = 0.15\n{FLOW}", PORTS)


def mf4_rasters(folder: Path) -> Files:
    """asammdf's writer: quarter bridges with two lead wires; q on a raster of its own."""
    asammdf = __import__("asammdf")
    time, strain, pressure = flown()
    mdf = asammdf.MDF(version="4.10")
    signal = quarter_ratio(strain * 350.0 / 353.0) + quarter_ratio(np.array(ZERO))
    mdf.append([asammdf.Signal(v, time, name=n, unit="mV/V") for n, v in zip(PORTS, signal.T, strict=True)])
    slow_time = np.append(time[::5], time[-1])
    mdf.append([asammdf.Signal(1e-3 * np.interp(slow_time, time, pressure), slow_time, name="q", unit="kPa")])
    mdf.save(folder / "d.mf4")
    mdf.close()
    head = BRIDGE + "wires = 2\nlead_resistance_ohm = 1.5\ngauge_resistance_ohm = 350\n" + FLOW
    return folder / "d.mf4", channels_toml(folder, head, PORTS, **_bridge_zeros())


RECORDINGS: dict[str, Callable[[Path], Files]] = {
    writer.__name__: writer
    for writer in (
        *(csv_by_hand, csv_pandas, csv_mach, tdms_waveform, tdms_time, hdf5_groups, hdf5_matrix),
        *(mat_old, mat_new, parquet_pandas, parquet_arrow, mf4_rasters),
    )
}
