"""Layouts: signals, as a DBC file describes them, the frames that hold them, and the input of a bridge."""

from dataclasses import dataclass, field

from strainfmu.can.authentic import AuthenticationKey, Secured
from strainfmu.can.frame import EXTENDED_FLAG, Protection
from strainfmu.estimator.air_inputs import AIR_INPUTS, FLOW_INPUTS, SAMPLE_INPUTS, STD
from strainfmu.estimator.air_inputs import ALTITUDE as ALTITUDE
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE as DYNAMIC_PRESSURE
from strainfmu.estimator.air_inputs import FLOW_QUANTITIES as FLOW_QUANTITIES
from strainfmu.estimator.air_inputs import MACH_NUMBER as MACH_NUMBER
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST

UNSIGNED, SIGNED, FLOAT = "unsigned", "signed", "float"
LITTLE, BIG = "little", "big"

NAVIGATION = FLOW_QUANTITIES[1:]
"""What the bridge takes from the bus besides strains and q_inf, by the names of the FMU's inputs.

Only q_inf is needed. Temperatures are ``temperature[k]``, see :func:`temperature_name`."""

MAPPED_QUANTITIES = tuple(
    sample_input.name
    for sample_input in SAMPLE_INPUTS
    if sample_input.name not in FLOW_INPUTS and not sample_input.is_std
)
"""Quantities, such as p_inf, that a mapping alone gives."""

FLOW_STDS = {air_input.name.removesuffix(STD): air_input.name for air_input in AIR_INPUTS if air_input.is_std}
"""The input for the standard deviation of each quantity that has one; only a mapping gives these."""

_TEMPERATURE = "temperature["


def temperature_name(number: int) -> str:
    """Return the name of the input for the temperature sensor ``number``, from 1."""
    return f"{_TEMPERATURE}{number}]"


LARGEST_PARAMETER = 1e8
"""Largest size of a flow parameter, and of its standard deviation, in its own unit; one beyond it is not known."""

_PARAMETER, _PARAMETER_STD = "parameter.", "parameter_std."


def is_parameter(quantity: str) -> bool:
    """Return whether ``quantity`` is a flow parameter, by the name of the FMU's input."""
    return quantity.startswith(_PARAMETER)


def is_parameter_std(quantity: str) -> bool:
    """Return whether ``quantity`` is the standard deviation of a flow parameter, by the FMU's input."""
    return quantity.startswith(_PARAMETER_STD)


def is_temperature(quantity: str) -> bool:
    """Return whether ``quantity`` is the temperature of a sensor."""
    return quantity.startswith(_TEMPERATURE)


def is_reading(quantity: str) -> bool:
    """Return whether ``quantity`` is the reading of an auxiliary sensor, or thrust, by the FMU's input."""
    return quantity.startswith(SENSOR_PREFIX) or quantity == THRUST


@dataclass(frozen=True, kw_only=True)
class SignalLayout:
    """One signal: physical value = raw * scale + offset.

    Attributes
    ----------
    start : bit number as in DBC: of the least significant bit if little, of the most significant if big endian;
        bit b of byte B has number 8 B + b.
    length : bits, 1 to 64; 16, 32 or 64 of a float.
    kind : UNSIGNED, SIGNED (two's complement) or FLOAT (IEEE 754).
    minimum, maximum : physical values outside are invalid; None for no limit.
    not_available : raw value that stands for "no value", and is sent for it; a float has NaN for it.
    other_no_value : further raw values that stand for "no value".
    initial : raw value that a sender starts with and, of a configuration, must keep.
    """

    name: str
    start: int
    length: int
    byte_order: str = LITTLE
    kind: str = UNSIGNED
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    not_available: int | None = None
    initial: int | None = None
    comment: str = ""
    choices: tuple[tuple[int, str], ...] = ()
    other_no_value: tuple[int, ...] = ()

    @property
    def no_value_codes(self) -> tuple[int, ...]:
        """All raw values that stand for "no value"."""
        return (*(() if self.not_available is None else (self.not_available,)), *self.other_no_value)

    @property
    def bits(self) -> tuple[int, ...]:
        """Numbers of its bits, the least significant first."""
        if self.byte_order == LITTLE:
            return tuple(range(self.start, self.start + self.length))
        # Big endian runs from the most significant bit down through a byte, then on to the next byte's bit 7.
        index = 8 * (self.start // 8) + 7 - self.start % 8
        return tuple(8 * (p // 8) + 7 - p % 8 for p in range(index + self.length - 1, index - 1, -1))


@dataclass(frozen=True, kw_only=True)
class FrameLayout:
    """One frame.

    Attributes
    ----------
    length : data bytes.
    protection : end-to-end protection, None for none.
    cycle_time : nominal period [s], None if it is sent on demand.
    sender : name of the node that sends it.
    multiplexer : signal and raw value that distinguish this layout from others of its identifier, or None.
    secured : authentication, None for none.
    """

    name: str
    identifier: int
    length: int
    signals: tuple[SignalLayout, ...]
    is_extended: bool = False
    is_fd: bool = False
    protection: Protection | None = None
    cycle_time: float | None = None
    sender: str = ""
    comment: str = ""
    multiplexer: tuple[SignalLayout, int] | None = None
    secured: Secured | None = None

    @property
    def key(self) -> int:
        """Identifier and its width in one number."""
        return self.identifier | EXTENDED_FLAG if self.is_extended else self.identifier

    def index_of(self, name: str) -> int:
        """Return the index of the signal ``name``."""
        return next(index for index, signal in enumerate(self.signals) if signal.name == name)


@dataclass(frozen=True, kw_only=True)
class FlowSignal:
    """A signal that holds a quantity of the flow or of navigation, a temperature, the reading of an auxiliary
    sensor, thrust, a flow parameter or its standard deviation.

    Attributes
    ----------
    quantity : of :data:`FLOW_QUANTITIES` or ``OTHER_AIR_DATA``, :func:`temperature_name`, or as of
        :func:`is_reading`, :func:`is_parameter` and :func:`is_parameter_std`.
    index : of the signal in its frame.
    to_si, offset : factor from the signal's unit to Pa, 1, m, K or the input's own, and what is added then.
    """

    quantity: str
    index: int
    to_si: float = 1.0
    offset: float = 0.0


ROLES = (
    *("sample_time", "status", "configuration", "request"),
    *("session", "heard_counter", "heard_time", "heard_delay"),
)
"""Numbers about a frame that are among its signals, by the fields of :class:`InputFrame`."""


@dataclass(frozen=True, kw_only=True)
class InputFrame:
    """A frame that the bridge reads, and the roles of its signals; indices are as in ``layout.signals``.

    Attributes
    ----------
    layout : the frame.
    indices : (k,) indices of the strain signals.
    gauges : (k,) gauge of each, from 0.
    to_strain : (k,) factor from the signal's unit to m/m.
    flow : its signals of flow, navigation and temperature.
    sample_time : index of the sender's clock, or None; ``tick`` its unit [s], its range is its length in bits.
    status : index of the sender's own status (0 good, 1 degraded, others: do not use), or None.
    configuration : index of the number that must equal its signal's ``initial``, or None.
    request : index of the number of a command to the bridge, or None.
    session, heard_counter, heard_time, heard_delay : of the state of the sender: number of its run; counter and
        sample time of the cycle that the last result heard answers, and for how long it was known then; or None.
    is_trailer : the frame ends a cycle, and its CRC covers the data of all strain frames.
    hold : of strains that come more slowly than cycles, the time for which they are used [s]; None of others.
    timeout : the time for which quantities of the flow are used [s]; None for the time of the settings.
    """

    layout: FrameLayout
    indices: tuple[int, ...] = ()
    gauges: tuple[int, ...] = ()
    to_strain: tuple[float, ...] = ()
    flow: tuple[FlowSignal, ...] = ()
    sample_time: int | None = None
    tick: float = 1e-6
    status: int | None = None
    configuration: int | None = None
    request: int | None = None
    session: int | None = None
    heard_counter: int | None = None
    heard_time: int | None = None
    heard_delay: int | None = None
    is_trailer: bool = False
    hold: float | None = None
    timeout: float | None = None


@dataclass(frozen=True, kw_only=True)
class InputLayout:
    """All frames that the bridge reads.

    Attributes
    ----------
    name : of the profile or the DBC file.
    n_gauges : n_d; every gauge has one signal.
    strain_frames : one cycle of strains.
    flow_frames : the frames of q_inf, Mach number, altitude and temperatures; each is in one of them or in none.
    trailer : the frame that ends a cycle, or None.
    command : the frame of commands to the bridge, or None.
    state : the frame with the state of the sender, or None.
    shares_clock : sample times of all frames are of one clock.
    cycle_time : nominal period [s].
    constants : inputs of the estimator that are the same in every cycle, and their values.
    key : of the frames that are authenticated; None where none is, or where only their layout matters.
    """

    name: str
    n_gauges: int
    strain_frames: tuple[InputFrame, ...]
    flow_frames: tuple[InputFrame, ...] = ()
    trailer: InputFrame | None = None
    command: InputFrame | None = None
    state: InputFrame | None = None
    shares_clock: bool = False
    cycle_time: float = 0.01
    constants: tuple[tuple[str, float], ...] = ()
    key: AuthenticationKey | None = None
    frames: tuple[InputFrame, ...] = field(init=False)

    def __post_init__(self) -> None:
        trailer = () if self.trailer is None else (self.trailer,)
        more_frames = tuple(frame for frame in (self.command, self.state) if frame is not None)
        object.__setattr__(self, "frames", (*self.strain_frames, *trailer, *self.flow_frames, *more_frames))

    @property
    def cycle_length(self) -> int:
        """Number of frames of a cycle that come in every one: without held strains, commands, navigation .."""
        of_flow = [f for f in self.flow_frames if any(s.quantity == DYNAMIC_PRESSURE for s in f.flow)]
        fast = [frame for frame in self.strain_frames if frame.hold is None]
        return len(of_flow) + len(fast) + (self.trailer is not None) + (self.state is not None)

    def frame_of(self, quantity: str) -> InputFrame | None:
        """Return the frame that holds a quantity, as :class:`FlowSignal` names it, or None."""
        for frame in self.flow_frames:
            if any(signal.quantity == quantity for signal in frame.flow):
                return frame
        return None

    @property
    def first_of_cycle(self) -> InputFrame:
        """The first strain frame that comes in every cycle."""
        return next(frame for frame in self.strain_frames if frame.hold is None)

    @property
    def is_timed(self) -> bool:
        """Every strain frame holds a sample time, which separates cycles."""
        return all(frame.sample_time is not None for frame in self.strain_frames)

    @property
    def is_authenticated(self) -> bool:
        """Frames hold an authenticator."""
        return any(frame.layout.secured is not None for frame in self.frames)

    @property
    def is_protected(self) -> bool:
        """A CRC with counter covers every byte that affects the result."""
        strains = self.trailer is not None or all(frame.layout.protection for frame in self.strain_frames)
        return strains and all(frame.layout.protection is not None for frame in self.flow_frames)
