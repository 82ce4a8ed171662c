"""Steps of bridges and recordings as carriers of streams, by a map or an FMU."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
from estimator_carrier import in_part
from fmu_carriers import LAST_STEP, Places, columns, fields_of
from inputs import Inputs, Results
from recorded_case import write_csv

from strainfmu.cosim.estimators.source import FmuStep, MapStep, open_step
from strainfmu.cosim.estimators.step import other_inputs
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.fmi_variables import COEFFICIENTS
from strainfmu.interface.parameter_variables import PREFIX, STD_PREFIX
from strainfmu.recorded.run import estimate_file


def without_masks(inputs: Inputs) -> Inputs:
    """Return ``inputs`` with NaN for readings that may not be used."""
    return replace(inputs, strain=np.where(inputs.valid, inputs.strain, np.nan))


def by_step(source: Path, inverse_map: InverseMap, inputs: Inputs) -> Results:
    """Return what the step of a bridge gives by the map or FMU at ``source``."""
    inputs = without_masks(inputs)
    given, strain = columns(inverse_map, inputs), inputs.strain[:, : inverse_map.n_strain_gauges]
    pressure, sizes = given["dynamic_pressure"], np.append(np.diff(inputs.time), LAST_STEP)
    with open_step(source) as ready:
        step = ready.step
        assert isinstance(step, MapStep | FmuStep)
        if inputs.zero.size:
            value, std = inputs.zero[:-1].reshape(2, -1)
            step.set_zeros(GaugeZeros(value=value, std=std, common_std=float(inputs.zero[-1])))
        names = [name for name in other_inputs(step) if name in given]
        found = [
            step(strain[k], pressure[k], float(sizes[k]), **{name: float(given[name][k]) for name in names})
            for k in range(len(inputs))
        ]
    own = ("coefficients", "coefficients_std", "health", "chi_square")
    others = {name: np.array([one.other_outputs[name] for one in found]) for name in found[0].other_outputs}
    results = {name: np.array([getattr(one, name) for one in found]) for name in own}
    return in_part(results) | fields_of(Places(inverse_map, arrays=False), others)


def by_recording(source: Path, inverse_map: InverseMap, inputs: Inputs) -> Results:
    """Return what ``strainfmu estimate`` gives of a recording by the map or FMU at ``source``."""
    places = Places(inverse_map, arrays=False)
    given = columns(inverse_map, without_masks(inputs))
    data = {_column(name): values for name, values in given.items() if name in places.inputs}
    folder = source.parent
    write_csv(folder / "recording.csv", ["time", *data], inputs.time, *data.values())
    estimate_file(source, folder / "recording.csv", folder / "estimates.h5")
    with h5py.File(folder / "estimates.h5") as file:
        found = {name: item[()] for name, item in file.items() if item.dtype.kind in "fib"}
    assert set(COEFFICIENTS) <= found.keys()
    return fields_of(places, found)


def _column(name: str) -> str:
    """Return the column of a recording for an input of an FMU."""
    if name.startswith(STD_PREFIX):
        return f"{name.removeprefix(STD_PREFIX)}_std"
    return name.removeprefix(PREFIX)
