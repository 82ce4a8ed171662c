"""The native run-time through FMPy, as users drive it."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from agreement import assert_same, estimated, random_samples
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from native_case import NativeCase
from raw_fmu import GUID, N_OUTPUTS, REAL_OUTPUTS, WHOLE_OUTPUTS, this_platform

from strainfmu.estimator.estimator import Estimator
from strainfmu.fmu.native.build import PLATFORMS, library_file

pytestmark = pytest.mark.fast

NAME = "Estimator"
NAMES = ("few gauges", "scaled, case 2")
FMI3_FOLDERS = {"linux64": "x86_64-linux", "win64": "x86_64-windows", "darwin64": "x86_64-darwin"}


def unzipped(case: NativeCase, folder: Path) -> Path:
    """A folder that looks like an FMU's to FMPy, for both FMI versions."""
    platform = this_platform()
    for name in {platform, FMI3_FOLDERS.get(platform, platform)}:
        target = folder / "binaries" / name / f"{NAME}{PLATFORMS[platform].suffix}"
        target.parent.mkdir(parents=True)
        shutil.copy(library_file(platform), target)
    shutil.copytree(case.resources, folder / "resources")
    return folder


@pytest.mark.parametrize("name", NAMES)
def test_fmi_2(cases: dict[str, NativeCase], tmp_path: Path, name: str) -> None:
    case = cases[name]
    where, n = unzipped(case, tmp_path / "Jürgen + (1)"), case.n
    fmu = FMU2Slave(guid=GUID, unzipDirectory=str(where), modelIdentifier=NAME, instanceName="one")
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    estimator = Estimator(case.inverse_map)
    for k, sample in enumerate(random_samples(case.inverse_map, 30, seed=5)):
        fmu.setReal(list(range(N_OUTPUTS, N_OUTPUTS + n)), sample.strain.tolist())
        fmu.setBoolean(list(range(N_OUTPUTS + n, N_OUTPUTS + 2 * n)), sample.valid.tolist())
        fmu.setReal([N_OUTPUTS + 2 * n + k for k in range(4)], list(sample.flow))
        fmu.doStep(currentCommunicationPoint=0.01 * k, communicationStepSize=0.01)
        outputs = np.empty(N_OUTPUTS)
        outputs[REAL_OUTPUTS] = fmu.getReal(REAL_OUTPUTS)
        outputs[WHOLE_OUTPUTS] = fmu.getInteger(WHOLE_OUTPUTS)
        assert_same(outputs, estimated(estimator, sample))
    state = fmu.getFMUstate()
    content = fmu.serializeFMUstate(state)
    fmu.setFMUstate(fmu.deSerializeFMUstate(content))
    fmu.freeFMUstate(state)
    gain = fmu.getDirectionalDerivative(list(range(10, 15)), [N_OUTPUTS], [1.0])
    assert len(gain) == 5
    fmu.terminate()
    fmu.freeInstance()


@pytest.mark.parametrize("name", NAMES)
def test_fmi_3(cases: dict[str, NativeCase], tmp_path: Path, name: str) -> None:
    case = cases[name]
    where = unzipped(case, tmp_path / "three")
    fmu = FMU3Slave(guid=GUID, unzipDirectory=str(where), modelIdentifier=NAME, instanceName="one")
    fmu.instantiate()
    fmu.enterInitializationMode(startTime=0.0)
    fmu.exitInitializationMode()
    estimator = Estimator(case.inverse_map)
    for k, sample in enumerate(random_samples(case.inverse_map, 30, seed=6)):
        fmu.setFloat64([13, 15, 16, 17, 18], [*sample.strain, *sample.flow])
        fmu.setBoolean([14], sample.valid.tolist())
        fmu.doStep(currentCommunicationPoint=0.01 * k, communicationStepSize=0.01)
        outputs = np.empty(N_OUTPUTS)
        outputs[REAL_OUTPUTS] = fmu.getFloat64([0, 1, 2, 3, 4, 5, 7, 8, 12], nValues=23)
        outputs[20:21] = fmu.getInt64([6])
        outputs[23:26] = fmu.getInt32([9, 10, 11])
        assert_same(outputs, estimated(estimator, sample))
    state = fmu.getFMUState()
    assert fmu.serializeFMUState(state) == fmu.serializeFMUState(state)
    fmu.freeFMUState(state)
    fmu.terminate()
    fmu.freeInstance()
