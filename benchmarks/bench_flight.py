"""The flight of the bus benchmark: strains and dynamic pressure that a map holds for possible, as frames."""

import struct
from dataclasses import dataclass, field, replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame, protect
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.profiles import profile_layout
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.fmu.reference_run.flight_path import flight_path
from strainfmu.fmu.reference_run.reference_flight import flight_of_tables

PROFILE = "fd64"

_DISTINCT = 1000
"""Cycles with strains of their own, sent over and over with new counters, times, CRCs and last bits."""

_READINGS, _LONGEST = slice(8, 62, 2), 64
"""Low bytes of the readings in a frame of strains, and its length."""

_SWING = 0.02
"""Amplitude by which the strains of a linear map move about their mean."""


@dataclass(eq=False)
class BenchFlight:
    """Cycles of strains that move, with the noise of a map's gauges."""

    layout: InputLayout
    cycles: list[list[Frame]] = field(default_factory=list)

    def cycle(self, number: int) -> list[Frame]:
        """Return the frames of a cycle, with its counter and its time on schedule."""
        at = number * self.layout.cycle_time
        stamp = struct.pack("<I", round(1e6 * at) % 2**32)
        frames = []
        for frame, item in zip(self.cycles[number % len(self.cycles)], self._items, strict=True):
            assert item.protection is not None
            data = frame.data[:4] + stamp + frame.data[8:]
            if len(data) == _LONGEST and number >= len(self.cycles):
                data = _pass_of(data, number // len(self.cycles))
            frames.append(replace(frame, data=protect(data, item.protection, counter=number), time=at))
        return frames

    def __post_init__(self) -> None:
        by_key = {frame.layout.key: frame.layout for frame in self.layout.frames}
        self._items = [by_key[frame.key] for frame in self.cycles[0]]


def _pass_of(data: bytes, number: int) -> bytes:
    """Return a frame of strains whose last bits differ in every pass: a sender that repeats itself is refused."""
    changed = bytearray(data)
    changed[_READINGS] = bytes(byte ^ (number >> place & 1) for place, byte in enumerate(changed[_READINGS]))
    return bytes(changed)


def bench_flight(inverse_map: InverseMap, cycle_time: float) -> BenchFlight:
    """Return a flight that comes back to its start; ``cycle_time`` in s."""
    layout = profile_layout(PROFILE, inverse_map.gauge_names, cycle_time)
    encoder, random = StrainEncoder(layout), np.random.default_rng(1)
    strain, pressure = _motion(inverse_map)
    strain = strain + random.normal(size=strain.shape) * inverse_map.noise_std
    rows = zip(strain, pressure.tolist(), strict=True)
    return BenchFlight(layout, [encoder.encode(row, q, cycle=0, sample_time=0.0) for row, q in rows])


def _motion(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray]:
    """Return (n, n_d) strains without errors [m/m] and (n,) q_inf [Pa].

    The mean strain of a map is the strain of no flight state: to a map with tables it is a fault, at any q_inf.
    """
    if inverse_map.manifold is not None:
        path = flight_path(inverse_map, _DISTINCT + 1)
        return flight_of_tables(inverse_map, path).strain[:-1], path.dynamic_pressure[:-1]
    swing = 1.0 + _SWING * np.sin(2.0 * np.pi * np.arange(_DISTINCT) / _DISTINCT)
    nominal = np.full(_DISTINCT, inverse_map.nominal_dynamic_pressure)
    return swing[:, None] * inverse_map.mean_strain, nominal
