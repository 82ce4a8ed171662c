"""What the fuzzers feed: any bytes as frames of a profile, as a DBC file with its mapping, and as attacks.

All must end in results or in InputError, whatever the bytes; the sum rule of frames must hold.
"""

from dataclasses import replace
from functools import lru_cache
from math import isnan
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from strainfmu.can.authentic import AuthenticationKey, load_freshness, load_key
from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame, protect
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import PROFILES, SECURED_PROFILE, profile_layout
from strainfmu.can.quality import Quality
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically

N_GAUGES = 6
NAMES = tuple(f"g{i}" for i in range(N_GAUGES))
MAPPING_SEPARATOR = b"\n===\n"


def step(strain: np.ndarray, dynamic_pressure: float, step_size: float, **further: float) -> StepResult:
    """Return zeros for coefficients."""
    assert all(isnan(number) or abs(number) <= 1e8 for number in further.values())
    return StepResult(np.zeros(5), np.ones(5), 0, 1.0)


@lru_cache
def layouts() -> tuple[InputLayout, ...]:
    """Return a layout of every profile."""
    keys = {SECURED_PROFILE: AuthenticationKey(bytes(range(16)))}
    return tuple(profile_layout(profile, NAMES, 0.01, key=keys.get(profile)) for profile in PROFILES)


def frames_from(data: bytes) -> None:
    """Take bytes for frames: layout, then per frame which identifier, flags, time, length and data."""
    if not data:
        return
    layout = layouts()[data[0] % len(PROFILES)]
    core = Machine(layout, step, BridgeSettings(), start=0.0, own=[0x380])
    keys = [frame.layout.identifier for frame in layout.frames] + [0x380, 0x7FF]
    encoder = StrainEncoder(layout)
    index, time, number = 1, 0.0, 0
    while index + 4 <= len(data):
        which, flags, wait, length = data[index : index + 4]
        index += 4
        time += wait * 2e-4
        if which >= 250:  # a good cycle, so that states beyond the first are reached
            for frame in encoder.encode(
                1e-6 * np.arange(1.0 + number, 7.0 + number), 1e5, cycle=number, sample_time=time
            ):
                core.receive(Frame(identifier=frame.identifier, data=frame.data, time=time, is_fd=frame.is_fd))
            number += 1
            continue
        content = data[index : index + length % 65]
        index += length % 65
        frame = Frame(
            identifier=keys[which % len(keys)],
            data=content,
            time=time,
            is_extended=bool(flags & 1),
            is_fd=bool(flags & 2),
            bitrate_switch=bool(flags & 4),
            is_error=bool(flags & 8),
            is_remote=bool(flags & 16),
        )
        for result in core.receive(frame):
            assert result.quality is not Quality.VALID or number > 2
        assert core.account.unaccounted == 0
    core.advance(time + 1.0)
    core.finish(time + 1.0)
    assert core.account.unaccounted == core.account.pending == 0


def database_from(data: bytes) -> None:
    """Take bytes for a DBC file and, behind a separator, the mapping; then any data for its frames."""
    import tomllib

    text, _, rest = data.partition(MAPPING_SEPARATOR)
    try:
        mapping = tomllib.loads(rest.decode("utf-8", "replace"))
    except (tomllib.TOMLDecodeError, RecursionError):
        mapping = {
            "cycle_time_ms": 10,
            "strain": {f"g{i}": f"Rack.s{i}" for i in range(N_GAUGES)},
            "units": {f"Rack.s{i}": "um/m" for i in range(N_GAUGES)},
        }
    try:
        layout = mapped_layout(
            database_of(text.decode("cp1252", "replace"), "fuzz"),
            mapping,
            gauge_names=NAMES,
            name="mapping",
            sensor_names=("nose",),
            parameter_names=("parameter.fin", "parameter.power"),
            parameter_std_names=("parameter_std.fin",),
        )
        core = Machine(layout, step, BridgeSettings(), start=0.0, dynamic_pressure=1e5)
    except InputError:
        return
    for number in range(4):
        for frame in layout.frames:
            noise = np.random.default_rng((number, len(data))).bytes(frame.layout.length)
            core.receive(
                Frame(
                    identifier=frame.layout.identifier,
                    data=noise,
                    time=0.01 * number,
                    is_extended=frame.layout.is_extended,
                    is_fd=frame.layout.is_fd,
                )
            )
    core.finish(1.0)
    assert core.account.unaccounted == 0


class TrueStrains:
    """A step that knows what the sender has sent: it is given nothing else, and nothing twice."""

    def __init__(self) -> None:
        self.sent: list[int] = []
        self.newest = -1

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        found = np.rint(1e6 * strain[np.isfinite(strain)]).astype(int) - np.flatnonzero(np.isfinite(strain))
        assert len(set(found.tolist())) == 1
        number = int(found[0])
        assert number in self.sent
        assert number > self.newest
        self.newest = number
        return step(strain, dynamic_pressure, step_size)


def authentication_from(data: bytes) -> None:
    """Take bytes for what happens on a bus of authenticated frames: cycles, restarts, recordings, forgeries.

    Besides, take them for the content of a key file and of a freshness file.
    """
    layout = layouts()[-1]
    assert layout.is_authenticated
    judge, trip = TrueStrains(), 3
    core = Machine(layout, judge, BridgeSettings(), start=0.0, own=[0x380])
    items = {item.layout.key: item.layout for item in layout.frames}
    encoder, history = StrainEncoder(layout, trip), list[Frame]()
    number, first, time, index = 0, 0, 0.0, 0
    while index + 4 <= len(data):
        what, a, b, c = data[index : index + 4]
        index += 4
        time += 1e-4 * (c % 16)
        sent: list[Frame] = []
        if what < 96 or not history:  # a true cycle, perhaps with a frame missing
            time += 0.01
            sent = encoder.encode(
                1e-6 * (number + np.arange(N_GAUGES)),
                1e5,
                cycle=number - first,
                sample_time=0.01 * (number - first),
            )
            judge.sent.append(number)
            number += 1
            if what < 16:
                del sent[a % len(sent)]
            history += sent
        elif what < 112:  # the sender starts again
            encoder.trip += 1 + a % 3
            first = number
        elif what < 160:  # a recording
            start = (a << 8 | b) % len(history)
            sent = history[start : start + 1 + c % 40]
        else:  # bytes are altered, and the CRC may be made to fit
            old = history[-1 - a % min(len(history), 64)]
            content = bytearray(old.data)
            for place, bits in zip(data[index : index + c % 6], data[index + 6 :], strict=False):
                content[place % len(content)] ^= bits
            protection = items[old.key].protection
            assert protection is not None
            altered = protect(bytes(content), protection, content[2]) if b % 2 else bytes(content)
            sent = [replace(old, data=altered)]
            index += c % 6
        for frame in sent:
            core.receive(replace(frame, time=time))
            time += 1e-5
        assert core.account.unaccounted == 0
    core.finish(time + 1.0)
    assert core.account.unaccounted == core.account.pending == 0
    _files_from(data)


def _files_from(data: bytes) -> None:
    """Take bytes for a key file and a freshness file: a key, a number or one line."""
    with TemporaryDirectory(prefix="strainfmu_") as folder:
        path = Path(folder) / "file"
        write_bytes_atomically(path, data, is_private=True)
        key = AuthenticationKey(bytes(16))
        for read in (load_key, lambda file: load_freshness(file, key)):
            text = ""
            try:
                read(path)
            except InputError as error:
                text = str(error)
            assert "\n" not in text


TARGETS = {"frames": frames_from, "database": database_from, "authentication": authentication_from}
