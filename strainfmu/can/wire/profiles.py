"""The five profiles, frame layouts that need no DBC file: fd64, classic-le, classic-be, float2 and fd64-sec.

fd64: 27 gauges per CAN FD frame of 64 bytes, each frame under E2E profile 5. fd64-sec: 20 gauges per frame, each
frame authenticated as well. The others: plain frames of 8 bytes, as strain amplifiers send them (4 x 16 bit,
2 x float32), closed by a trailer whose CRC covers the whole cycle.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from strainfmu.can.wire.authenticator import SECURED_BYTES, AuthenticationKey, Secured
from strainfmu.can.wire.crc import Protection
from strainfmu.can.wire.frame import EXTENDED_FLAG
from strainfmu.can.wire.frame_layout import (
    ALTITUDE,
    BIG,
    DYNAMIC_PRESSURE,
    LITTLE,
    MACH_NUMBER,
    FlowSignal,
    FrameLayout,
    InputFrame,
    InputLayout,
)
from strainfmu.can.wire.profile_signals import (
    altitude_signal,
    configuration_signal,
    float_strain_signal,
    freshness_signals,
    header_1,
    header_5,
    mach_signal,
    pressure_signal,
    sample_time_signal,
    short_sample_time,
    status_signal,
    strain_signal,
)
from strainfmu.can.wire.reading_frames import (
    READINGS_PER_FD_FRAME,
    READINGS_PER_SECURED_FRAME,
    reading_frames,
)
from strainfmu.can.wire.tare_frame import tare_frame
from strainfmu.errors import InputError
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX

SECURED_PROFILE = "fd64-sec"

PROFILES = ("fd64", "classic-le", "classic-be", "float2", SECURED_PROFILE)

GAUGES_PER_FD_FRAME, GAUGES_PER_SECURED_FRAME = 27, 20

SENDER = "StrainSender"
BRIDGE = "StrainBridge"

_NAVIGATION_DATA_ID = 0x5200
_PRESSURE_DATA_ID = 0x5300
_STRAIN_DATA_ID = 0x5301
_MICRO = 1e-6
_NAVIGATION_TEXT = "Mach number and altitude by navigation; optional: a sender without them does not send it"


@dataclass(frozen=True)
class Identifiers:
    """Identifiers of the frames of a profile.

    Attributes
    ----------
    base : identifier of the frame of q_inf; strain frames, the trailer and the frame of navigation follow.
    result_base : identifier of the first result frame.
    is_extended : 29 bit identifiers.
    """

    base: int = 0x300
    result_base: int = 0x380
    is_extended: bool = False

    def checked(self, n_input: int, n_result: int) -> Identifiers:
        """Return self if ``n_input`` input and ``n_result`` result frames have identifiers of their own.

        Raises
        ------
        InputError
            Identifiers overlap or do not exist.
        """
        limit = EXTENDED_FLAG >> 2 if self.is_extended else 0x800
        for name, first, count in (("input", self.base, n_input), ("result", self.result_base, n_result)):
            if first < 0 or first + count > limit:
                raise InputError(
                    f"{name} identifiers: 0x{first:X} and {count - 1} more found, 0 to 0x{limit - 1:X} allowed"
                )
        if self.base < self.result_base + n_result and self.result_base < self.base + n_input:
            raise InputError(
                f"result identifiers: expected others than the input's, 0x{self.base:X} to "
                f"0x{self.base + n_input - 1:X}, got 0x{self.result_base:X} and {n_result - 1} more"
            )
        return self


def configuration_of(profile: str, gauge_names: Sequence[str]) -> int:
    """Return the 16 bit number that identifies an assignment of gauges to frames.

    The first two bytes of the SHA-256 of profile and gauge names in their order; 0 and 65535 are not used.
    """
    digest = hashlib.sha256("\n".join((profile, *gauge_names)).encode()).digest()
    return 1 + int.from_bytes(digest[:2], "big") % 65534


def profile_layout(
    profile: str,
    gauge_names: Sequence[str],
    cycle_time: float,
    identifiers: Identifiers | None = None,
    key: AuthenticationKey | None = None,
    has_tare: bool = False,
    readings: Mapping[str, str] | None = None,
) -> InputLayout:
    """Return the frames of ``profile`` for gauges in the order of ``gauge_names``, sent every ``cycle_time`` [s].

    ``key`` is the key of profile fd64-sec; without it frames are described, but neither encoded nor checked.
    ``has_tare`` adds the frame that asks for a tare, ``readings`` the frames of auxiliary sensors and thrust:
    their units by name of the estimator's input.

    Raises
    ------
    InputError
        There is no such profile, it has no key, or it needs more identifiers than there are.
    """
    if profile not in PROFILES:
        raise InputError(f"profile: expected one of {', '.join(PROFILES)}, got '{profile}'")
    if key is not None and profile != SECURED_PROFILE:
        raise InputError(
            f"key: expected profile {SECURED_PROFILE}, got '{profile}', whose frames are not authenticated"
        )
    identifiers = identifiers or Identifiers()
    readings = readings or {}
    configuration = configuration_of(profile, (*gauge_names, *readings))
    names = signal_names(gauge_names)
    if profile in ("fd64", SECURED_PROFILE):
        layout = _fd64(profile, names, cycle_time=cycle_time, identifiers=identifiers, configuration=configuration)
        layout = replace(layout, key=key)
    else:
        layout = _classic(
            profile, names, cycle_time=cycle_time, identifiers=identifiers, configuration=configuration
        )
    of_sensors = _reading_frames(layout, identifiers, configuration, readings)
    layout = replace(layout, flow_frames=(*layout.flow_frames, *of_sensors))
    if has_tare:
        layout = replace(layout, command=_tare_command(layout, identifiers, configuration))
    identifiers.checked(len(layout.frames), 1)
    return layout


def _reading_frames(
    layout: InputLayout, identifiers: Identifiers, configuration: int, readings: Mapping[str, str]
) -> tuple[InputFrame, ...]:
    """Return the frames of auxiliary sensors and thrust, on identifiers behind the other frames'."""
    is_fd, is_secured = layout.strain_frames[0].layout.is_fd, layout.name == SECURED_PROFILE
    per_frame = READINGS_PER_SECURED_FRAME if is_secured else READINGS_PER_FD_FRAME if is_fd else 1
    frames = reading_frames(
        identifiers.base + len(layout.frames),
        readings,
        signal_names([one.removeprefix(SENSOR_PREFIX) for one in readings], "Sensor"),
        per_frame=per_frame,
        is_extended=identifiers.is_extended,
        cycle_time=layout.cycle_time,
        sender=SENDER,
        configuration=configuration if is_fd else None,
        byte_order=BIG if layout.name == "classic-be" else LITTLE,
    )
    if is_secured:
        return tuple(replace(one, layout=_secured(one.layout, 64)) for one in frames)
    return frames


def _tare_command(layout: InputLayout, identifiers: Identifiers, configuration: int) -> InputFrame:
    """Return the frame of a tare, on the identifier behind the other frames'."""
    is_fd = layout.strain_frames[0].layout.is_fd
    command = tare_frame(
        identifiers.base + len(layout.frames),
        is_extended=identifiers.is_extended,
        cycle_time=layout.cycle_time,
        sender=SENDER,
        configuration=configuration if is_fd else None,
        byte_order=BIG if layout.name == "classic-be" else LITTLE,
    )
    is_secured = layout.name == SECURED_PROFILE
    return replace(command, layout=_secured(command.layout, 32)) if is_secured else command


def signal_names(gauge_names: Sequence[str], kind: str = "gauge") -> list[str]:
    """Return a distinct C identifier for every gauge, or other ``kind`` of sensor, as DBC files require."""
    names: list[str] = []
    for number, gauge in enumerate(gauge_names, start=1):
        name = re.sub(r"\W+", "_", gauge, flags=re.ASCII)[:28]
        if not re.match(r"[A-Za-z_]", name) or name in names:
            name = f"{kind}_{number}_{name}"[:32]
        names.append(name)
    return names


def _fd64(
    profile: str, names: list[str], cycle_time: float, identifiers: Identifiers, configuration: int
) -> InputLayout:
    """Return the layout of profile fd64 or fd64-sec."""
    is_secured = profile == SECURED_PROFILE
    per_frame = GAUGES_PER_SECURED_FRAME if is_secured else GAUGES_PER_FD_FRAME
    head = (*header_5(), status_signal(24, 8), sample_time_signal(32))
    frames = []
    for number, first in enumerate(range(0, len(names), per_frame)):
        chosen = names[first : first + per_frame]
        strains = tuple(strain_signal(name, 64 + 16 * index, LITTLE) for index, name in enumerate(chosen))
        layout = FrameLayout(
            name=f"Strain{number + 1}",
            identifier=identifiers.base + 1 + number,
            length=64,
            signals=(*head, *strains, configuration_signal(64 + 16 * per_frame, configuration)),
            is_extended=identifiers.is_extended,
            is_fd=True,
            protection=Protection(5, _STRAIN_DATA_ID + number),
            cycle_time=cycle_time,
            sender=SENDER,
            comment="Strains; all frames of a cycle have the same counter and sample time",
        )
        indices = tuple(range(len(head), len(head) + len(chosen)))
        frames.append(
            InputFrame(
                layout=_secured(layout, 64) if is_secured else layout,
                indices=indices,
                gauges=tuple(range(first, first + len(chosen))),
                to_strain=(_MICRO,) * len(chosen),
                sample_time=3,
                status=2,
                configuration=len(head) + len(chosen),
            )
        )
    pressure = FrameLayout(
        name="DynamicPressure",
        identifier=identifiers.base,
        length=16,
        signals=(*head, pressure_signal(64, LITTLE), configuration_signal(96, configuration)),
        is_extended=identifiers.is_extended,
        is_fd=True,
        protection=Protection(5, _PRESSURE_DATA_ID),
        cycle_time=cycle_time,
        sender=SENDER,
        comment="Dynamic pressure; send it ahead of the strains of the same time",
    )
    navigation = FrameLayout(
        name="Navigation",
        identifier=identifiers.base + 1 + len(frames),
        length=16,
        signals=(
            *head,
            mach_signal(64, LITTLE),
            altitude_signal(80, LITTLE),
            configuration_signal(96, configuration),
        ),
        is_extended=identifiers.is_extended,
        is_fd=True,
        protection=Protection(5, _NAVIGATION_DATA_ID),
        cycle_time=cycle_time,
        sender=SENDER,
        comment=_NAVIGATION_TEXT,
    )
    if is_secured:
        pressure, navigation = _secured(pressure, 32), _secured(navigation, 32)
    flow_frames = (
        InputFrame(layout=pressure, flow=_pressure_at(4), sample_time=3, status=2, configuration=5),
        InputFrame(layout=navigation, flow=_navigation_at(4), sample_time=3, status=2, configuration=6),
    )
    return InputLayout(
        name=profile,
        n_gauges=len(names),
        strain_frames=tuple(frames),
        flow_frames=flow_frames,
        cycle_time=cycle_time,
    )


def _secured(layout: FrameLayout, length: int) -> FrameLayout:
    """Return ``layout`` with ``length`` bytes, of which the last are freshness value and authenticator."""
    assert layout.protection is not None
    end = length - SECURED_BYTES
    return replace(
        layout,
        length=length,
        signals=(*layout.signals, *freshness_signals(8 * end)),
        protection=replace(layout.protection, end=end),
        secured=Secured(layout.protection.data_id, end),
    )


def _classic(
    profile: str, names: list[str], cycle_time: float, identifiers: Identifiers, configuration: int
) -> InputLayout:
    """Return the layout of a profile of 8 byte frames."""
    order = BIG if profile == "classic-be" else LITTLE
    per_frame = 2 if profile == "float2" else 4
    frames = []
    for number, first in enumerate(range(0, len(names), per_frame)):
        chosen = names[first : first + per_frame]
        if profile == "float2":
            strains = tuple(float_strain_signal(name, 32 * index) for index, name in enumerate(chosen))
        else:
            strains = tuple(
                strain_signal(name, 16 * index + (7 if order == BIG else 0), order)
                for index, name in enumerate(chosen)
            )
        layout = FrameLayout(
            name=f"Strain{number + 1}",
            identifier=identifiers.base + 1 + number,
            length=8,
            signals=strains,
            is_extended=identifiers.is_extended,
            cycle_time=cycle_time,
            sender=SENDER,
            comment="Strains, covered by the CRC of the cycle's trailer",
        )
        gauges = tuple(range(first, first + len(chosen)))
        frames.append(
            InputFrame(
                layout=layout, indices=tuple(range(len(chosen))), gauges=gauges, to_strain=(_MICRO,) * len(chosen)
            )
        )
    trailer = FrameLayout(
        name="StrainTrailer",
        identifier=identifiers.base + 1 + len(frames),
        length=8,
        signals=(*header_5(), status_signal(24, 8), sample_time_signal(39 if order == BIG else 32, order)),
        is_extended=identifiers.is_extended,
        # The configuration as DataID: a cycle with other gauges never passes the CRC.
        protection=Protection(5, configuration),
        cycle_time=cycle_time,
        sender=SENDER,
        comment="Ends a cycle; its CRC covers bytes 2 to 7, then the data of Strain1, Strain2 .. and the DataID",
    )
    pressure = FrameLayout(
        name="DynamicPressure",
        identifier=identifiers.base,
        length=8,
        signals=(
            *header_1(),
            status_signal(12, 4),
            pressure_signal(23 if order == BIG else 16, order),
            short_sample_time(order),
        ),
        is_extended=identifiers.is_extended,
        protection=Protection(1, _PRESSURE_DATA_ID),
        cycle_time=cycle_time,
        sender=SENDER,
        comment="Dynamic pressure; send it ahead of the strains of the same time",
    )
    navigation = FrameLayout(
        name="Navigation",
        identifier=identifiers.base + 2 + len(frames),
        length=8,
        signals=(
            *header_1(),
            status_signal(12, 4),
            mach_signal(23 if order == BIG else 16, order),
            altitude_signal(39 if order == BIG else 32, order),
            short_sample_time(order),
        ),
        is_extended=identifiers.is_extended,
        protection=Protection(1, _NAVIGATION_DATA_ID),
        cycle_time=cycle_time,
        sender=SENDER,
        comment=_NAVIGATION_TEXT,
    )
    return InputLayout(
        name=profile,
        n_gauges=len(names),
        strain_frames=tuple(frames),
        flow_frames=(
            InputFrame(layout=pressure, flow=_pressure_at(3), sample_time=4, tick=1e-4, status=2),
            InputFrame(layout=navigation, flow=_navigation_at(3), sample_time=5, tick=1e-4, status=2),
        ),
        trailer=InputFrame(layout=trailer, sample_time=3, status=2, is_trailer=True),
        cycle_time=cycle_time,
    )


def _pressure_at(index: int) -> tuple[FlowSignal, ...]:
    return (FlowSignal(quantity=DYNAMIC_PRESSURE, index=index),)


def _navigation_at(index: int) -> tuple[FlowSignal, ...]:
    """Return Mach number and altitude, side by side from ``index`` on."""
    return FlowSignal(quantity=MACH_NUMBER, index=index), FlowSignal(quantity=ALTITUDE, index=index + 1)
