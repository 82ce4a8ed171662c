"""The file zeros.toml: zeros of the gauges by name, with their standard deviations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from strainfmu.cosim.toml_table import TomlTable, read_toml
from strainfmu.estimator.zeros import LARGEST_ZERO, GaugeZeros
from strainfmu.files import write_bytes_atomically

MICRO = 1e-6
_LARGEST = LARGEST_ZERO / MICRO


def load_zeros(path: Path, gauge_names: Sequence[str]) -> GaugeZeros:
    """Return the zeros in ``path`` in the order of ``gauge_names``.

    The table ``[gauges]`` holds ``name = { zero_um_per_m = .., std_um_per_m = .. }``; ``common_std_um_per_m``
    stands before it. ``[made_from]`` tells how they were found, and is not read.

    Raises
    ------
    InputError
        The file is missing or no TOML, an entry is wrong or unknown, a gauge is missing, or one is unknown.
    """
    top = TomlTable(path, "", dict(read_toml(path)))
    top.entries.pop("made_from", None)
    common = top.number("common_std_um_per_m", 0.0, 0.0, _LARGEST)
    gauges = top.table("gauges")
    top.finish()
    values = []
    for name in gauge_names:
        if name not in gauges.entries:
            raise gauges.fault(name, "gauge of the map is missing")
        entry = gauges.table(name)
        zero = entry.number("zero_um_per_m", None, -_LARGEST, _LARGEST)
        values.append((zero, entry.number("std_um_per_m", None, 0.0, _LARGEST)))
        entry.finish()
    for name in gauges.entries:
        raise gauges.fault(name, "the map has no such gauge")
    value, std = MICRO * np.array(values).T
    return GaugeZeros(value=value, std=std, common_std=MICRO * common)


def write_zeros(
    path: Path, gauge_names: Sequence[str], zeros: GaugeZeros, made_from: Mapping[str, str | float]
) -> None:
    """Write ``zeros`` to ``path``, all or nothing; ``made_from`` tells how they were found.

    Raises
    ------
    StrainfmuError
        The file cannot be written.
    """
    lines = [f"common_std_um_per_m = {zeros.common_std / MICRO:.9g}", "", "[made_from]"]
    lines += [f"{key} = {_toml(value)}" for key, value in made_from.items()]
    lines += ["", "[gauges]"]
    width = max(len(_toml(name)) for name in gauge_names)
    for name, value, std in zip(gauge_names, zeros.value.tolist(), zeros.std.tolist(), strict=True):
        entry = f"zero_um_per_m = {value / MICRO:.12g}, std_um_per_m = {std / MICRO:.12g}"
        lines.append(f"{_toml(name):{width}} = {{ {entry} }}")
    write_bytes_atomically(path, ("\n".join(lines) + "\n").encode())


def _toml(value: str | float) -> str:
    """Return a text in quotes, or a number, as TOML has it."""
    if not isinstance(value, str):
        return f"{value:.9g}"
    escaped = "".join(
        f"\\u{ord(one):04X}" if ord(one) < 32 or ord(one) == 127 else f"\\{one}" if one in '"\\' else one
        for one in value
    )
    return f'"{escaped}"'
