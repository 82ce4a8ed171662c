"""The set-up of a bridge: from the options of the command line to a bridge that is ready to run; its DBC file."""

import secrets
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from strainfmu.can.authentic import AuthenticationKey, FreshnessKeeper, freshness_file, load_key
from strainfmu.can.frame_layout import FrameLayout, InputLayout
from strainfmu.can.listener import BusListener, Clock, Taps
from strainfmu.can.machine import Machine
from strainfmu.can.options import RESULT_FORMS, BridgeOptions, BridgeSettings, checked_cycle_time
from strainfmu.can.profiles import SECURED_PROFILE, configuration_of, profile_layout, result_form_of
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.tare import Taring
from strainfmu.cosim.estimators.step import (
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
from strainfmu.files import write_bytes_atomically


def live_listener(
    stack: ExitStack,
    step: Step,
    options: BridgeOptions,
    gauge_names: Sequence[str],
    taps: Taps,
    is_answered: bool = True,
) -> tuple[BusListener, Taring | None, FreshnessKeeper | None]:
    """Return a listener whose machine begins now, its tares, and what remembers the freshness value on ``stack``.

    There is no such memory of frames that are not authenticated.
    """
    machine, results, configuration, taring = make_machine(
        step,
        options,
        gauge_names,
        start=taps.clock(),
        first=secrets.randbelow(256),
        now=taps.clock,
        is_answered=is_answered,
    )
    keeper, authentication, layout = None, machine.authentication, machine.layout
    if authentication is not None and layout.key is not None and options.key_file is not None:
        path = options.freshness_file or freshness_file(options.key_file, "bridge")
        keeper = stack.enter_context(FreshnessKeeper(path, layout.key, authentication, layout.cycle_time))
    return BusListener(machine, results, configuration, taps), taring, keeper


def make_machine(
    step: Step,
    options: BridgeOptions,
    gauge_names: Sequence[str],
    *,
    start: float,
    first: int = 0,
    now: Clock | None = None,
    is_answered: bool = True,
) -> tuple[Machine, tuple[FrameLayout, ...], int, Taring | None]:
    """Return a machine that begins at ``start`` [s], the frames of its results, the number of the gauge
    assignment, tares.

    ``now`` is the clock of a live run, None for results that are sent when they are ready. Without ``is_answered``
    no result goes out.
    """
    checked_cycle_time(options.cycle_time, "cycle time")
    settings = BridgeSettings.of(options)
    layout, configuration = input_layout(options, gauge_names, reading_units_of(step), step)
    groups = load_groups_of(step)
    results = result_layouts(result_form(options, layout), options.identifiers, layout.cycle_time, groups)
    options.identifiers.checked(1, len(results))
    protection = results[0].protection
    modulus = 256 if protection is None else protection.counter_modulus
    machine = Machine(
        layout,
        step,
        settings,
        start=start,
        own=[frame.key for frame in results],
        dynamic_pressure=options.dynamic_pressure,
        is_answered=is_answered,
        counters=(first % modulus, modulus),
        now=now,
    )
    taring = _taring(step, options, gauge_names, settings)
    machine.on_cycle = None if taring is None else taring.take
    return machine, results, configuration, taring


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

    inverse_map = load_inverse_map(options.tare)
    if tuple(inverse_map.gauge_names[: inverse_map.n_strain_gauges]) != tuple(gauge_names):
        raise InputError(f"{options.tare}: expected a map of the estimator's gauges, got one of others")
    known = None
    if options.tare_known is not None:
        from strainfmu.cosim.estimators.zeros_file import load_known_strain

        known = load_known_strain(options.tare_known, gauge_names)
    judge = Estimator(inverse_map.without_tables())
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
    from strainfmu.can.dbc_files import load_database, load_mapping
    from strainfmu.can.dbc_mapping import mapped_layout

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
    """
    from strainfmu.cosim.estimators.source import open_step

    names, readings, _ = stated_in(source)
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


def stated_in(source: Path) -> tuple[tuple[str, ...], dict[str, str], tuple[LoadGroup, ...]]:
    """Return what a map or an FMU states: strain gauges, the unit of each auxiliary sensor and of thrust by name
    of the input, and the groups of the loads that it gives in addition to the five."""
    if source.suffix == ".fmu":
        from strainfmu.cosim.estimators.description import gauge_names_of, load_groups_in, reading_units_in

        return gauge_names_of(source), reading_units_in(source), load_groups_in(source)
    from strainfmu.estimator.map.inverse_map import groups_of_outputs, load_inverse_map
    from strainfmu.interface.sensor_variables import reading_units

    inverse_map = load_inverse_map(source)
    return (
        tuple(inverse_map.gauge_names[: inverse_map.n_strain_gauges]),
        reading_units(inverse_map),
        groups_of_outputs(inverse_map),
    )


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


def write_dbc(source: Path, output: Path, options: BridgeOptions) -> int:
    """Write the DBC file of the frames for a map, or its FMU; return its number of frames.

    With a DBC file of the user's own as input, it holds the frames of the results alone.
    """
    from strainfmu.can.dbc_writer import dbc_text

    layouts = all_layouts(source, options)
    of_input = f"profile {options.profile}" if options.dbc is None else f"results for {options.dbc.name}"
    text = dbc_text(layouts, f"{source.name}, {of_input}")
    write_bytes_atomically(output, text.encode("cp1252", "replace"))
    return len(layouts)


def all_layouts(source: Path, options: BridgeOptions) -> list[FrameLayout]:
    """Return every frame of a profile, input, then results; of a user's own DBC file the results alone."""
    checked_cycle_time(options.cycle_time, "cycle time")
    layout, _, _ = map_input_layout(options, source, needs_key=False)
    identifiers = options.identifiers
    results = result_layouts(result_form(options, layout), identifiers, layout.cycle_time, stated_in(source)[2])
    n_input = len(layout.frames) - (layout.state is not None)
    identifiers.checked(n_input if options.dbc is None else 1, len(results))
    of_input = [frame.layout for frame in layout.frames] if options.dbc is None else []
    return [*of_input, *results]
