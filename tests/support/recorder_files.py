"""Binary recordings written from the description of their format alone, by no library."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass
class Mdf3Channel:
    """A channel of 16 bits, value = offset + factor * raw."""

    name: str
    unit: str
    values: np.ndarray
    factor: float
    offset: float = 0.0


def mdf3(groups: Sequence[tuple[np.ndarray, Sequence[Mdf3Channel]]]) -> bytes:
    """Return an MDF file of version 3.30, one data group for each raster: (n,) times [s] and its channels.

    Source: Vector, MDF specification 3.3, blocks ID, HD, DG, CG, CN, CC; little-endian, a record is a double for
    the time and 16 bits for each channel.
    """
    file = bytearray(64 + 208)
    struct.pack_into("<8s8s8s4H", file, 0, b"MDF     ", b"3.30    ", b"by hand ", 0, 0, 330, 1252)
    heads = []
    for time, channels in groups:
        raw = [np.round((channel.values - channel.offset) / channel.factor).astype("<i2") for channel in channels]
        names = [f"c{i}" for i in range(len(raw))]
        record = np.dtype([("t", "<f8"), *((name, "<i2") for name in names)])
        data = np.zeros(len(time), record)
        data["t"] = time
        for name, values in zip(names, raw, strict=True):
            data[name] = values
        at_data = _add(file, data.tobytes())
        after = 0
        for i, channel in reversed(list(enumerate(channels))):
            conversion = _conversion(file, channel.unit, 0, channel.offset, channel.factor)
            after = _channel(file, after, conversion, 0, channel.name, 64 + 16 * i, 16, 1)
        after = _channel(file, after, _conversion(file, "s", 65535), 1, "time", 0, 64, 3)
        cg = struct.pack("<2sH3I3HI", b"CG", 26, 0, after, 0, 0, 1 + len(raw), record.itemsize, len(time))
        heads.append((_add(file, cg), at_data))
    after = 0
    for at_group, at_data in reversed(heads):
        after = _add(file, struct.pack("<2sH4I2HI", b"DG", 28, after, at_group, 0, at_data, 1, 0, 0))
    head = struct.pack("<2sH3IH10s8s", b"HD", 208, after, 0, 0, len(groups), b"01:03:2026", b"12:00:00")
    file[64 : 64 + len(head)] = head
    return bytes(file)


def _add(file: bytearray, block: bytes) -> int:
    """Append a block; return its position."""
    address = len(file)
    file += block
    return address


def _conversion(file: bytearray, unit: str, kind: int, *parameters: float) -> int:
    head = struct.pack(
        "<2sHH2d20s2H",
        b"CC",
        46 + 8 * len(parameters),
        0,
        0.0,
        0.0,
        unit.encode("latin-1"),
        kind,
        len(parameters),
    )
    return _add(file, head + struct.pack(f"<{len(parameters)}d", *parameters))


def _channel(
    file: bytearray, after: int, conversion: int, is_time: int, name: str, start: int, bits: int, kind: int
) -> int:
    links = (after, conversion, 0, 0, 0)
    head = struct.pack("<2sH5IH32s128s", b"CN", 228, *links, is_time, name.encode("latin-1"), b"")
    return _add(file, head + struct.pack("<4H3d2IH", start, bits, kind, 0, 0.0, 0.0, 0.0, 0, 0, 0))


def lvm(
    segments: Sequence[tuple[str, Sequence[tuple[str, str, np.ndarray, np.ndarray]]]],
    x_columns: str,
    *,
    between: str = "\t",
    decimal: str = ".",
    headings: str = "Yes",
) -> str:
    """Return a LabVIEW measurement file: segments with their time of day; name, unit, (n,) x and (n,) values each.

    Source: National Instruments, Specification for the LabVIEW Measurement File (.lvm). Channels of a segment are
    side by side, "No" column of x, "One" or "Multi"; the cells of a tag stand above the values of their channel.
    """

    def line(*cells: object) -> str:
        return between.join(str(cell) for cell in cells)

    def number(value: float) -> str:
        return f"{value:.9f}".replace(".", decimal)

    separator = {"\t": "Tab", ",": "Comma"}[between]
    lines = ["LabVIEW Measurement" + between, line("Writer_Version", 2), line("Reader_Version", 2)]
    lines += [line("Separator", separator), line("Decimal_Separator", decimal), line("Multi_Headings", headings)]
    lines += [line("X_Columns", x_columns), line("Time_Pref", "Relative"), line("Operator", "test")]
    lines += [line("Date", "2026/03/01"), line("Time", "12:00:00"), "***End_of_Header***" + between, between]
    for number_of, (start, channels) in enumerate(segments):
        wide = x_columns == "Multi"

        def above(tag: str, cells: Sequence[object], is_wide: bool = wide) -> str:
            return line(tag, *(text for cell in cells for text in ((cell, "") if is_wide else (cell,))))

        if number_of == 0 or headings == "Yes":
            lines += [line("Channels", len(channels)), above("Samples", [len(channel[2]) for channel in channels])]
            lines += [above("Date", ["2026/03/01"] * len(channels)), above("Time", [start] * len(channels))]
            lines += [above("Y_Unit_Label", [channel[1] for channel in channels])]
            lines += [above("X_Dimension", ["Time"] * len(channels))]
            lines += [above("X0", [number(channel[2][0]) for channel in channels])]
            lines += [
                above("Delta_X", [number(channel[2][1] - channel[2][0]) for channel in channels]),
                "***End_of_Header***",
            ]
            heads = [cell for channel in channels for cell in (("X_Value", channel[0]) if wide else (channel[0],))]
            lines += [line(*(heads if wide else ["X_Value", *heads]), "Comment")]
        longest = max((channel[2] for channel in channels), key=len)
        for row in range(len(longest)):
            cells = [] if wide else [number(longest[row]) if x_columns == "One" else ""]
            for _, _, x, values in channels:
                pair = (number(x[row]), number(values[row])) if row < len(x) else ("", "")
                cells += pair if wide else pair[1:]
            lines += [line(*cells, "a comment" if row == 0 else "")]
        lines += [between] if headings == "Yes" else []
    return "\r\n".join(lines)
