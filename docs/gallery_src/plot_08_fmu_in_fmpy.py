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
# The input: strain that goes from one snapshot to another in a second, and the flight condition of both. Gauge 12
# reads nothing (NaN) after 0.6 s. Inputs that are not known keep the start values that the FMU states.

net = snapshots.pressure - snapshots.internal_pressure[:, None]
strain = net @ structure.strain_operator(vehicle.gauges.layout).T
first, last = 16, 25  # Mach 6, angle of attack 0 and 7.5 deg
time = np.linspace(0.0, 1.0, 101)
part = 3.0 * time**2 - 2.0 * time**3
ramp = strain[first] + part[:, None] * (strain[last] - strain[first])
ramp[time > 0.6, 11] = np.nan
flight = snapshots.conditions()[first]
known = {f"strain[{number}]": column for number, column in enumerate(ramp.T, start=1)}
known |= {
    "dynamic_pressure": flight.dynamic_pressure,
    "mach_number": flight.mach_number,
    "altitude": flight.altitude,
}
with TemporaryDirectory() as folder:
    map_path, fmu_path = Path(folder) / "map.h5", Path(folder) / "estimator.fmu"
    strainfmu.save_inverse_map(inverse_map, map_path)
    strainfmu.export_estimator(map_path, fmu_path)
    print(f"{fmu_path.name}: {fmu_path.stat().st_size / 1e3:.0f} kB")
    inputs = [v for v in read_model_description(fmu_path).modelVariables if v.causality == "input"]
    types = [(v.name, bool if v.type == "Boolean" else float) for v in inputs]
    signals = np.zeros(len(time), dtype=[("time", float), *types])
    signals["time"] = time
    for v in inputs:
        start = v.start == "true" if v.type == "Boolean" else float(v.start)
        signals[v.name] = known.get(v.name, start)
    result = simulate_fmu(
        str(fmu_path),
        stop_time=1.0,
        step_size=0.01,
        output_interval=0.01,
        input=signals,
        output=["C_N", "sigma.C_N", "health.state", "health.valid_gauges"],
    )

# %%
# Without the gauge the estimate stays right and health is DEGRADED: sigma has grown, by little. An importer holds
# inputs over a step, so the estimate lags by one.

c_n = snapshots.coefficients()[:, 1]
truth = c_n[first] + part * (c_n[last] - c_n[first])
states = sorted(set(result["health.state"].tolist()))
figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, layout="constrained")
value, band = result["C_N"], 3.0 * result["sigma.C_N"]
top.fill_between(result["time"], value - band, value + band, color="C0", alpha=0.25, lw=0, label="3 sigma")
top.plot(result["time"], value, label="estimate")
top.plot(time, truth, "k--", lw=1, label="truth")
top.set_ylabel("C_N")
top.legend(loc="upper left")
bottom.step(result["time"], result["health.valid_gauges"], where="post")
bottom.set(xlabel="time [s]", ylabel="gauges in use", ylim=(52.5, 54.5), yticks=[53, 54])
health = bottom.twinx()
health.step(result["time"], [states.index(s) for s in result["health.state"]], where="post", color="C1")
health.set_yticks(range(len(states)), [strainfmu.HealthState(s).name for s in states], color="C1")
health.set_ylabel("health.state", color="C1")
health.set_ylim(-0.5, len(states) - 0.5)
plt.show()
