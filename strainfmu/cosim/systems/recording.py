"""Recording of a co-simulation, on disk and in memory."""

import csv
import io
from dataclasses import dataclass, field
from os import PathLike

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.files import open_hdf5, write_bytes_atomically, write_hdf5_atomically
from strainfmu.records import brief

SCHEMA = "strainfmu.recording"
SCHEMA_VERSION = 1
_SLASH = "%2F"


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals over the communication points of a co-simulation.

    Attributes
    ----------
    time : (n,) communication points, the start included [s].
    names : n_s names ``instance.variable``.
    units : n_s units of ``values``, "" where the FMU declares none.
    values : (n, n_s) in ``units``; Integer, Boolean and Enumeration values as numbers.
    instances : n_i names of the instances, in the order they were stepped.
    step_cost : (n - 1, n_i) wall-clock time of each instance's step: inputs, doStep, outputs [s].
    """

    time: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    instances: tuple[str, ...] = ()
    step_cost: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    __repr__ = brief

    def __getitem__(self, name: str) -> FloatArray:
        """Return the (n,) values of the signal ``name``.

        Raises
        ------
        InputError
            It was not recorded.
        """
        if name not in self.names:
            raise InputError(f"recording: no signal '{name}', it holds {', '.join(self.names[:5])} ...")
        return self.values[:, self.names.index(name)]


def save_hdf5(recording: Recording, path: str | PathLike[str]) -> str:
    """Write ``recording`` as HDF5, one data set per signal with its unit; return the content hash.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """

    def fill(file: h5py.File) -> None:
        file.create_dataset("time", data=recording.time).attrs["unit"] = "s"
        signals = file.create_group("signals", track_order=True)
        for name, unit, column in zip(recording.names, recording.units, recording.values.T, strict=True):
            # A slash, which FMI allows in names, would begin a group.
            signals.create_dataset(name.replace("/", _SLASH), data=column).attrs["unit"] = unit
        costs = file.create_group("step_cost", track_order=True)
        for name, column in zip(recording.instances, recording.step_cost.T, strict=True):
            costs.create_dataset(name, data=column).attrs["unit"] = "s"

    return write_hdf5_atomically(path, SCHEMA, SCHEMA_VERSION, fill)


def load_recording(path: str | PathLike[str]) -> Recording:
    """Read what :func:`save_hdf5` wrote.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.
    """
    with open_hdf5(path, SCHEMA, SCHEMA_VERSION) as file:
        try:
            time = file["time"][()]
            signals, costs = file["signals"], file["step_cost"]
            stored, instances = tuple(signals), tuple(costs)
            values = np.empty((len(time), len(stored)))
            step_cost = np.empty((max(len(time) - 1, 0), len(instances)))
            for column, name in enumerate(stored):
                values[:, column] = signals[name][()]
            for column, name in enumerate(instances):
                step_cost[:, column] = costs[name][()]
            units = tuple(str(signals[name].attrs["unit"]) for name in stored)
        except (KeyError, ValueError) as error:
            raise InputError(f"{path}: damaged, {error}") from error
    names = tuple(name.replace(_SLASH, "/") for name in stored)
    return Recording(time=time, names=names, units=units, values=values, instances=instances, step_cost=step_cost)


def save_csv(recording: Recording, path: str | PathLike[str]) -> None:
    """Write ``recording`` as CSV as the FMI cross-check does: quoted names, ``"time"`` first, no units.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    text = io.StringIO(newline="")
    csv.writer(text, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow(("time", *recording.names))
    rows = csv.writer(text, lineterminator="\n")
    rows.writerows(np.column_stack((recording.time, recording.values)).tolist())
    write_bytes_atomically(path, text.getvalue().encode())
