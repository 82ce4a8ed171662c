"""
What a gauge layout sees
========================

Pressure is even or odd about the planes y = 0 and z = 0. Gauges at 0, 90, 180 and 270 deg read nothing of
pressure that is odd in both: the layout of the source is blind to it. Hoop gauges at 45 deg see it.
"""

import matplotlib.pyplot as plt
import numpy as np

import builder

vehicle = builder.load_vehicle("coarse.toml")
layouts = ["configuration_1", "configuration_2", "configuration_45"]
structure = builder.solve_structure(vehicle, layouts=layouts)

# %%
# ``strain_operator`` is Z_p, the strain of each gauge per pressure at each node. From it follows the response
# to smooth pressures: strain per rms pressure, largest over each class of symmetry.

mesh = builder.mesh_of_grid(structure.surface)
seen = {}
for layout in layouts:
    response = builder.smooth_response(structure.strain_operator(layout), mesh.point, mesh.node_area)
    seen[layout] = builder.symmetry_responses(response)
    for item in seen[layout]:
        print(f"{layout:17} {item.symmetry!s:24} {1e9 * item.norm:8.3g} um/m per kPa, rank {item.rank}")

# %%

figure, axis = plt.subplots(figsize=(8, 3.4), layout="constrained")
position = np.arange(4)
for number, (layout, found) in enumerate(seen.items()):
    axis.bar(position + 0.27 * (number - 1), [1e9 * item.norm for item in found], 0.25, label=layout)
axis.set_xticks(position, [str(item.symmetry).replace(", ", ",\n") for item in seen[layouts[0]]])
axis.set_ylabel("largest response\n[um/m per kPa rms]")
axis.legend()
plt.show()
