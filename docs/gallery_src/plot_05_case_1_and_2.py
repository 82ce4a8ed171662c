"""
Case 1 against Case 2
=====================

Case 1 estimates the coefficients of a few pressure modes by least squares. Case 2 takes all snapshots as a
Gaussian prior and estimates the whole field. Both are scored on flights that neither has seen, from a finer
model of flow and structure.
"""

import matplotlib.pyplot as plt
import numpy as np

import builder
import strainfmu

vehicle = builder.load_vehicle("coarse.toml")
snapshots = builder.take_snapshots(vehicle)
structure = builder.solve_structure(vehicle)


def map_of(**entries):
    """Return the map of the same snapshots and structure with other entries of the section [map]."""
    changed = vehicle.model_copy(update={"map": vehicle.map.model_copy(update=entries)})
    return builder.build_map(changed, snapshots=snapshots, structure=structure)


maps = {"Case 1, five modes": map_of(case=1, modes=5), "Case 2, gamma = 1": map_of(case=2, gamma=1.0)}

# %%
# The plant: finer grids, and conditions between the snapshots'.

conditions = vehicle.conditions.model_copy(
    update={
        "mach_number": [5.5, 6.5],
        "angle_of_attack_deg": [1.0, 4.0, 6.0, 9.0],
        "sideslip_angle_deg": [2.0, 4.0, 7.0],
    }
)
resolution = vehicle.resolution.model_copy(update={"map": vehicle.resolution.truth})
plant = vehicle.model_copy(update={"conditions": conditions, "resolution": resolution})
flown = builder.take_snapshots(plant)
strain_operator = builder.solve_structure(plant).strain_operator(vehicle.gauges.layout)
net = flown.pressure - flown.internal_pressure[:, None]
draws = np.random.default_rng(1)
noise_std = next(iter(maps.values())).noise_std
strain = net @ strain_operator.T + noise_std * draws.standard_normal((len(net), len(strain_operator)))
dynamic_pressure = np.array([condition.dynamic_pressure for condition in flown.conditions()])
truth = flown.coefficients()

# %%
# Errors and the sigma that each map states, for 24 flights.

names = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
figure, axes = plt.subplots(1, 5, figsize=(11, 3), layout="constrained")
for number, (name, inverse_map) in enumerate(maps.items()):
    result = strainfmu.Estimator(inverse_map).estimate(strain, dynamic_pressure=dynamic_pressure)
    error = result.coefficients - truth
    inside = np.abs(error) <= 3.0 * result.coefficients_std
    print(
        f"{name}: inside 3 sigma",
        ", ".join(f"{n} {share:.0%}" for n, share in zip(names, inside.mean(0), strict=True)),
    )
    for axis, values, sigma in zip(axes, error.T, result.coefficients_std.T, strict=True):
        axis.errorbar([number], [0.0], yerr=[3.0 * sigma.mean()], capsize=6, color=f"C{number}")
        axis.plot(number + np.linspace(-0.25, 0.25, len(values)), values, ".", ms=4, color=f"C{number}")
for axis, name in zip(axes, names, strict=True):
    axis.set(xlabel=f"error of {name}", xlim=(-0.6, 1.6))
    axis.set_xticks([0, 1], ["Case 1", "Case 2"])
    axis.ticklabel_format(axis="y", scilimits=(-2, 2))
plt.show()
