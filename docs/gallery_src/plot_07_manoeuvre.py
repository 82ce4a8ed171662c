"""
An estimate over a manoeuvre
============================

The vehicle pulls up twice. Its strain comes from a finer model of flow and structure than the map was built on,
at conditions between the snapshots', with noise. The estimate follows the truth, and its 3 sigma bands
hold it.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.interpolate import CubicSpline

import builder
import strainfmu

vehicle = builder.load_vehicle("coarse.toml")
inverse_map = builder.build_map(vehicle)

# %%
# The plant over angle of attack: Mach 6.2, 3 deg of sideslip, finer grids.

angles = np.linspace(0.5, 9.5, 10)
conditions = vehicle.conditions.model_copy(
    update={"mach_number": [6.2], "angle_of_attack_deg": angles.tolist(), "sideslip_angle_deg": [3.0]}
)
resolution = vehicle.resolution.model_copy(update={"map": vehicle.resolution.truth})
plant = vehicle.model_copy(update={"conditions": conditions, "resolution": resolution})
flown = builder.take_snapshots(plant)
strain_operator = builder.solve_structure(plant).strain_operator(vehicle.gauges.layout)
net = flown.pressure - flown.internal_pressure[:, None]
strain_over_angle = CubicSpline(angles, net @ strain_operator.T)
truth_over_angle = CubicSpline(angles, flown.coefficients())

# %%
# Ten seconds at 100 Hz. ``estimate`` takes all samples at once, (k, n) strains and (k,) dynamic pressures or
# one.

time = np.arange(0.0, 10.0, 0.01)
angle = 5.0 - 4.0 * np.cos(2.0 * np.pi * time / 5.0)
noise = inverse_map.noise_std * np.random.default_rng(1).standard_normal((len(time), inverse_map.n_gauges))
dynamic_pressure = flown.conditions()[0].dynamic_pressure
estimator = strainfmu.Estimator(inverse_map)
result = estimator.estimate(strain_over_angle(angle) + noise, dynamic_pressure=dynamic_pressure)
truth = truth_over_angle(angle)
inside = np.abs(result.coefficients - truth) <= 3.0 * result.coefficients_std
print("inside 3 sigma:", np.round(100.0 * inside.mean(axis=0), 1), "%")

# %%

figure, axes = plt.subplots(3, 1, figsize=(9, 6), sharex=True, layout="constrained")
for axis, name, column in zip(axes, ["C_N", "C_Y", "M_P"], [1, 2, 3], strict=True):
    value, sigma = result.coefficients[:, column], result.coefficients_std[:, column]
    axis.fill_between(
        time, value - 3.0 * sigma, value + 3.0 * sigma, color="C0", alpha=0.25, lw=0, label="3 sigma"
    )
    axis.plot(time, value, lw=0.7, color="C0", label="estimate")
    axis.plot(time, truth[:, column], "k--", lw=1, label="truth")
    axis.set_ylabel(name)
figure.legend(*axes[0].get_legend_handles_labels(), ncols=3, loc="outside upper center")
axes[-1].set_xlabel("time [s]")
plt.show()
