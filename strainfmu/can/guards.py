"""The guards between the bus and a valid result, each of which a test can take away to show what it is for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Guards:
    """All on in every bridge that runs; a test switches one off and must then see a wrong result.

    Attributes
    ----------
    own_frames : frames on the bridge's own identifiers are not taken for input.
    error_frames, remote_frames : neither is decoded.
    format : length, CAN FD flag and identifier width must be those of the layout.
    babbling : more frames per time than a sender can mean are shed.
    crc, counter : E2E check of protected frames, and of the trailer.
    configuration : frames of another gauge assignment are refused.
    state_machine : data are used in E2E state VALID alone.
    order : frames older than the open cycle are refused.
    completeness : gauges of missing frames are left out, not held.
    silence : a status goes out when nothing comes in.
    age : strains older than allowed are not used.
    pace : after a pause cycles without a sample time must come at a sender's pace.
    clock_jump : a jump of the sender's clock starts everything anew.
    frozen : cycles that repeat themselves grow old.
    stuck : a single gauge that does not change is left out.
    zero : a gauge that drops to exactly zero is left out.
    not_available, range, rate : a gauge that says so, is beyond its limits or jumps is left out.
    sender_status : the sender's own verdict counts.
    pressure_age : q_inf that is too old is not used.
    health : the estimator's own verdict counts.
    finite_output : coefficients must be numbers.
    """

    own_frames: bool = True
    error_frames: bool = True
    remote_frames: bool = True
    format: bool = True
    babbling: bool = True
    crc: bool = True
    counter: bool = True
    configuration: bool = True
    state_machine: bool = True
    order: bool = True
    completeness: bool = True
    silence: bool = True
    age: bool = True
    pace: bool = True
    clock_jump: bool = True
    frozen: bool = True
    stuck: bool = True
    zero: bool = True
    not_available: bool = True
    range: bool = True
    rate: bool = True
    sender_status: bool = True
    pressure_age: bool = True
    health: bool = True
    finite_output: bool = True


ALL_GUARDS = Guards()
