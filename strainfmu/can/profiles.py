"""The profiles, frame layouts that need no DBC file: each is one file of the folder ``profiles``.

A file states the frames of any number of gauges and sensors; signals.toml holds the signals that profiles share.
The names of gauges and sensors, their number, identifiers, period and configuration number come from the user: no
DBC file could hold them all, so that ``strainfmu dbc`` writes one from the same frames.
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from strainfmu.can.authentic import AuthenticationKey, Secured
from strainfmu.can.frame import EXTENDED_FLAG, Protection
from strainfmu.can.frame_layout import (
    BIG,
    FLOW_QUANTITIES,
    LITTLE,
    ROLES,
    FlowSignal,
    FrameLayout,
    InputFrame,
    InputLayout,
    SignalLayout,
)
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.units import STRAIN_UNITS

_FOLDER = Path(__file__).parent / "profiles"
_SHARED = "signals"

SECURED_PROFILE = "fd64-sec"

PROFILES = ("fd64", "classic-le", SECURED_PROFILE)

SENDER = "StrainSender"
BRIDGE = "StrainBridge"

E2E_CRC, E2E_COUNTER = "E2E_CRC", "E2E_Counter"
"""Signals of the end-to-end protection, which are written when all others are."""

BASE, BASE_OF_MANY = 0x300, 0x200
"""Identifiers of the first input frame of a profile where the user states none."""

_READING = "reading"
_UNITS = {"1": "m/m"}
"""Units of FMI that a DBC file writes otherwise."""


@dataclass(frozen=True)
class Identifiers:
    """Identifiers of the frames of a profile.

    Attributes
    ----------
    base : identifier of the frame of q_inf; strain frames, the trailer and the frame of navigation follow. The
        frame ahead of it holds the state of the sender; with base 0 there is none. None for :data:`BASE`, or
        :data:`BASE_OF_MANY` where the frames would reach the first result's.
    result_base : identifier of the first result frame.
    is_extended : 29 bit identifiers.
    """

    base: int | None = None
    result_base: int = 0x380
    is_extended: bool = False

    def base_of(self, n_input: int) -> int:
        """Return the identifier of the first of ``n_input`` input frames behind the state of the sender."""
        if self.base is not None:
            return self.base
        return BASE if BASE + n_input <= Identifiers.result_base else BASE_OF_MANY

    def checked(self, n_input: int, n_result: int) -> Identifiers:
        """Return self if ``n_input`` input and ``n_result`` result frames have identifiers of their own.

        Raises
        ------
        InputError
            Identifiers overlap or do not exist.
        """
        limit = EXTENDED_FLAG >> 2 if self.is_extended else 0x800
        base = self.base_of(n_input)
        first_input = max(base - 1, 0)
        for name, first, count in (
            ("input", first_input, n_input + base - first_input),
            ("result", self.result_base, n_result),
        ):
            if first < 0 or first + count > limit:
                raise InputError(
                    f"{name} identifiers: 0x{first:X} and {count - 1} more found, 0 to 0x{limit - 1:X} allowed"
                )
        if first_input < self.result_base + n_result and self.result_base < base + n_input:
            raise InputError(
                f"result identifiers: expected others than the input's, 0x{first_input:X} to "
                f"0x{base + n_input - 1:X}, got 0x{self.result_base:X} and {n_result - 1} more"
            )
        return self


def configuration_of(profile: str, gauge_names: Sequence[str]) -> int:
    """Return the 16 bit number that identifies an assignment of gauges to frames.

    The first two bytes of the SHA-256 of profile and gauge names in their order; 0 and 65535 are not used.
    """
    digest = hashlib.sha256("\n".join((profile, *gauge_names)).encode()).digest()
    return 1 + int.from_bytes(digest[:2], "big") % 65534


def signal_names(gauge_names: Sequence[str], kind: str = "gauge") -> list[str]:
    """Return a distinct C identifier for every gauge, or other ``kind`` of sensor, as DBC files require."""
    names: list[str] = []
    for number, gauge in enumerate(gauge_names, start=1):
        name = re.sub(r"\W+", "_", gauge, flags=re.ASCII)[:28]
        if not re.match(r"[A-Za-z_]", name) or name in names:
            name = f"{kind}_{number}_{name}"[:32]
        names.append(name)
    return names


@cache
def stated_file(name: str) -> Mapping[str, Any]:
    """Return what a file of the folder states: a profile, the shared signals, or the results."""
    return tomllib.loads((_FOLDER / f"{name}.toml").read_text("utf-8"))


LARGEST_DYNAMIC_PRESSURE: float = stated_file(_SHARED)[DYNAMIC_PRESSURE]["maximum"]
"""Dynamic pressure [Pa] above which there are no coefficients."""


@cache
def _profile(name: str) -> Mapping[str, Any]:
    """Return what a profile states; what it is like states the entries and signals that it does not."""
    stated = stated_file(name)
    before = _profile(stated["like"]) if "like" in stated else {"signal": stated_file(_SHARED)}
    return {**_merged(before, stated), "signal": {**before["signal"], **stated.get("signal", {})}}


def _merged(before: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of ``before``, in their order, replaced by entries of ``changes``, table by table."""
    merged = {**before, **changes}
    for name, entry in changes.items():
        if isinstance(entry, Mapping) and isinstance(before.get(name), Mapping):
            merged[name] = _merged(before[name], entry)
    return merged


def result_form_of(profile: str) -> str:
    """Return the form of the result frames for a profile."""
    return str(_profile(profile)["results"])


def shared_signal(field: str, first_bit: int) -> SignalLayout:
    """Return the signal ``field`` of signals.toml, little endian, at its place in a frame."""
    return placed_signal(stated_file(_SHARED)[field], first_bit, LITTLE)


def placed_signal(stated: Mapping[str, Any], first_bit: int, byte_order: str, **known: Any) -> SignalLayout:
    """Return a signal; ``byte_order`` is for one that states none, ``known`` are fields that the user gives.

    A big endian signal begins with the highest bit of its first byte.
    """
    fields = {name: value for name, value in stated.items() if name in SignalLayout.__dataclass_fields__}
    fields = {"byte_order": byte_order, **fields, **known}
    start = first_bit + 7 if fields["byte_order"] == BIG else first_bit
    choices = tuple((number, text) for number, text in stated.get("choices", ()))
    return SignalLayout(**{**fields, "start": start, "choices": choices})


_Measured = tuple[int | str, str, str]
"""A gauge by its number, or another input of the estimator by its name; its signal, and its unit if stated."""


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
    identifiers, readings = identifiers or Identifiers(), readings or {}
    names = signal_names(gauge_names)
    reading_names = signal_names([reading.removeprefix(SENSOR_PREFIX) for reading in readings], "Sensor")
    measured: dict[str, list[_Measured]] = {
        STRAIN: [(index, name, "") for index, name in enumerate(names)],
        _READING: [
            (reading, name, _UNITS.get(unit, unit))
            for (reading, unit), name in zip(readings.items(), reading_names, strict=True)
        ],
    }
    maker = _Maker(
        profile=_profile(profile),
        cycle_time=cycle_time,
        base=identifiers.base_of(0),
        is_extended=identifiers.is_extended,
        configuration=configuration_of(profile, (*gauge_names, *readings)),
    )
    frames = maker.frames(measured, has_tare)
    n_input = sum(frame.session is None for frame in frames)
    identifiers.checked(n_input, 1)
    if (base := identifiers.base_of(n_input)) != maker.base:
        frames = replace(maker, base=base).frames(measured, has_tare)
    return InputLayout(
        name=profile,
        n_gauges=len(names),
        strain_frames=tuple(frame for frame in frames if frame.gauges),
        flow_frames=tuple(frame for frame in frames if frame.flow),
        trailer=next((frame for frame in frames if frame.is_trailer), None),
        command=next((frame for frame in frames if frame.request is not None), None),
        state=next((frame for frame in frames if frame.session is not None), None),
        cycle_time=cycle_time,
        key=key,
        shares_clock=True,
    )


@dataclass(frozen=True)
class _Maker:
    """Makes the frames of a profile of what its file states, with period [s], first identifier, configuration."""

    profile: Mapping[str, Any]
    cycle_time: float
    base: int
    is_extended: bool
    configuration: int

    def frames(self, measured: Mapping[str, Sequence[_Measured]], has_tare: bool) -> list[InputFrame]:
        """Return all frames in the order of their identifiers; ``measured`` are gauges and readings."""
        made: list[InputFrame] = []
        alone: list[InputFrame] = []
        for name, stated in self.profile["frame"].items():
            if "request" in stated["fields"] and not has_tare:
                continue
            if "place" in stated:
                if self.base + stated["place"] >= 0:
                    alone.append(self._frame(name, stated, stated["place"], 0, ()))
                continue
            repeated = next((kind for kind in measured if kind in stated["fields"]), None)
            if repeated is None:
                made.append(self._frame(name, stated, len(made), 0, ()))
                continue
            size = stated["per_frame"]
            for number, first in enumerate(range(0, len(measured[repeated]), size)):
                chosen = measured[repeated][first : first + size]
                made.append(self._frame(f"{name}{number + 1}", stated, len(made), number, chosen))
        return [*made, *alone]

    def _frame(
        self, name: str, stated: Mapping[str, Any], place: int, number: int, chosen: Sequence[_Measured]
    ) -> InputFrame:
        """Return the frame at the ``place`` of all, the ``number`` of its kind, with the ``chosen`` signals."""
        signals: list[SignalLayout] = []
        roles: dict[str, int] = {}
        tick = InputFrame.tick
        for field, first_bit in stated["fields"].items():
            definition = self.profile["signal"][field]
            role = definition.get("role", field)
            roles[role] = len(signals)
            tick = definition.get("tick", tick) if role == "sample_time" else tick
            signals += self._signals(role, definition, first_bit, chosen)
        first = roles.get(STRAIN, roles.get(_READING, 0))
        indices = tuple(range(first, first + len(chosen))) if STRAIN in roles else ()
        flow = [(role, roles[role]) for role in roles if role in FLOW_QUANTITIES]
        if _READING in roles:
            flow = [(str(source), first + index) for index, (source, _, _) in enumerate(chosen)]
        layout = FrameLayout(
            name=name,
            identifier=self.base + place,
            length=stated["length"],
            signals=tuple(signals),
            is_extended=self.is_extended,
            is_fd=self.profile["fd"],
            cycle_time=self.cycle_time,
            sender=SENDER,
            comment=stated["comment"],
        )
        if "end_to_end" in stated:
            layout = self._protected(layout, stated["end_to_end"], number, roles.get("message_counter"))
        return InputFrame(
            layout=layout,
            indices=indices,
            gauges=tuple(int(source) for source, _, _ in chosen) if indices else (),
            to_strain=tuple(STRAIN_UNITS[signals[index].unit] for index in indices),
            flow=tuple(FlowSignal(quantity=quantity, index=index) for quantity, index in flow),
            tick=tick,
            is_trailer=stated.get("ends_cycle", False),
            **{role: roles.get(role) for role in ROLES},
        )

    def _signals(
        self, role: str, definition: Mapping[str, Any], first_bit: int, chosen: Sequence[_Measured]
    ) -> list[SignalLayout]:
        """Return the signal of a role; of strains and readings one for each of the ``chosen``, side by side."""
        order = self.profile["byte_order"]
        if role == "configuration":
            return [placed_signal(definition, first_bit, order, initial=self.configuration)]
        if role not in (STRAIN, _READING):
            return [placed_signal(definition, first_bit, order)]
        return [
            placed_signal(
                definition,
                first_bit + definition["length"] * index,
                order,
                name=name,
                unit=unit or definition.get("unit", ""),
                comment=definition["comment"].replace("INPUT", str(source)),
            )
            for index, (source, name, unit) in enumerate(chosen)
        ]

    def _protected(
        self, layout: FrameLayout, stated: Mapping[str, Any], number: int, freshness: int | None
    ) -> FrameLayout:
        """Return a frame, ``number`` of its kind, with its protection; ``freshness`` is the message counter."""
        data_id = self.configuration if stated["data_id"] == "configuration" else stated["data_id"] + number
        if freshness is None:
            return replace(layout, protection=Protection(stated["profile"], data_id))
        end = layout.signals[freshness].start // 8
        protection = Protection(stated["profile"], data_id, end)
        return replace(layout, protection=protection, secured=Secured(data_id, end))
