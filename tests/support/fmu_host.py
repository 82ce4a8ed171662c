"""Every kind of estimator FMU, and a host that calls FMI 2.0 FMUs by names of variables."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from synthetic_vehicle import N_GAUGES

from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

OPTIONS = {
    "native": ExportOptions(inputs="full", zero_inputs=True),
    "native_3": ExportOptions(inputs="full", fmi_version="3"),
    "python": ExportOptions(inputs="full", kind="python", zero_inputs=True),
}
SCALARS = ExportOptions(inputs="full", fmi_version="3", scalars=True, zero_inputs=True)
"""FMI 3.0 by the names of FMI 2.0, beside the kinds."""


def exported_kinds(inverse_map: InverseMap, folder: Path) -> dict[str, Path]:
    """Return the FMUs of ``inverse_map`` of every kind, made in ``folder``, by the keys of :data:`OPTIONS`."""
    save_inverse_map(inverse_map, folder / "map.h5")
    files = {kind: folder / f"{kind}.fmu" for kind in OPTIONS}
    for kind, options in OPTIONS.items():
        holds = export_estimator(folder / "map.h5", files[kind], options)
        assert holds == ("linear" if inverse_map.manifold is None else "nonlinear")
    return files


STRAINS = [f"strain[{i + 1}]" for i in range(N_GAUGES)]
VALID = [f"valid[{i + 1}]" for i in range(N_GAUGES)]
COEFFICIENTS = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
LOADS = ["force.axial", "force.normal", "force.side", "moment.pitch", "moment.yaw"]


class Host:
    """An FMU with names instead of value references."""

    def __init__(self, fmu: FMU2Slave, references: Mapping[str, int]) -> None:
        self.fmu, self.references = fmu, references

    def get(self, names: Sequence[str]) -> np.ndarray:
        return np.array(self.fmu.getReal([self.references[name] for name in names]))

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        self.fmu.setReal([self.references[name] for name in names], values)

    def set_booleans(self, names: Sequence[str], values: Sequence[bool]) -> None:
        self.fmu.setBoolean([self.references[name] for name in names], list(values))

    def set_integers(self, names: Sequence[str], values: Sequence[int]) -> None:
        self.fmu.setInteger([self.references[name] for name in names], list(values))

    def integers(self, names: Sequence[str]) -> list[int]:
        return list(self.fmu.getInteger([self.references[name] for name in names]))

    def health(self) -> int:
        return self.integers(["health.state"])[0]

    def initialize(self, start_time: float = 0.0) -> None:
        self.fmu.setupExperiment(startTime=start_time)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()


@contextmanager
def loaded(path: Path, folder: Path) -> Iterator[Host]:
    """Instantiate the FMU at ``path``, unzipped to ``folder``."""
    description = fmpy.read_model_description(str(path))
    fmpy.extract(str(path), str(folder))
    fmu = FMU2Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="x",
    )
    fmu.instantiate()
    in_order = sorted(description.modelVariables, key=lambda variable: variable.valueReference)
    yield Host(fmu, {v.name: v.valueReference for v in in_order})
    fmu.terminate()
    fmu.freeInstance()
