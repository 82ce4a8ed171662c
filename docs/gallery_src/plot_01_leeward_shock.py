"""
Cross-flow shock on the leeward side
====================================

At incidence the flow runs round the body from the windward side and meets itself on the leeward one. At Mach 5
and 8 deg it does so in a shock: the pressure falls round the side, then jumps. Without incidence there is none.
"""

from math import radians

import matplotlib.pyplot as plt
import numpy as np

import builder

vehicle = builder.load_vehicle("coarse.toml")
grid = builder.MarchingGrid(n_radial=24, n_circumferential=36)
flows = {angle: builder.solve_flow(vehicle.body(), 5.0, radians(angle), grid) for angle in (0.0, 8.0)}

# %%
# A solution has the wall pressure per smooth piece of the meridian: stations, and p/p_inf at roll angles from
# leeward.

figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), sharey=True, layout="constrained")
for axis, (angle, flow) in zip(axes, flows.items(), strict=True):
    for stations, ratio in flow.pieces:
        shown = axis.pcolormesh(
            stations, np.degrees(flow.roll_angle), np.log10(ratio.T), vmin=-0.8, vmax=0.6, shading="gouraud"
        )
    axis.set(title=f"Mach 5, total incidence {angle:g} deg", xlabel="x [m]")
axes[0].set_ylabel("roll angle from leeward [deg]")
figure.colorbar(shown, ax=axes, label="log10 p/p$_\\infty$")

# %%
# The same across the body, at one station ahead of the base.

stations, ratio = flows[8.0].pieces[-1]
row = ratio[np.searchsorted(stations, 3.0)]
figure, axis = plt.subplots(figsize=(6, 3), layout="constrained")
axis.plot(np.degrees(flows[8.0].roll_angle), row, ".-")
axis.set(xlabel="roll angle from leeward [deg]", ylabel="p/p$_\\infty$ at x = 3 m", ylim=0)
axis.grid(alpha=0.3)
plt.show()
