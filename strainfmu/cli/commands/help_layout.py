"""The order of the help: commands in panels with their pages, options in panels, and options that go together."""

from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import TARE
from strainfmu.flight_condition import ALTITUDE, ANGLE_OF_ATTACK, MACH_NUMBER
from strainfmu.public_names import public_names

COMMANDS: dict[str, dict[str, tuple[str, str]]] = {
    "Use a map": {
        "estimate": ("recordings", "docs/howto/estimate_recorded.md"),
        "channels": ("recordings", "docs/howto/recorder_channels.md"),
        "export": ("maps", "docs/tutorials/fmu_in_tools.md"),
        "bridge": ("can_bus", "docs/howto/run_bridge.md"),
        TARE: ("recordings", "docs/howto/tare.md"),
        "inspect": ("maps", "docs/reference/files.md"),
        "monitor": ("recordings", "docs/howto/watch_live.md"),
        "crosscheck": ("maps", "docs/evidence/verification.md"),
    },
    "Build": {
        "demo": ("whole_way", "docs/tutorials/first_map.md"),
        "check": ("whole_way", "docs/tutorials/your_vehicle.md"),
        "build": ("maps", "docs/tutorials/your_vehicle.md"),
        "snapshots": ("flows", "docs/howto/run_campaigns.md"),
        "structure": ("structures", "docs/explanation/structure.md"),
        "surface": ("flows", "docs/howto/bring_cfd.md"),
        "convert": ("flows", "docs/howto/bring_cfd.md"),
        "picture": ("flows", "docs/explanation/reports.md"),
    },
    "Ground test": {
        "loadtest": ("ground_tests", "docs/howto/design_ground_test.md"),
        "calibrate": ("ground_tests", "docs/howto/calibrate_map.md"),
        "equations": ("ground_tests", "docs/howto/load_equations.md"),
    },
    "Bus": {
        "dbc": ("can_bus", "docs/reference/can.md"),
        "send": ("can_bus", "docs/howto/record_and_replay.md"),
        "replay": ("recordings", "docs/howto/record_and_replay.md"),
    },
    "Studies": {
        "place": ("placements", "docs/howto/place_gauges.md"),
        "review": ("placements", "docs/howto/place_gauges.md"),
        "study": ("studies", "docs/howto/choose_gauges_and_case.md"),
        "trial": ("studies", "docs/howto/what_a_map_notices.md"),
        "stress": ("studies", "docs/howto/what_a_map_notices.md"),
        "compare": ("studies", "docs/evidence/comparison.md"),
        "fly": ("flights", "docs/howto/fly_closed_loop.md"),
        "plant": ("flights", "docs/explanation/flight.md"),
        "bench": ("maps", "docs/reference/step_time.md"),
        "reproduce": ("studies", "docs/evidence/reproduction.md"),
    },
}
"""Panels of ``strainfmu --help`` in their order, the commands of each; their module here, and their page."""

MODULES = {name: module for commands in COMMANDS.values() for name, (module, _) in commands.items()}
PAGES = {name: page for commands in COMMANDS.values() for name, (_, page) in commands.items()}

FUNCTIONS: dict[str, tuple[str, ...]] = {
    "bench": (
        *("strainfmu.bench", "strainfmu.bench_worst", "strainfmu.bench_peers"),
        *("builder.bench_structure", "builder.bench_meshes", "builder.bench_gauges"),
    ),
    "dbc": ("strainfmu.dbc", "strainfmu.dbc_template"),
    "estimate": ("strainfmu.estimate", "builder.write_flight_page", "builder.estimate_recordings"),
    "fly": ("strainfmu.fly", "builder.flight_figures"),
    "loadtest": ("builder.loadtest", "builder.loadtest_template"),
    "monitor": ("strainfmu.serve_monitor",),
    "reproduce": ("builder.reproduce_paper",),
    "structure": ("builder.run_structure", "builder.export_loads", "builder.export_influence"),
    "study": ("builder.run_study",),
    TARE: ("strainfmu.tare", "builder.known_strain"),
    "trial": ("builder.run_trial",),
}
"""Public functions of commands that have several, or another name: modules have the command's."""

FILES = ("snapshots", "structure", "rebuild")

OPTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "estimate": {
        "Recording": ("channels", "ignore_columns", "exclude", "zeros", DYNAMIC_PRESSURE),
        "Filter": ("filter_seconds", "smooth"),
        "Checks of the data": ("accept_strain_level", "accept_held"),
        "Results": ("columns", "residuals", "field", "field_every"),
        "Processes": ("scheduler", "workers", "part_rows"),
    },
    "export": {
        "Kind of FMU": ("kind", "fmi", "scalars", "inputs", "platforms", "estimator", "bus"),
        "Zero offsets": ("zero_inputs", "tare_known"),
    },
    "bridge": {"Bus": ("bus", "settings", "interface", "channel", "option", "profile")},
    TARE: {
        "Limits": ("max_dynamic_pressure", "largest_zero", "largest_drift", "accept"),
        "Known loads": (
            "vehicle",
            "weight_up_roll_deg",
            "weight_nose_deg",
            "ambient_pressure",
            "known_output",
        ),
    },
    "demo": {
        "Vehicle as flown": ("perfect", "as_built"),
        "CAN bus": ("can", "can_duration", "can_authenticated"),
        "Files": FILES,
    },
    "build": {"Files": FILES},
    "snapshots": {
        "Flow": ("sets", "engine", "grid"),
        "Processes": ("scheduler", "workers"),
    },
    "structure": {
        "Mesh": ("resolution", "model", "mesh_unit", "by_position", "allow_locking", "solver"),
        "Another code": ("export_loads", "load_format", "snapshots", "export_influence"),
    },
    "loadtest": {
        "Loads": (
            "force",
            "directions",
            "stations",
            "roll_angles",
            "attitudes",
            "pad_length",
            "pad_angle",
            "pressure",
            "axial",
            "largest_strain",
            "load_cells",
        ),
        "Errors of the loads": ("load_error", "cell_error"),
    },
    "send": {"Bus": ("bus", "settings", "interface", "channel", "option", "profile")},
    "place": {
        "Candidates": ("stations", "roll_angles", "directions", "pairs", "keep"),
        "Limits": ("spacing", "forbid", "budget", "costs"),
        "Goals": ("goal", "loads", "estimator", "robust", "starts"),
    },
    "trial": {
        "Choice": ("only", "estimators"),
        "Effort": ("conditions", "draws", "seed"),
        "Processes": ("scheduler", "workers"),
        "Files": FILES,
    },
    "stress": {"Effort": ("conditions", "draws", "seed"), "Files": FILES},
    "compare": {"Effort": ("conditions", "draws", "training", "seed"), "Files": FILES},
    "plant": {
        "Motion": ("motion", "trajectory"),
        "Start values": (MACH_NUMBER, ALTITUDE, ANGLE_OF_ATTACK, "sideslip"),
    },
    "bench": {
        "Structure": ("structure", "solver", "largest"),
        "Mesh": ("mesh", "snapshots", "output"),
        "Gauges": ("gauges", "most", "growth"),
    },
}
"""Panels of the options of a command; options in none of them stand in the first panel, *Options*."""

NEEDS: dict[str, dict[str, tuple[str, ...]]] = {
    "estimate": {"smooth": ("filter_seconds",), "field_every": ("field",)},
    TARE: {
        "vehicle": ("weight_up_roll_deg", "ambient_pressure"),
        "weight_up_roll_deg": ("vehicle",),
        "weight_nose_deg": ("weight_up_roll_deg",),
        "ambient_pressure": ("vehicle",),
        "known_output": ("vehicle",),
    },
    "demo": {"can_duration": ("can",), "can_authenticated": ("can",)},
    "structure": {"load_format": ("export_loads",)},
    "bench": {
        "solver": ("structure", "mesh"),
        "largest": ("structure",),
        "snapshots": ("mesh", "gauges"),
        "output": ("mesh",),
        "most": ("gauges",),
        "growth": ("gauges",),
    },
}
"""Options that are refused without one of others, by the names of the parameters."""

OLD_VALUES = {("--estimator", "manifold"): "nonlinear"}
"""Values of options that have a new name."""

EXCLUDES: dict[str, tuple[tuple[str, ...], ...]] = {
    "demo": (("perfect", "as_built"),),
    "loadtest": tuple((name, "template") for name in ("cases", "snapshots", *OPTIONS["loadtest"]["Loads"])),
    "structure": (("export_loads", "export_influence"),),
    **dict.fromkeys(("stress", "trial"), tuple((name, "inverse_map") for name in (*FILES, "estimator"))),
    "bench": (("structure", "mesh", "gauges", "worst", "peers"),),
}
"""Options of which one at most is given, by the names of the parameters."""


def public_functions(command: str) -> tuple[str, ...]:
    """Return the public functions that a command calls, with their packages."""
    run_time = command in public_names("strainfmu")
    return FUNCTIONS.get(command) or (f"{'strainfmu' if run_time else 'builder'}.{command}",)
