"""
What a lost gauge costs
=======================

A gauge that is lost is left out exactly, as if the map had been built without it: the estimate stays right and
sigma grows. How much it grows shows which gauges matter most.
"""

import matplotlib.pyplot as plt
import numpy as np

import builder
import strainfmu

vehicle = builder.load_vehicle("coarse.toml")
inverse_map = builder.build_map(vehicle)
estimator = strainfmu.Estimator(inverse_map)
n = inverse_map.n_gauges

# %%
# One sample per lost gauge: ``valid`` is false for it. The strain is the mean pressure's; sigma does not
# depend on it.

strain = np.tile(inverse_map.mean_strain, (n, 1))
all_gauges = estimator.estimate(inverse_map.mean_strain, dynamic_pressure=1e5)
without_one = estimator.estimate(strain, dynamic_pressure=1e5, valid=~np.eye(n, dtype=bool))
growth = without_one.coefficients_std / all_gauges.coefficients_std

figure, axis = plt.subplots(figsize=(9, 3), layout="constrained")
for name, column in zip(["C_A", "C_N", "C_Y", "M_P", "M_Y"], growth.T, strict=True):
    axis.plot(np.arange(1, n + 1), 100.0 * (column - 1.0), ".-", lw=0.8, label=name)
axis.set(xlabel="number of the lost gauge", ylabel="sigma grows by [%]")
axis.legend(ncols=5, loc="upper left")

# %%
# Several at once, lost in random order: sigma grows faster and faster, and below five gauges five modes are not
# identified.

order = np.random.default_rng(3).permutation(n)
valid = np.ones((n, n), dtype=bool)
for number in range(n):
    valid[number, order[:number]] = False
result = estimator.estimate(strain, dynamic_pressure=1e5, valid=valid)

figure, axis = plt.subplots(figsize=(9, 3), layout="constrained")
axis.semilogy(np.arange(n), result.coefficients_std[:, 1] / all_gauges.coefficients_std[1], ".-")
axis.set(xlabel="gauges lost", ylabel="sigma of C_N over that with all")
axis.grid(alpha=0.3)
states = [strainfmu.HealthState(int(state)).name for state in result.health]
print("lost: health", {states.index(name): name for name in dict.fromkeys(states)})
plt.show()
