"""An FMU in initialization mode: which of its first outputs depend on which variable."""

from __future__ import annotations

from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave


class Starting:
    """An FMU in initialization mode, whose inputs and parameters can be set and outputs read."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        description = fmpy.read_model_description(str(fmu))
        self.variables = {v.name: v for v in description.modelVariables}
        self.stated = {u.variable.name: {k.name for k in u.dependencies} for u in description.initialUnknowns}
        fmpy.extract(str(fmu), str(folder))
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def set(self, name: str, value: float) -> None:
        variable = self.variables[name]
        reference = [variable.valueReference]
        if variable.type == "Real":
            self.fmu.setReal(reference, [value])
        elif variable.type == "Boolean":
            self.fmu.setBoolean(reference, [bool(value)])
        else:
            self.fmu.setInteger(reference, [int(value)])

    def outputs(self) -> dict[str, float]:
        values = {}
        for name in self.stated:
            variable = self.variables[name]
            kind = {"Real": self.fmu.getReal, "Boolean": self.fmu.getBoolean}.get(
                variable.type, self.fmu.getInteger
            )
            values[name] = float(kind([variable.valueReference])[0])
        return values

    def changed_by(self, name: str, values: tuple[float, ...], start: float) -> set[str]:
        """The outputs that another value of a variable changes."""
        before, changed = self.outputs(), set()
        for value in values:
            self.set(name, value)
            after = self.outputs()
            changed |= {output for output in after if not _equal(before[output], after[output])}
        self.set(name, start)
        return changed


def _equal(first: float, second: float) -> bool:
    return first == second or (np.isnan(first) and np.isnan(second))
