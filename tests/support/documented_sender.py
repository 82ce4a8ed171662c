"""A sender of fd64, fd64-sec, classic-le and a multiplexed rack, written from docs/reference/can.md alone.

What it sends is dated by a true time, which the bridge never sees.
"""

import hashlib
import struct
from binascii import crc_hqx
from dataclasses import dataclass, field

import numpy as np
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.cmac import CMAC

STATE, BASE = 0x2FF, 0x300
STATE_ID, PRESSURE_ID, FIRST_STRAIN_ID = 0x5202, 0x5300, 0x5301
"""DataIDs."""

PER_FRAME = {"fd64": 27, "fd64-sec": 20, "classic-le": 4, "rack": 15}
CODE = 0.25
"""um/m per bit."""


@dataclass(frozen=True)
class Sent:
    """A frame as it leaves a node: identifier and bytes."""

    identifier: int
    data: bytes


def configuration(profile: str, names: list[str]) -> int:
    """1 + (first two bytes of SHA-256 of profile and gauge names, each on its line) mod 65534."""
    digest = hashlib.sha256("\n".join([profile, *names]).encode()).digest()
    return 1 + int.from_bytes(digest[:2], "big") % 65534


@dataclass
class DocumentedSender:
    """One sender: counter, clock and, where its frames are authenticated, freshness values are its own.

    Attributes
    ----------
    session : number of its run, None of version 1, which sends no state.
    heard : counter of the last result heard, sample time of its strains, and when it was heard by its clock [s].
    """

    profile: str
    names: list[str]
    period: float
    key: bytes = bytes(range(16))
    trip: int = 1
    session: int | None = 7
    heard: tuple[int, int, float] | None = None
    ticks: dict[int, int] = field(default_factory=dict)
    configured: int = field(init=False)

    def __post_init__(self) -> None:
        self.configured = configuration(self.profile, self.names)

    def hear(self, answered: int, counter: int, clock: float, sample_time: int) -> None:
        """Take in that the result number ``counter`` was heard, which answers the cycle ``answered``.

        A classic result has no place for the sample time of its strains.
        """
        if self.profile != "classic-le":
            self.heard = counter, sample_time, clock
        elif answered in self.ticks:
            self.heard = counter, self.ticks[answered], clock

    def start(self) -> None:
        """Begin a new run."""
        self.trip += 1
        self.session = None if self.session is None else (self.session + 1) % (1 << 16)
        self.heard, self.ticks = None, {}

    def cycle(
        self,
        codes: np.ndarray,
        pressure: float,
        *,
        counter: int,
        clock: float,
        data_id_shift: int = 0,
        configured: int | None = None,
        status: int = 0,
    ) -> list[Sent]:
        """Return the frames of a cycle: dynamic pressure, then strains as (n,) int16 ``codes``; ``clock`` in s."""
        ticks = round(clock * 1e6) % (1 << 32)
        number = self.configured if configured is None else configured
        self.ticks[counter % 256] = ticks
        if self.profile == "classic-le":
            state = None if self.session is None else struct.pack("<HBBI", self.session, *self._heard(clock, 254))
            return _classic(codes, pressure, counter, ticks, data_id_shift, number, status, state)
        head = struct.pack("<BBI", counter % 256, status, ticks)
        size, n_plain = PER_FRAME[self.profile], 18 if self.profile == "fd64-sec" else 16
        body = head + struct.pack("<fH", pressure, number)
        frames = []
        if self.session is not None:
            heard, delay, sampled = self._heard(clock, 65_534)
            state = struct.pack("<BBIIHHH", counter % 256, heard, ticks, sampled, self.session, delay, number)
            n_state = 18 if self.profile == "fd64" else 16
            frames = [self._protected(STATE, state.ljust(n_state, b"\0"), STATE_ID + data_id_shift, counter)]
        frames += [self._protected(BASE, body.ljust(n_plain - 2, b"\0"), PRESSURE_ID + data_id_shift, counter)]
        for index in range(-(-len(codes) // size)):
            part = codes[index * size : (index + 1) * size]
            strains = np.full(size, -32768, dtype="<i2")
            strains[: len(part)] = part
            if self.profile == "rack":  # pages of one message; the page is where others have the status
                body = struct.pack("<BBIH", counter % 256, index, ticks, number) + strains.tobytes() + bytes(8)
                frames.append(self._protected(BASE + 1, body, FIRST_STRAIN_ID + data_id_shift, counter))
                continue
            body = head + strains.tobytes() + struct.pack("<H", number)
            frames.append(
                self._protected(BASE + 1 + index, body, FIRST_STRAIN_ID + index + data_id_shift, counter)
            )
        return frames

    def _heard(self, clock: float, longest: int) -> tuple[int, int, int]:
        """Return counter, delay [0.1 ms] and sample time of the last result heard; one more: none."""
        if self.heard is None:
            return 0, longest + 1, 0xFFFFFFFF
        counter, ticks, when = self.heard
        return counter, max(min(int(1e4 * (clock - when)), longest), 0), ticks

    def _protected(self, identifier: int, body: bytes, data_id: int, counter: int) -> Sent:
        crc = crc_hqx(body + data_id.to_bytes(2, "little"), 0xFFFF)
        data = struct.pack("<H", crc) + body
        if self.profile == "fd64-sec":
            freshness = self.trip << 32 | counter
            mac = CMAC(AES(self.key))
            mac.update(data_id.to_bytes(2, "big") + data + freshness.to_bytes(8, "big"))
            data += (freshness % (1 << 48)).to_bytes(6, "little") + mac.finalize()[:8]
        return Sent(identifier, data)


def rack_text(names: list[str]) -> str:
    """The DBC file of the rack: pages of 15 gauges in turns."""
    size = PER_FRAME["rack"]
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: A B", f"BO_ {BASE} Air: 16 A"]
    lines += [' SG_ T : 32|32@1+ (1,0) [0|0] "us" B', ' SG_ q : 64|32@1- (1,0) [0|0] "Pa" B']
    lines += [f"BO_ {BASE + 1} Rack: 48 A", ' SG_ Page M : 24|8@1+ (1,0) [0|0] "" B']
    lines += [' SG_ T : 32|32@1+ (1,0) [0|0] "us" B', ' SG_ Layout : 64|16@1+ (1,0) [0|0] "" B']
    for page in range(-(-len(names) // size)):
        for k, name in enumerate(names[page * size : (page + 1) * size]):
            lines += [f' SG_ {name} m{page} : {80 + 16 * k}|16@1- ({CODE},0) [0|0] "um/m" B']
    lines += [f'BA_DEF_ BO_ "{name}" INT 0 65535;' for name in ("GenMsgCycleTime", "E2EProfile", "E2EDataID")]
    lines += ['BA_DEF_ SG_ "GenSigStartValue" INT 0 65535;', 'BA_DEF_DEF_ "GenSigStartValue" 0;']
    lines += [f'BA_DEF_DEF_ "{name}" 0;' for name in ("GenMsgCycleTime", "E2EProfile", "E2EDataID")]
    lines += ['BA_DEF_ BO_ "VFrameFormat" ENUM ' + ",".join(f'"{kind}"' for kind in _FORMATS) + ";"]
    lines += ['BA_DEF_DEF_ "VFrameFormat" "StandardCAN";']
    for message, period, data_id in ((BASE, 10, PRESSURE_ID), (BASE + 1, 5, FIRST_STRAIN_ID)):
        entries = {"GenMsgCycleTime": period, "E2EProfile": 5, "E2EDataID": data_id, "VFrameFormat": 14}
        lines += [f'BA_ "{name}" BO_ {message} {value};' for name, value in entries.items()]
    lines += [f'BA_ "GenSigStartValue" SG_ {BASE + 1} Layout {configuration("rack", names)};']
    return "\n".join([*lines, f"SIG_VALTYPE_ {BASE} q : 1;", ""])


_FORMATS = ("StandardCAN", "ExtendedCAN", *["reserved"] * 12, "StandardCAN_FD", "ExtendedCAN_FD")


def _classic(
    codes: np.ndarray,
    pressure: float,
    counter: int,
    ticks: int,
    data_id_shift: int,
    configured: int,
    status: int,
    state: bytes | None,
) -> list[Sent]:
    """Return state, dynamic pressure, strains and the trailer, whose CRC covers them all but the pressure."""
    body = struct.pack("<BfH", counter % 15 | status << 4, pressure, ticks // 100 % (1 << 16))
    data_id = (PRESSURE_ID + data_id_shift).to_bytes(2, "little")
    frames = [Sent(BASE, bytes([_crc_8(data_id + body)]) + body)]
    strains = np.full(-(-len(codes) // 4) * 4, -32768, dtype="<i2")
    strains[: len(codes)] = codes
    plain = strains.tobytes()
    frames += [Sent(BASE + 1 + k, plain[8 * k : 8 * k + 8]) for k in range(len(plain) // 8)]
    covered, n = (state or b"") + plain, len(frames)
    frames = frames if state is None else [Sent(STATE, state), *frames]
    head = struct.pack("<BBI", counter % 256, status, ticks)
    crc = crc_hqx(head + covered + (configured + data_id_shift).to_bytes(2, "little"), 0xFFFF)
    return [*frames, Sent(BASE + n, struct.pack("<H", crc) + head)]


def _crc_8(data: bytes) -> int:
    """CRC-8/SAE-J1850 with start and final value 0, as E2E profile 1 has it."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x1D if crc & 0x80 else 0)) & 0xFF
    return crc
