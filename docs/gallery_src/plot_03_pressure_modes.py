"""
Modes of the pressure
=====================

Surface pressure has thousands of values, but over a range of flight conditions few degrees of freedom. The
proper orthogonal decomposition of the snapshots finds them. Case 1 of the method estimates the first five
coefficients.
"""

import matplotlib.pyplot as plt
import numpy as np

import builder
import strainfmu

vehicle = builder.load_vehicle("coarse.toml")
snapshots = builder.take_snapshots(vehicle)
modes = strainfmu.proper_orthogonal_decomposition(snapshots.pressure)
print(f"{len(snapshots.pressure)} snapshots of {snapshots.pressure.shape[1]} nodes")
print(f"energy of the first five modes: {modes.energy[4]:.2%}")

# %%
# The first five modes on the unrolled body: station against roll angle. The mean pressure is left out of them.

grid = snapshots.grid
figure, axes = plt.subplots(1, 5, figsize=(11, 3), sharey=True, layout="constrained")
for number, axis in enumerate(axes):
    mode = grid.as_map(modes.modes[:, number])
    limit = np.abs(mode).max()
    axis.pcolormesh(grid.x, np.degrees(grid.roll_angle), mode.T, vmin=-limit, vmax=limit, cmap="RdBu_r")
    axis.set(title=f"mode {number + 1}", xlabel="x [m]")
axes[0].set(ylabel="roll angle [deg]", yticks=[0, 90, 180, 270])

# %%
# What is left out falls slowly beyond them. Truncated modes strain the gauges too: the map counts that strain
# as noise.

figure, axis = plt.subplots(figsize=(6, 3), layout="constrained")
axis.semilogy(np.arange(1, 16), 1.0 - modes.energy[:15], "o-")
axis.set(xlabel="modes kept", ylabel="energy left out")
axis.grid(alpha=0.3)
plt.show()
