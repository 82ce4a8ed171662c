"""Documentation page of a plant FMU: its flight model and trajectory."""

from html import escape

from strainfmu.cosim.models.flight_model import FlightModel
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.fmu.documentation.index_page import Section
from strainfmu.interface.fmi_variables import UNITS
from strainfmu.interface.plant_variables import GaugeFault, Motion


def plant_sections(model: FlightModel, trajectory: Trajectory, content_hash: str) -> list[Section]:
    """Return the sections of the plant's page before its table."""
    return [
        (
            "What it computes",
            [
                f"It flies a stored trajectory of {trajectory.stop_time:g} s and gives the strains that "
                f"{model.n_gauges} gauges would measure, with noise, and the true coefficients to compare "
                "with. After its end the last flight condition stays.",
                "The noise is drawn at every communication point; equal seed and steps give the same noise.",
                f"Vehicle: {escape(model.vehicle)}. Flight model: <code>{content_hash}</code>.",
            ],
        ),
        _limits(model),
    ]


def native_plant_sections(model: FlightModel, motion: Motion, content_hash: str) -> list[Section]:
    """Return the sections of the native plant's page before its table."""
    flight = {
        Motion.INPUTS: "The flight condition is its input.",
        Motion.TRAJECTORY: "It flies a stored trajectory; after its end the last flight condition stays.",
        Motion.SHORT_PERIOD: "Angle of attack and pitch rate follow from the aerodynamic and a control moment, at "
        "constant speed and without gravity: a' = q - q_inf S C_N/(m V), I q' = q_inf S L (M_P + C q L/(2 V)) "
        "+ M_control. Runge-Kutta steps of at most 1 ms; the control moment is constant over a step.",
    }[motion]
    faults = ", ".join(f"{int(kind)} {kind.name.lower()}" for kind in GaugeFault)
    return [
        (
            "What it computes",
            [
                f"The strains that {model.n_gauges} gauges would measure, with noise, and the true coefficients "
                f"to compare with. {flight}",
                "The noise is drawn for every communication point; equal seed and steps give the same noise, to "
                "the last bit on every platform.",
                f"Gauges fail by their <code>fault_kind</code>: {faults}.",
                f"Vehicle: {escape(model.vehicle)}. Flight model: <code>{content_hash}</code>.",
            ],
        ),
        _limits(
            model,
            "Outside, outputs are NaN and <code>fmi2DoStep</code> returns <code>fmi2Discard</code>; the importer "
            "is requested to end the simulation (<code>fmi2Terminated</code>), and the condition is logged once.",
        ),
    ]


def _limits(model: FlightModel, *outside: str) -> Section:
    """Return where the flight model ends, and what happens ``outside``."""
    return (
        "Limits",
        [
            f"Mach number {model.mach_knots[0]:g} to {model.mach_knots[-1]:g}, total incidence 0 to "
            f"{_degrees(model.incidence_knots[-1]):g} deg, geopotential altitude 0 to 71 km, US Standard "
            "Atmosphere 1976. Steady aerodynamics and a quasi-static structure: no dynamics of either.",
            *outside,
        ],
    )


def _degrees(angle: float) -> float:
    """Return ``angle`` [rad] in degrees, with the factor of the display unit."""
    return angle * next(unit for unit in UNITS if unit.name == "rad").display_units[0].factor
