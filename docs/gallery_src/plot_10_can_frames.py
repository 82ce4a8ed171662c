"""
The CAN frames of one cycle
===========================

With the profile ``fd64`` a cycle of 54 gauges is four CAN FD frames: the state of the sender,
dynamic pressure, then 27 gauges each. Every frame carries a CRC, a counter and the sample time, so that the bridge
trusts only what is intact, new and in order. The state names the last result that the sender heard.
"""

import matplotlib.pyplot as plt
import numpy as np

import strainfmu

gauges = [f"gauge_{i}" for i in range(1, 55)]
layout = strainfmu.profile_layout("fd64", gauges, cycle_time=0.01)
encoder = strainfmu.StrainEncoder(layout)
strain = 1e-6 * np.linspace(-300.0, 300.0, 54)  # m/m
frames = encoder.encode(strain, dynamic_pressure=95.8e3, cycle=7, sample_time=1.25)
for frame in frames:
    print(f"{frame.identifier:#x} {len(frame.data):2} bytes  {frame.data[:20].hex(' ')} ..")

# %%
# Bytes by what they hold.

HEADER = {"CRC": 2, "counter": 1, "status": 1, "sample time": 4}
heard = {"CRC": 2, "counter": 1, "result heard": 1, "sample time": 4, "its sample time": 4, "session": 2}
state = heard | {"its delay": 2, "configuration": 2}
pressure = HEADER | {"q_inf": 4, "configuration": 2}
strains = HEADER | {f"{number}": 2 for number in range(1, 28)} | {"configuration": 2}
colors = dict(zip(pressure, ["C0", "C1", "C2", "C4", "C8", "C9"], strict=True))
colors |= dict.fromkeys(("result heard", "its sample time", "its delay"), "C3") | {"session": "C5"}

figure, axis = plt.subplots(figsize=(11, 3.2), layout="constrained")
for row, fields in enumerate((state, pressure, strains, strains)):
    start = 0
    for name, length in fields.items():
        axis.barh(row, length, left=start, color=colors.get(name, "0.85"), edgecolor="w")
        if name.isdigit():
            gauge = str(int(name) + 27 * (row - 2))
            axis.text(start + 1, row, gauge, ha="center", va="center", fontsize=6)
        start += length
for name, color in colors.items():
    axis.bar(0, 0, color=color, label=name)
axis.bar(0, 0, color="0.85", label="strain of a gauge")
axis.set_yticks(range(len(frames)), [f"{frame.identifier:#x}" for frame in frames])
axis.set(xlabel="byte", xlim=(0, 64), ylim=(3.6, -0.6))
figure.legend(ncols=6, loc="outside upper center")

# %%
# One flipped bit is found by the CRC.

item = layout.strain_frames[0].layout
damaged = bytearray(frames[2].data)
damaged[30] ^= 0x10
for name, data in (("intact", frames[2].data), ("damaged", bytes(damaged))):
    fits = strainfmu.crc_of(data, item.protection) == int.from_bytes(data[:2], "little")
    print(f"{name}: CRC {'fits' if fits else 'does not fit'}")
plt.show()
