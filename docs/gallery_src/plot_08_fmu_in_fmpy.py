"""
The FMU in FMPy
===============

The same map as an FMI 2.0 co-simulation unit, run by FMPy as any other importer would: strains as input
signals, a gauge that breaks on the way.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from fmpy import read_model_description, simulate_fmu

import builder
import strainfmu

vehicle = builder.load_vehicle("coarse.toml")
snapshots = builder.take_snapshots(vehicle)
structure = builder.solve_structure(vehicle)
inverse_map = builder.build_map(vehicle, snapshots=snapshots, structure=structure)

# %%
# The input: strain that goes from one snapshot to another in a second. Gauge 12 reads nothing (NaN) after 0.6
# s.

net = snapshots.pressure - snapshots.internal_pressure[:, None]
strain = net @ structure.strain_operator(vehicle.gauges.layout).T
first, last = 16, 25  # Mach 6, angle of attack 0 and 7.5 deg
time = np.linspace(0.0, 1.0, 101)
ramp = strain[first] + (3.0 * time**2 - 2.0 * time**3)[:, None] * (strain[last] - strain[first])
ramp[time > 0.6, 11] = np.nan
with TemporaryDirectory() as folder:
    map_path, fmu_path = Path(folder) / "map.h5", Path(folder) / "estimator.fmu"
    strainfmu.save_inverse_map(inverse_map, map_path)
    strainfmu.export_estimator(map_path, fmu_path)
    print(f"{fmu_path.name}: {fmu_path.stat().st_size / 1e3:.0f} kB")
    inputs = [v for v in read_model_description(fmu_path).modelVariables if v.causality == "input"]
    signals = np.zeros(
        len(time), dtype=[("time", float)] + [(v.name, bool if v.type == "Boolean" else float) for v in inputs]
    )
    signals["time"], signals["dynamic_pressure"] = time, snapshots.conditions()[first].dynamic_pressure
    for number, column in enumerate(ramp.T, start=1):
        signals[f"strain[{number}]"], signals[f"valid[{number}]"] = column, True
    result = simulate_fmu(
        str(fmu_path),
        stop_time=1.0,
        step_size=0.01,
        output_interval=0.01,
        input=signals,
        output=["C_N", "sigma.C_N", "health.state", "health.valid_gauges"],
    )

# %%

figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, layout="constrained")
top.plot(result["time"], result["C_N"])
top.set_ylabel("C_N")
bottom.step(result["time"], result["health.valid_gauges"], where="post", label="gauges in use")
bottom.set(xlabel="time [s]", ylabel="gauges in use", ylim=(52.5, 54.5))
states = bottom.twinx()
states.step(result["time"], result["health.state"], where="post", color="C1")
states.set_ylabel("health.state (4: DEGRADED)", color="C1")
plt.show()
