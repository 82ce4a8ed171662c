"""Documentation page of an estimator FMU: what the map computes, where it holds, and how to cite it."""

from html import escape
from math import atan2, degrees

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.valid_ranges import all_ranges
from strainfmu.fmu.documentation.index_page import Section
from strainfmu.fmu.documentation.run_panels import estimate_figure, fault_span
from strainfmu.fmu.reference_run.run import TRUTH, ReferenceRun, is_usual
from strainfmu.interface.health_names import STATE
from strainfmu.interface.input_names import NOT_KNOWN
from strainfmu.interface.parameter_variables import parameter_names
from strainfmu.interface.sensor_variables import THRUST, has_thrust, sensor_names
from strainfmu.pages import table_html
from strainfmu.version import __version__

_DERIVATIVES = (
    "Directional derivatives, of the native kind, exist for values: coefficients, loads, air data, by what a "
    "host sets. They belong to the estimate that steps with the same inputs end at. Sigmas, chi-square and health "
    "have none."
)

_LIMITS = (
    "sigma is one standard deviation: gauge noise and what the map's model leaves out, for conditions like those "
    "above, and the error of the dynamic pressure that dynamic_pressure_std states. C_A is the fore-body's: "
    "base pressure is not measured by strain. Pressure patterns that leave the gauges without strain cannot be "
    "seen.",
    "A gauge whose strain is not finite or beyond sensor_range, or whose valid is false, is left out, exactly as "
    "if the map had been built without it; sigma and alarm levels follow, and no output depends on its strain. "
    "The first step without a gauge costs more than those after it.",
    "The start value of a strain is no reading: a gauge whose strain was never set is left out, and health.state "
    "is INVALID while none is set. It is INVALID too where all strains are exactly 0 in a flow.",
    "Outputs belong to the inputs last set: right after initialization, after any set, after a step and without "
    "one. An importer that holds inputs over a step records at its end what belongs to its start: estimates then "
    "lag by one communication step. So does every connection of a master that steps all FMUs at once.",
    "Flow and navigation are not given where they are 0 or below (or NaN): dynamic_pressure_std is the map's own "
    "then, and mach_number and altitude need not be given. dynamic_pressure must be given, 1e-6 to 1e7 Pa. Where "
    "Mach number and altitude are given, it must agree with 0.7 M² p(h) of the US Standard Atmosphere 1976; if "
    "not, or if the flight or the estimated coefficients leave what the map covers, health.state is OUTSIDE.",
    "Loads assume a quasi-static structure: vibration reads as load. The tunable parameters may be set at "
    "any time; a value outside min and max is refused.",
    _DERIVATIVES,
)

_FLIGHT_LIMITS = (
    "sigma is one standard deviation: gauge noise, installation errors, pressure off the tables, and the flight "
    "state that strain and navigation leave open. C_A is the fore-body's: strain does not measure base pressure.",
    _LIMITS[1],
    "The start value of a strain is no reading: a gauge whose strain was never set is left out, and health.state "
    "is INVALID while none is set. It is INVALID too where all strains are exactly 0.",
    "Each step starts from the flight state of the step before, or from a search of the tables: in the first "
    "step, and every tenth while strain does not fit them. Outputs belong to the inputs last set; what is set "
    "after a step belongs to the next one, whether or not it has been taken.",
    "dynamic_pressure, mach_number, altitude and static_pressure come from navigation. Each is not given where it "
    "is 0 or below (or NaN); so is a standard deviation: the map's own counts then. The one that contradicts "
    "strain and the others is left out: then its navigation_used is false, and health.state is DEGRADED.",
    "Where strain does not fit the tables, loads and coefficients are the linear map's, if "
    "dynamic_pressure is known: health.linear_loads. Air data are not to be used then, nor where identified "
    "is false.",
    _LIMITS[5],
    _DERIVATIVES,
)

_WEIGHTS = {
    False: "by one fixed affine map",
    True: "by an affine map whose weights follow the dynamic pressure, so that one map serves any altitude",
}
"""By whether the map follows the dynamic pressure."""

_CITATION = """@misc{strainload,
  title  = {Real-time aerodynamic load estimation for hypersonics via strain-based inverse maps},
  author = {Pham, J. V. and Ghattas, O. and Clemens, N. T. and Willcox, K. E.},
  year   = {2024}, eprint = {2408.15286}, archivePrefix = {arXiv}
}"""


def estimator_sections(inverse_map: InverseMap, content_hash: str, run: ReferenceRun) -> list[Section]:
    """Return the sections of the estimator's page before its tables."""
    return [
        ("How to use it", _use(inverse_map)),
        (
            "What it computes",
            [
                f"From the strains of {inverse_map.n_strain_gauges} gauges{_and_sensors(inverse_map)} it "
                f"estimates the aerodynamic forces and moments {_how(inverse_map)}, each with its standard "
                "deviation. A state of health states how far they can be trusted.",
                f"Vehicle: {escape(inverse_map.vehicle)}. S = {inverse_map.reference_area:.6g} m², "
                f"L = {inverse_map.reference_length:.6g} m. Map: <code>{content_hash}</code>.",
                "Body axes: x aft from the nose tip, y starboard, z up. SI units; strain in m/m.",
            ],
        ),
        ("Validity", _validity(inverse_map)),
        ("Limits", _limits(inverse_map)),
        (
            "Example",
            [*_example(inverse_map, run), estimate_figure(inverse_map, run)],
        ),
        ("Gauges", [_gauge_table(inverse_map)]),
        *([("Sensors", _sensors(inverse_map))] if inverse_map.has_auxiliary_sensors else []),
        *([("Temperature", _temperature(inverse_map.thermal))] if inverse_map.has_temperature else []),
        (
            "How to cite",
            [
                f"The method, and strainfmu {__version__} with the hash of the map:",
                f"<pre>{escape(_CITATION)}</pre>",
            ],
        ),
    ]


def _use(inverse_map: InverseMap) -> list[str]:
    """Return what a user does first: connect inputs, choose a step size, look at the health."""
    needed = "<code>dynamic_pressure</code> [Pa]"
    if inverse_map.manifold is not None:
        needed += ", <code>mach_number</code> and <code>static_pressure</code> [Pa] or <code>altitude</code> [m]"
    further = ", and the sensors, temperatures and parameters listed below" if _has_more(inverse_map) else ""
    return [
        f"Connect <code>strain</code> 1 to {inverse_map.n_strain_gauges} [m/m], NaN for a gauge that is lost, "
        f"{needed}{further}.",
        "Step size: the time between two samples of strain. Any size is allowed, and sizes may vary.",
        "Use loads and coefficients where <code>health.usable</code> is true. While <code>health.state</code> is "
        "INVALID or UNIDENTIFIED they are NaN, with their standard deviations and air data, unless a filter holds "
        "them; chi-square and envelope score are 0 then, and the limit is the one of all gauges. While it is "
        "NO_COEFFICIENTS the coefficients are NaN.",
    ]


def _has_more(inverse_map: InverseMap) -> bool:
    return inverse_map.has_auxiliary_sensors or inverse_map.has_temperature or bool(parameter_names(inverse_map))


def _limits(inverse_map: InverseMap) -> list[str]:
    inertia = str(inverse_map.provenance.get("inertia", ""))
    general = _LIMITS if inverse_map.manifold is None else _FLIGHT_LIMITS
    return [*general, *([escape(f"Inertia: {inertia}.")] if inertia else [])]


def _and_sensors(inverse_map: InverseMap) -> str:
    """Return words for the auxiliary sensors, if there are any."""
    count = inverse_map.n_gauges - inverse_map.n_strain_gauges
    return f" and the readings of {count} auxiliary sensor{'s' if count > 1 else ''}" if count else ""


def _how(inverse_map: InverseMap) -> str:
    """Return how the loads are estimated, and what else is."""
    if inverse_map.manifold is not None:
        return (
            "by the flight state that fits them and navigation best, on tables over Mach number, incidence and "
            "pressure; and with them the coefficients and the air data"
        )
    return f"{_WEIGHTS[inverse_map.follows_pressure]}, and from those and the dynamic pressure the coefficients"


def _example(inverse_map: InverseMap, run: ReferenceRun) -> list[str]:
    """Return what the reference run shows: the flight, the fault, and how the estimate fares."""
    fault, state = run.fault, run.outputs[STATE]
    assert fault is not None
    begin, end = fault_span(run)
    is_ok = (state == HealthState.OK) & ~fault.fails
    count = int(np.sum(is_ok))
    good = f"In {count} of the {np.sum(~fault.fails)} samples without the fault health.state is OK"
    if count:
        errors = [
            np.abs(run.outputs[name] - run.truth[name]) / run.outputs[f"sigma.{name}"]
            for name in COEFFICIENT_NAMES
        ]
        good += f"; the largest error of a coefficient in them is {np.max(np.array(errors)[:, is_ok]):.1f} sigma"
    not_ok = state[~fault.fails & ~is_ok]
    if len(not_ok):
        good += f". In the others it is {_states(not_ok)}"
    if len(not_ok) and inverse_map.manifold is not None and is_usual(run):
        steps = POLICIES.return_after
        good += f": loads are the linear map's until strain has fitted the tables {steps} times in a row"
    return [
        f"A flight of {run.time[-1]:g} s that the snapshots cover, with its air data, is in "
        "extra/org.fmi-standard.fmi-ls-ref: inputs and the outputs to expect. True values are in "
        f"{TRUTH}. Errors of strain are as large as the map states; air data are wrong by half a standard "
        "deviation. Outputs belong to the inputs of the sample before.",
        f"From {begin:g} to {end:g} s (shaded) {_kind(inverse_map, fault.gauge)} "
        f"{escape(inverse_map.gauge_names[fault.gauge])}, number {fault.gauge + 1}, reads "
        f"{_reading(inverse_map, fault.gauge, fault.size)} too much. health.state is then "
        f"{_states(state[fault.fails])}, and health.suspect_gauge "
        f"{_numbers(run.outputs['health.suspect_gauge'][fault.fails])}.",
        f"{good}.",
    ]


def _states(state: FloatArray) -> str:
    """Return the names of the states of health met, in their order."""
    return ", ".join(HealthState(int(value)).name for value in sorted(set(state.tolist())))


def _numbers(values: FloatArray) -> str:
    return ", ".join(f"{value:g}" for value in sorted(set(values.tolist())))


def _validity(inverse_map: InverseMap) -> list[str]:
    rows = [(limits.quantity, limits.text) for limits in all_ranges(inverse_map)]
    return [
        "The map was built from flight conditions in these ranges. Outside them the estimate is an extrapolation, "
        "and sigma need not hold.",
        table_html(("Quantity", "Range"), rows, caption="Ranges of the snapshots"),
    ]


def _temperature(thermal: ThermalMap) -> list[str]:
    """Return what temperatures do, and the sensors."""
    rows = [
        (str(number), name, f"{std:.3g}")
        for number, (name, std) in enumerate(
            zip(thermal.sensor_names, thermal.sensor_std.tolist(), strict=True), start=1
        )
    ]
    text = (
        "The wall's temperature causes strain: the part that known temperatures determine is subtracted, the rest "
        "is in sigma. A temperature that is 0 or below, NaN or 2000 K from "
        f"{thermal.reference_temperature:g} K is not known; the first step after a sensor comes or goes costs "
        "some milliseconds."
    )
    return [text, table_html(("No.", "Sensor", "Sigma [K]"), rows, caption="Sensors in the order of temperature")]


def _kind(inverse_map: InverseMap, row: int) -> str:
    return "gauge" if row < inverse_map.n_strain_gauges else "sensor"


def _reading(inverse_map: InverseMap, row: int, value: float) -> str:
    """Return what a row of the map reads at ``value`` [m/m], with its unit."""
    sensors = inverse_map.sensors
    if row < inverse_map.n_strain_gauges:
        return f"{1e6 * value:.3g} um/m"
    return f"{sensors.scale[row] * value:.3g} {sensors.unit[row]}"


def _sensors(inverse_map: InverseMap) -> list[str]:
    """Return what the auxiliary sensors are, and how they are used."""
    sensors, first = inverse_map.sensors, inverse_map.n_strain_gauges
    rows = [
        (
            str(row + 1),
            name,
            sensors.kind[row],
            *_place(inverse_map, row),
            _reading(inverse_map, row, float(inverse_map.noise_std[row])),
            f"{sensors.largest[row]:.4g} {sensors.unit[row]}",
        )
        for row, name in enumerate(sensor_names(inverse_map), start=first)
    ]
    text = (
        "Each is an input with a unit of its own, and has a flag of valid behind the gauges' flags: its number "
        "is the same in valid and health.suspect_gauge. One that is not finite, beyond its range, or not valid is "
        "left out as a gauge is. Zeros and tare are for the strain gauges: give readings less zeros of their "
        "own."
    )
    headings = ("No.", "Input", "Kind", "x [m]", "Roll [deg]", "Direction x, y, z", "Noise sigma", "Range")
    return [
        text + (_THRUST_TEXT if has_thrust(inverse_map) else ""),
        table_html(headings, rows, caption="Auxiliary sensors"),
    ]


_THRUST_TEXT = (
    f" The input {THRUST}, forward along the axis, is taken off what sensors read of it; where it is not known, "
    f"NaN or {NOT_KNOWN:g}, those that it moves are left out."
)


def _place(inverse_map: InverseMap, row: int) -> tuple[str, str, str]:
    """Return station, roll angle and direction of a row of the map."""
    x, y, z = inverse_map.gauge_position[row].tolist()
    direction = ", ".join(f"{part:.3g}" for part in inverse_map.gauge_direction[row].round(9) + 0.0)
    return f"{x:.4g}", f"{degrees(atan2(y, z)) % 360.0:.4g}", direction


def _gauge_table(inverse_map: InverseMap) -> str:
    rows = [
        (str(row + 1), name, *_place(inverse_map, row), f"{1e6 * inverse_map.noise_std[row]:.3g}")
        for row, name in enumerate(inverse_map.gauge_names[: inverse_map.n_strain_gauges])
    ]
    headings = ("No.", "Gauge", "x [m]", "Roll [deg]", "Direction x, y, z", "Noise sigma [um/m]")
    return table_html(headings, rows, caption="Gauges in the order of the strains")
