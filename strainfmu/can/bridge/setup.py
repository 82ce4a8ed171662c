"""The set-up of a bridge: from the options of the command line to a bridge that is ready to run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from strainfmu.can.bridge.bus.opening import BusSettings, configured, open_bus
from strainfmu.can.bridge.keepers.freshness_file import FreshnessKeeper, freshness_file
from strainfmu.can.bridge.keepers.zeros_keeper import ZerosKeeper
from strainfmu.can.bridge.options import RESULT_FORMS, BridgeOptions
from strainfmu.can.bridge.results.layouts import result_layouts
from strainfmu.can.bridge.run_loop import Bridge
from strainfmu.can.cycle.core import BridgeCore, bridge_core
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.estimate.taring import Taring
from strainfmu.can.e2e.clock import Clock, monotonic
from strainfmu.can.settings import BridgeSettings, checked_cycle_time
from strainfmu.can.wire.authenticator import AuthenticationKey, load_key
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import NAVIGATION, FrameLayout, InputLayout
from strainfmu.can.wire.libraries import import_can
from strainfmu.can.wire.profiles import SECURED_PROFILE, configuration_of, profile_layout, result_form_of
from strainfmu.cosim.estimators.step import (
    OTHER_LOAD_OUTPUTS,
    PARAMETERS,
    Step,
    load_groups_of,
    other_inputs,
    parameter_names_of,
    parameter_std_names_of,
    reading_units_of,
    sensor_names_of,
)
from strainfmu.errors import InputError
from strainfmu.estimator.other_loads import LoadGroup
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.interface.input_names import OTHER_AIR_DATA

UNPROTECTED_TEXT = (
    "UNPROTECTED: no CRC with counter covers every byte of the input; errors of transmission may pass unseen, and "
    "no result is VALID"
)
"""Word at the start of a bridge whose input is not protected end to end."""

UNLOADED_TEXT = (
    "tare: strains of own weight and of ambient air count as zeros; state them as tare.known where they matter"
)
"""Word at the start of a bridge that takes tares without knowing of loads on the ground."""


@dataclass(frozen=True, kw_only=True)
class Taps:
    """The clock of a running bridge and the functions that it calls, which must not block.

    Attributes
    ----------
    on_received, on_sent : called with every frame and its time, in the order of their times; a sent one that comes
        back is not received once more.
    on_result : called with every result after it was sent.
    on_zeros : called with zeros of the gauges that the estimator takes off from then on, given or of a tare.
    outputs : other outputs of the estimator that results hold, as far as it has them.
    """

    clock: Clock = monotonic
    on_received: Callable[[Frame], None] | None = None
    on_sent: Callable[[Frame], None] | None = None
    on_result: Callable[[CycleResult], None] | None = None
    on_zeros: Callable[[GaugeZeros], None] = lambda _: None
    outputs: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ReadyBridge:
    """A bridge and its description; its core began at ``start`` [s] by its clock.

    ``freshness`` keeps the freshness value of authenticated frames; None where they are not authenticated.
    ``zeros`` keeps the zeros of tares; None where tares are not taken.
    ``start_lines`` say what a user must know before the run: options that were not given, lack of protection.
    """

    bridge: Bridge
    n_gauges: int
    layout_name: str
    start: float
    freshness: FreshnessKeeper | None = None
    zeros: ZerosKeeper | None = None
    start_lines: tuple[str, ...] = ()


@contextmanager
def make_bridge(fmu: Path, options: BridgeOptions, taps: Taps | None = None) -> Iterator[ReadyBridge]:
    """Load the FMU, connect a bridge to it, and free the FMU at the end.

    Raises
    ------
    InputError
        An option, a file or the FMU is wrong.
    StrainfmuError
        Something needed is not installed, or the FMU cannot be loaded.
    """
    import_can()
    from strainfmu.cosim.estimators.fmu_step import SENSORS, TEMPERATURE, FmuStep
    from strainfmu.cosim.estimators.step import ENVELOPE_SCORE
    from strainfmu.cosim.estimators.zeros_file import load_zeros

    taps, bus = taps or Taps(), bus_settings(options)
    key_of(options)  # refused before the FMU is unpacked
    outputs = (ENVELOPE_SCORE, OTHER_LOAD_OUTPUTS, *taps.outputs)
    inputs = (*NAVIGATION, *OTHER_AIR_DATA, TEMPERATURE, SENSORS, PARAMETERS)
    with FmuStep(fmu, inputs, outputs) as step, ExitStack() as stack:
        if options.zeros is not None:
            step.set_zeros(given := load_zeros(options.zeros, step.gauge_names))
            taps.on_zeros(given)
        start = taps.clock()
        core, results, configuration = make_core(step, options, gauge_names=step.gauge_names, start=start)
        keeper = _freshness_keeper(core, options)
        if keeper is not None:
            stack.enter_context(keeper)
        zeros = None
        if core.taring is not None:
            path, source = options.tare_output or Path("zeros.toml"), f"{options.interface}:{options.channel}"
            zeros = stack.enter_context(ZerosKeeper(path, step.gauge_names, source, taps.on_zeros))
            core.taring.on_end = zeros.ended
        bridge = Bridge(
            core,
            lambda: open_bus(bus),
            result_layouts=results,
            configuration=configuration,
            clock=taps.clock,
            on_result=taps.on_result,
            on_received=taps.on_received,
            on_sent=taps.on_sent,
        )
        lines = [str(found) for found in configured(bus)]
        if not core.layout.is_protected:
            lines.append(UNPROTECTED_TEXT)
        if options.tare is not None and options.tare_known is None:
            lines.append(UNLOADED_TEXT)
        yield ReadyBridge(
            start_lines=tuple(lines),
            bridge=bridge,
            n_gauges=step.n_gauges,
            layout_name=core.layout.name,
            start=start,
            freshness=keeper,
            zeros=zeros,
        )


def _freshness_keeper(core: BridgeCore, options: BridgeOptions) -> FreshnessKeeper | None:
    """Return what remembers the freshness value of a core, None if its frames are not authenticated."""
    authentication, key = core.authentication, core.layout.key
    if authentication is None or key is None or options.key_file is None:
        return None
    path = options.freshness_file or freshness_file(options.key_file, "bridge")
    return FreshnessKeeper(path, key, authentication=authentication, cycle_time=core.layout.cycle_time)


def make_core(
    step: Step, options: BridgeOptions, gauge_names: Sequence[str], start: float
) -> tuple[BridgeCore, tuple[FrameLayout, ...], int]:
    """Return a core that begins at ``start`` [s], the frames of its results, the number of the gauge assignment.

    Raises
    ------
    InputError
        An option or a file is wrong.
    """
    checked_cycle_time(options.cycle_time, "cycle time")
    settings = BridgeSettings.of(options)
    layout, configuration = input_layout(options, gauge_names, reading_units_of(step), step)
    groups = load_groups_of(step)
    results = result_layouts(result_form(options, layout), options.identifiers, layout.cycle_time, groups)
    options.identifiers.checked(1, len(results))
    own_keys = [frame.key for frame in results]
    core = bridge_core(
        layout,
        step,
        settings,
        start=start,
        own_keys=own_keys,
        dynamic_pressure=options.dynamic_pressure,
        taring=_taring(step, options, gauge_names, settings),
    )
    return core, results, configuration


def _taring(
    step: Step, options: BridgeOptions, gauge_names: Sequence[str], settings: BridgeSettings
) -> Taring | None:
    """Return what takes the zeros of the gauges on command, None if the options do not allow it."""
    if options.tare is None:
        return None
    set_zeros = getattr(step, "set_zeros", None)
    if set_zeros is None:
        raise InputError("tare.map: expected an estimator that takes zero offsets of its gauges")
    require_zero_inputs = getattr(step, "require_zero_inputs", None)  # of an FMU
    if require_zero_inputs is not None:
        require_zero_inputs()
    from strainfmu.estimator.estimator import Estimator
    from strainfmu.estimator.map.inverse_map import load_inverse_map

    held = load_inverse_map(options.tare)
    if tuple(held.gauge_names[: held.n_strain_gauges]) != tuple(gauge_names):
        raise InputError(f"{options.tare}: expected a map of the estimator's gauges, got one of others")
    known = None
    if options.tare_known is not None:
        from strainfmu.cosim.estimators.zeros_file import load_known_strain

        known = load_known_strain(options.tare_known, gauge_names)
    judge = Estimator(held.without_tables())
    return Taring(judge, set_zeros, options.tare_cycles, said_for=round(settings.alarm_cycles), known=known)


def input_layout(
    options: BridgeOptions,
    gauge_names: Sequence[str],
    readings: Mapping[str, str] | None = None,
    step: Step | None = None,
    needs_key: bool = True,
) -> tuple[InputLayout, int]:
    """Return the input frames of a profile or a DBC file, and the number of the gauge assignment.

    ``readings`` are the units of the estimator's inputs for auxiliary sensors and thrust, by name; ``step`` is the
    estimator, whose other inputs a mapping may name. Without ``needs_key`` frames are described only.

    Raises
    ------
    InputError
        A file or an option is wrong.
    """
    key, readings = key_of(options) if needs_key else None, readings or {}
    of_all = (*gauge_names, *readings)
    if options.dbc is None or options.mapping is None:
        layout = profile_layout(
            options.profile,
            gauge_names,
            cycle_time=options.cycle_time,
            identifiers=options.identifiers,
            key=key,
            has_tare=options.tare is not None,
            readings=readings,
        )
        return layout, configuration_of(options.profile, of_all)
    if options.tare is not None:
        raise InputError("tare.map: expected with a profile, whose frames hold the command, got it with input.dbc")
    from strainfmu.can.wire.dbc_files import load_database, load_mapping
    from strainfmu.can.wire.dbc_mapping import mapped_layout

    layout = mapped_layout(
        load_database(options.dbc),
        load_mapping(options.mapping),
        gauge_names=gauge_names,
        name=str(options.mapping),
        sensor_names=() if step is None else sensor_names_of(step),
        parameter_names=() if step is None else parameter_names_of(step),
        parameter_std_names=() if step is None else parameter_std_names_of(step),
        flow_names=() if step is None else other_inputs(step),
        readings=readings,
    )
    return layout, configuration_of(options.dbc.name, of_all)


def map_input_layout(
    options: BridgeOptions, source: Path, needs_key: bool = True
) -> tuple[InputLayout, tuple[str, ...], dict[str, str]]:
    """Return the input frames for the gauges of a map or an FMU, their names, and the units of its other readings.

    ``needs_key`` as of :func:`input_layout`.

    Raises
    ------
    InputError
        A file or an option is wrong.
    """
    from strainfmu.cosim.estimators.source import open_step

    names, readings = map_gauge_names(source), map_reading_units(source)
    if options.dbc is None:
        return input_layout(options, names, readings, needs_key=needs_key)[0], names, readings
    with open_step(source) as ready:
        return input_layout(options, names, readings, ready.step)[0], names, readings


def key_of(options: BridgeOptions) -> AuthenticationKey | None:
    """Return the key of authenticated frames, None of others.

    Raises
    ------
    InputError
        There is a key where none is used, or none where one is needed, or the file holds none.
    StrainfmuError
        The package cryptography is not installed.
    """
    is_needed = options.dbc is None and options.profile == SECURED_PROFILE
    for name, path in (("input.key", options.key_file), ("input.freshness", options.freshness_file)):
        if path is not None and not is_needed:
            raise InputError(f"{name}: expected with profile {SECURED_PROFILE} alone, got it with other frames")
    if not is_needed:
        return None
    if options.key_file is None:
        raise InputError(f"input.key: expected a key file for profile {SECURED_PROFILE}, got none")
    return load_key(options.key_file)


def map_gauge_names(source: Path) -> tuple[str, ...]:
    """Return the strain gauges of a map or an FMU."""
    if source.suffix == ".fmu":
        from strainfmu.cosim.estimators.description import gauge_names_of

        return gauge_names_of(source)
    from strainfmu.estimator.map.inverse_map import load_inverse_map

    found = load_inverse_map(source)
    return tuple(found.gauge_names[: found.n_strain_gauges])


def map_reading_units(source: Path) -> dict[str, str]:
    """Return the unit of each auxiliary sensor and of thrust by name of the input of a map or an FMU."""
    if source.suffix == ".fmu":
        from strainfmu.cosim.estimators.description import reading_units_in

        return reading_units_in(source)
    from strainfmu.estimator.map.inverse_map import load_inverse_map
    from strainfmu.interface.sensor_variables import reading_units

    return reading_units(load_inverse_map(source))


def map_load_groups(source: Path) -> tuple[LoadGroup, ...]:
    """Return the groups of the loads that a map or an FMU gives in addition to the five."""
    if source.suffix == ".fmu":
        from strainfmu.cosim.estimators.description import load_groups_in

        return load_groups_in(source)
    from strainfmu.estimator.map.inverse_map import load_inverse_map
    from strainfmu.estimator.map.offers import groups_of_outputs

    return groups_of_outputs(load_inverse_map(source))


def result_form(options: BridgeOptions, layout: InputLayout) -> str:
    """Return the form of the result frames, stated or the input's.

    Raises
    ------
    InputError
        There is no such form.
    """
    form = options.result_form
    if form is None:
        if options.dbc is None:
            return result_form_of(options.profile)
        return "fd" if any(frame.layout.is_fd for frame in layout.frames) else "classic-le"
    if form not in RESULT_FORMS:
        raise InputError(f"results.form: expected one of {', '.join(RESULT_FORMS)}, got '{form}'")
    return form


def bus_settings(options: BridgeOptions) -> BusSettings:
    """Return the bus; options that are numbers become numbers."""
    chosen: dict[str, object] = {}
    for item in options.bus_options:
        key, equals, text = item.partition("=")
        if not equals or not key.strip():
            raise InputError(f"--bus-option: expected KEY=VALUE, got '{item}'")
        words = {"true": True, "false": False}
        try:
            chosen[key.strip()] = words[text.lower()] if text.lower() in words else int(text, 0)
        except ValueError:
            chosen[key.strip()] = text
    context = chosen.pop("config_context", None)
    return BusSettings(
        interface=options.interface,
        channel=options.channel,
        options=chosen,
        context=options.bus_context if context is None else str(context),
    )
