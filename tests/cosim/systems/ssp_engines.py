"""Fly an SSP package in another engine: ``python ssp_engines.py TASK``, a JSON object; signals go to .npy."""

import ctypes
import json
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

NANOSECONDS = 1e9


def fly_ecos(task: dict[str, Any]) -> list[list[float]]:
    """The signals by ecos."""
    beside = Path(sys.prefix, "lib", "libtbb.so.12")
    if beside.exists():
        ctypes.CDLL(str(beside), mode=ctypes.RTLD_GLOBAL)
    from ecospy import EcosSimulation

    names = [name.replace(".", "::", 1) for name, _ in task["signals"]]
    rows = []
    with EcosSimulation(task["step"], ssp_path=task["ssp"]) as simulation:
        simulation.init()
        for _ in range(task["steps"]):
            simulation.step()
            rows.append([simulation.get_real(name) for name in names])
        simulation.terminate()
    return rows


def fly_libcosim(task: dict[str, Any]) -> list[list[float]]:
    """The signals by libcosim, which reads unzipped packages."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    folder = Path(task["folder"], "unzipped")
    with zipfile.ZipFile(task["ssp"]) as archive:
        archive.extractall(folder)
    execution = CosimExecution.from_ssp_file(str(folder), task["step"] * NANOSECONDS)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    signals = [
        (execution.slave_index_from_instance_name(name.partition(".")[0]), reference)
        for name, reference in task["signals"]
    ]
    rows = []
    for _ in range(task["steps"]):
        assert execution.step()
        rows.append([observer.last_real_values(slave, [reference])[0] for slave, reference in signals])
    return rows


if __name__ == "__main__":
    wanted = json.loads(sys.argv[1])
    found = {"ecos": fly_ecos, "libcosim": fly_libcosim}[wanted["engine"]](wanted)
    np.save(wanted["output"], np.array(found))
