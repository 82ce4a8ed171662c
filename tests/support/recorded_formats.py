"""One recording in every format: groups of columns with names, units and times of their own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from recorder_files import lvm

Columns = Mapping[str, tuple[np.ndarray, str]]
"""Values and unit by name."""


@dataclass(frozen=True, eq=False)
class Group:
    """Columns with common times [s]."""

    name: str
    time: np.ndarray
    columns: Columns


Groups = Sequence[Group]
Writer = Callable[[Path, Groups], Path]


def _text(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value))


def csv_file(folder: Path, groups: Groups) -> Path:
    """One group as a table; of several each has a numbered column of times, as recorders write them."""
    headings, columns = list[str](), list[np.ndarray]()
    for number, group in enumerate(groups, start=1):
        headings.append("time" if len(groups) == 1 else f"Time  {number} - {group.name} [s]")
        columns.append(group.time)
        headings += [f"{name} [{unit}]" if unit else name for name, (_, unit) in group.columns.items()]
        columns += [values for values, _ in group.columns.values()]
    rows = [
        ",".join(_text(values[k]) if k < len(values) else "" for values in columns)
        for k in range(max(map(len, columns)))
    ]
    path = folder / "r.csv"
    path.write_text("\n".join([",".join(headings), *rows]) + "\n", encoding="utf-8")
    return path


def lvm_file(folder: Path, groups: Groups, x_columns: str = "Multi") -> Path:
    channels = [
        (name, unit, group.time, values) for group in groups for name, (values, unit) in group.columns.items()
    ]
    path = folder / "r.lvm"
    path.write_text(lvm([("12:00:00", channels)], x_columns).replace("nan", ""), encoding="utf-8")
    return path


def hdf5_file(folder: Path, groups: Groups) -> Path:
    path = folder / "r.h5"
    with h5py.File(path, "w") as file:
        for group in groups:
            file[f"{group.name}/time"] = group.time
            for name, (values, unit) in group.columns.items():
                file[f"{group.name}/{name}"] = values
                if unit:
                    file[f"{group.name}/{name}"].attrs["unit"] = unit
    return path


def mat_file(folder: Path, groups: Groups) -> Path:
    """Units have no place."""
    scipy_io = pytest.importorskip("scipy.io")
    structures: dict[str, Any] = {
        group.name: {"time": group.time, **{name: values for name, (values, _) in group.columns.items()}}
        for group in groups
    }
    scipy_io.savemat(folder / "r.mat", structures)
    return folder / "r.mat"


def parquet_file(folder: Path, groups: Groups) -> Path:
    """One group."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    (group,) = groups
    table = {"time": group.time, **{name: values for name, (values, _) in group.columns.items()}}
    units = {"time": "s", **{name: unit for name, (_, unit) in group.columns.items()}}
    fields = [
        arrow.field(name, arrow.float64(), metadata={"unit": units[name]} if units[name] else None)
        for name in table
    ]
    parquet.write_table(arrow.table(list(table.values()), schema=arrow.schema(fields)), folder / "r.parquet")
    return folder / "r.parquet"


def mf4_file(folder: Path, groups: Groups) -> Path:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF() as file:
        for group in groups:
            file.append(
                [
                    asammdf.Signal(values, group.time, name=name, unit=unit)
                    for name, (values, unit) in group.columns.items()
                ]
            )
        file.save(folder / "r.mf4", overwrite=True)
    return folder / "r.mf4"


def tdms_file(folder: Path, groups: Groups) -> Path:
    nptdms = pytest.importorskip("nptdms")
    channels = []
    for group in groups:
        channels.append(nptdms.ChannelObject(group.name, "time", group.time))
        channels += [
            nptdms.ChannelObject(group.name, name, values, {"unit_string": unit} if unit else {})
            for name, (values, unit) in group.columns.items()
        ]
    with nptdms.TdmsWriter(folder / "r.tdms") as file:
        file.write_segment(channels)
    return folder / "r.tdms"


def uff_set(name: str, time: np.ndarray, values: np.ndarray, unit: str, **more: object) -> dict[str, object]:
    """A data set 58 of double precision over even times."""
    texts = ("id2", "id3", "id4", "id5", "rsp_ent_name", "ref_ent_name")
    numbers = ("orddenom_spec_data_type", "z_axis_spec_data_type", "func_id", "load_case_id")
    return {
        **dict.fromkeys(texts, "NONE"),
        **dict.fromkeys(numbers, 0),
        **dict.fromkeys(("rsp_node", "rsp_dir", "ref_node", "ref_dir"), 1),
        "type": 58,
        "binary": 0,
        "func_type": 1,
        "id1": name,
        "data": values,
        "x": time,
        "ord_data_type": 4,
        "abscissa_spacing": 1,
        "abscissa_min": time[0],
        "abscissa_inc": time[1] - time[0],
        "abscissa_spec_data_type": 17,
        "ordinate_axis_units_lab": unit or "NONE",
        **more,
    }


def uff_file(folder: Path, groups: Groups) -> Path:
    pyuff = pytest.importorskip("pyuff")
    sets = [
        uff_set(name, group.time, values, unit)
        for group in groups
        for name, (values, unit) in group.columns.items()
    ]
    pyuff.UFF(str(folder / "r.uff")).write_sets(sets, mode="overwrite")
    return folder / "r.uff"


WRITERS: dict[str, Writer] = {
    "csv": csv_file,
    "lvm": lvm_file,
    "hdf5": hdf5_file,
    "mat": mat_file,
    "parquet": parquet_file,
    "mf4": mf4_file,
    "tdms": tdms_file,
    "uff": uff_file,
}
