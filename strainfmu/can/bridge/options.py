"""The options of a bridge, as a user states them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from strainfmu.can.settings import StatedLimits
from strainfmu.can.wire.profiles import Identifiers

RESULT_FORMS = ("fd", "classic-le")

PUBLISH_RATE = 20.0
"""Largest number of results per second that go to displays where none is stated; a page draws fewer."""


@dataclass(frozen=True, kw_only=True)
class BridgeOptions(StatedLimits):
    """Options of a user, with the limits that may be stated; times in seconds.

    Attributes
    ----------
    bus_options : "key=value" of the interface.
    bus_context : of python-can's configuration, None for its default.
    profile : of the input where no ``dbc`` is given, with ``cycle_time`` [s] and ``identifiers.base``.
    dbc, mapping : the user's DBC file and its mapping, both or none.
    dynamic_pressure : fixed [Pa], or None to take it from its frame.
    result_form : one of RESULT_FORMS, None for the input's.
    key_file : key of profile fd64-sec, None of others.
    freshness_file : where the freshness value is remembered across runs, None for next to the key.
    zeros : file of what the gauges read without strain (zeros.toml), None for what the FMU was exported with.
    tare : map of the same gauges, with which tares are taken on command; None: they are not.
    tare_cycles : window of a tare [cycles].
    tare_known : file of the strains of the loads that act meanwhile, in the form of zeros; None for none.
    tare_output : where its zeros are written, None for zeros.toml.
    """

    interface: str
    channel: str
    bus_options: tuple[str, ...] = ()
    bus_context: str | None = None
    profile: str = "fd64"
    dbc: Path | None = None
    mapping: Path | None = None
    cycle_time: float = 0.01
    identifiers: Identifiers = field(default_factory=Identifiers)
    dynamic_pressure: float | None = None
    result_form: str | None = None
    key_file: Path | None = None
    freshness_file: Path | None = None
    zeros: Path | None = None
    tare: Path | None = None
    tare_cycles: int = 500
    tare_known: Path | None = None
    tare_output: Path | None = None
