"""
A bias, found and isolated
==========================

One gauge drifts off. The residual of every gauge against the others is a standard normal number while all is
well; the gauge that drifts leaves that range, is named, and then left out.
"""

import matplotlib.pyplot as plt
import numpy as np

import builder
import strainfmu

vehicle = builder.load_vehicle("coarse.toml")
inverse_map = builder.build_map(vehicle)
estimator = strainfmu.Estimator(inverse_map)

# %%
# Three seconds at 100 Hz of the mean flow with noise. Gauge 20 drifts by 2 um/m per second from 1 s on.

time = np.arange(0.0, 3.0, 0.01)
noise = inverse_map.noise_std * np.random.default_rng(5).standard_normal((len(time), inverse_map.n_gauges))
strain = inverse_map.mean_strain + noise
drift = 2e-6 * np.clip(time - 1.0, 0.0, None)
strain[:, 19] += drift
single = [estimator.estimate(row, dynamic_pressure=1e5) for row in strain]
score = np.array([estimate.standardised_residual for estimate in single])
suspect = np.array([estimate.suspects[0] + 1 if estimate.suspects else 0 for estimate in single])
found = time[np.argmax(suspect == 20)]
name = inverse_map.gauge_names[19]
print(f"gauge 20 ({name}) is named at {found:.2f} s, {2.0 * (found - 1.0):.2f} um/m off")

# %%
# Once named, it is left out: the estimate is as good as without it.

valid = np.ones(strain.shape, dtype=bool)
valid[time > found, 19] = False
trusting = estimator.estimate(strain, dynamic_pressure=1e5)
isolating = estimator.estimate(strain, dynamic_pressure=1e5, valid=valid)
truth = estimator.estimate(strain - drift[:, None] * (np.arange(54) == 19), dynamic_pressure=1e5)

figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 5), sharex=True, layout="constrained")
top.plot(time, np.delete(score, 19, axis=1), color="0.8", lw=0.4)
top.plot(time, score[:, 19], color="C3", label="gauge 20")
top.axvline(found, color="k", ls=":", label="named")
top.set(ylabel="residual z [1]", ylim=(-10, 10))
top.legend(loc="lower left")
for result, label in ((trusting, "with gauge 20"), (isolating, "left out once named")):
    bottom.plot(
        time, (result.coefficients - truth.coefficients)[:, 3] / result.coefficients_std[:, 3], label=label
    )
bottom.set(xlabel="time [s]", ylabel="error of M_P by the drift\n[its sigma]")
bottom.legend(loc="upper left")
plt.show()
