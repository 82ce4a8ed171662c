"""A rack by a user's DBC file: a frame with a float64 for each gauge, and frames of other quantities."""

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from can_case import CYCLE

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result

FIRST = 0x100
"""Identifier of the first gauge's frame."""


def rack_text(n_gauges: int, lines: Sequence[str] = ()) -> str:
    """Return the DBC file; ``lines`` are of other frames, the types of their floats last."""
    text, types = ['VERSION ""', "NS_ :", "BS_:", "BU_: A B"], []
    for number in range(n_gauges):
        text += [f"BO_ {FIRST + number} F{number}: 8 A", ' SG_ v : 0|64@1- (1,0) [0|0] "m/m" B']
        types.append(f"SIG_VALTYPE_ {FIRST + number} v : 2;")
    rest = [line for line in lines if not line.startswith("SIG_VALTYPE_")]
    return "\n".join([*text, *rest, *types, *(line for line in lines if line not in rest), ""])


def rack_strains(n_gauges: int) -> dict[str, str]:
    """Return the mapping of the gauges."""
    return {f"strain[{number + 1}]": f"F{number}.v" for number in range(n_gauges)}


def rack_layout(n_gauges: int, lines: Sequence[str], mapping: Mapping[str, Any], **names: Any) -> InputLayout:
    """Return the frames of the rack; ``names`` are of the estimator's inputs, as of :func:`mapped_layout`."""
    return mapped_layout(
        database_of(rack_text(n_gauges, lines), "r"),
        {"cycle_time_ms": 1e3 * CYCLE, "strain": rack_strains(n_gauges), **mapping},
        gauge_names=[f"g{number}" for number in range(n_gauges)],
        name="r",
        **names,
    )


def rack_cycle(core: Machine, strain: np.ndarray, k: int, more_frames: Sequence[tuple[int, bytes]] = ()) -> Result:
    """Return the result of cycle ``k``, of ``more_frames`` by identifier and of strains behind them."""
    frames = [*more_frames, *((FIRST + i, struct.pack("<d", value)) for i, value in enumerate(strain))]
    results = []
    for identifier, data in frames:
        frame = Frame(identifier=identifier, data=data, time=k * CYCLE, is_fd=len(data) > 8)
        results += core.receive(frame)
    return (results + core.advance((k + 0.9) * CYCLE))[-1]
