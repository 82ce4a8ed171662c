"""The file zeros.toml: zeros of the gauges by name, with their standard deviations.

The strain of known loads, which a tare takes off, has a file of the same form. Each is refused where the other is
wanted, by the table ``[made_from]``.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from strainfmu.cosim.toml_table import read_table
from strainfmu.errors import InputError
from strainfmu.estimator.gauge_zeros import LARGEST_ZERO, GaugeZeros
from strainfmu.estimator.tare import KnownStrain
from strainfmu.files import write_bytes_atomically

MICRO = 1e-6
_LARGEST = LARGEST_ZERO / MICRO

_OF_ZEROS = ("recording", "bus", "calibration")
"""Entries of ``[made_from]`` one of which zeros have that were found."""

_OF_LOADS = "ambient_pressure_Pa"
"""The one that known loads have."""


def load_zeros(path: Path, gauge_names: Sequence[str]) -> GaugeZeros:
    """Return the zero offsets in ``path`` in the order of ``gauge_names``.

    The table ``[gauges]`` holds ``name = { zero_um_per_m = .., std_um_per_m = .. }``; ``common_std_um_per_m``
    stands before it. ``[made_from]`` states their origin, and may be missing.

    Raises
    ------
    InputError
        The file is missing or no TOML, an entry is wrong or unknown, a gauge is missing, or one is unknown; or it
        holds the strain of known loads.
    """
    zeros, made_from = _read(path, gauge_names)
    if _OF_LOADS in made_from and not any(name in made_from for name in _OF_ZEROS):
        raise InputError(f"{path}: expected zeros, as of 'strainfmu tare -o', got the strain of known loads")
    return zeros


def load_known_strain(path: Path, gauge_names: Sequence[str]) -> KnownStrain:
    """Return the strain of known loads in ``path``, in the order of ``gauge_names``: ``tare --known-output``'s.

    Raises
    ------
    InputError
        As :func:`load_zeros`; or the file holds zeros, or an error in common, which known loads do not have.
    """
    stated, made_from = _read(path, gauge_names)
    if any(name in made_from for name in _OF_ZEROS):
        raise InputError(
            f"{path}: expected the strain of known loads, as of 'strainfmu tare --known-output', got zeros"
        )
    if stated.common_std != 0.0:
        raise InputError(
            f"{path}: common_std_um_per_m: expected 0 of known loads, got {stated.common_std / MICRO:g}"
        )
    return KnownStrain(value=stated.value, own_std=stated.std)


def _read(path: Path, gauge_names: Sequence[str]) -> tuple[GaugeZeros, Mapping[str, object]]:
    """Return what the file holds, and its table ``[made_from]``."""
    top = read_table(path)
    made_from = top.entries.pop("made_from", None)
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
    zeros = GaugeZeros(value=value, std=std, common_std=MICRO * common)
    return zeros, made_from if isinstance(made_from, Mapping) else {}


def write_zeros(
    path: Path, gauge_names: Sequence[str], zeros: GaugeZeros, made_from: Mapping[str, str | float]
) -> None:
    """Write ``zeros`` to ``path``, all or nothing; ``made_from`` states how they were found.

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
        f"\\u{ord(char):04X}" if ord(char) < 32 or ord(char) == 127 else f"\\{char}" if char in '"\\' else char
        for char in value
    )
    return f'"{escaped}"'
