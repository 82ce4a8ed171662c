"""Layouts scored by the whole nonlinear estimator on flights of the truth model, not by the criterion."""

from pathlib import Path

import pytest
from changed_vehicle import write_changed

from builder.campaign.snapshots import load_snapshots
from builder.pipeline.place_and_review import structure_of, write_layout
from builder.placement.candidates import CandidateGrid
from builder.placement.design import Aim, place, placement_study
from builder.placement.limits import Limits
from builder.reporting import Silent
from builder.study import run_study
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

pytestmark = pytest.mark.slow

COARSE = (
    ("surface_stations = 120", "surface_stations = 60"),
    ("surface_roll_angles = 72", "surface_roll_angles = 36"),
    ("element_length_mm = 10.0", "element_length_mm = 20.0"),
    ("surface_stations = 240", "surface_stations = 120"),
    ("surface_roll_angles = 144", "surface_roll_angles = 72"),
    ("element_length_mm = 6.0", "element_length_mm = 12.0"),
)
LAYOUTS = {"placed_36": 36, "placed_18": 18}
STUDY = """vehicle = "{vehicle}"
[set]
"map.alarm_levels" = "nominal"
[sweep]
"gauges.layout" = {layouts}
[trial]
conditions = 200
draws = {draws}
"""
CHANCE = 1.02
"""What 10,000 samples leave open in a ratio of two rms errors."""


def rms(folder: Path, file: Path, layouts: list[str], draws: int) -> dict[str, list[float]]:
    names = "[" + ", ".join(f'"{one}"' for one in layouts) + "]"
    path = folder / "study.toml"
    path.write_text(STUDY.format(vehicle=file.name, layouts=names, draws=draws))
    study = run_study(path, folder / "out", workers=1)
    assert study.faults == []
    of_loads = [row for row in study.rows if row["load"] in COEFFICIENT_NAMES]
    return {name: [row["rms"] for row in of_loads if row["gauges.layout"] == name] for name in layouts}


def test_36_placed_gauges_do_what_54_published_ones_do_and_18_err_by_1_6_times_at_most(tmp_path: Path) -> None:
    """The shipped vehicle on Euler flows: 200 conditions, 50 vehicles at each, installation errors drawn."""
    entries = "".join(f'[gauges.layouts.{name}]\nfile = "{name}.csv"\n\n' for name in LAYOUTS)
    file = write_changed(tmp_path, *COARSE)
    manoeuvre = "ic3x_manoeuvre.csv"
    (tmp_path / manoeuvre).write_bytes((VEHICLES / manoeuvre).read_bytes())
    rms(tmp_path, file, ["configuration_2"], 1)  # makes the flows
    vehicle = load_vehicle(file)
    assert vehicle.map.estimator == "nonlinear"
    snapshots = load_snapshots(tmp_path / "out" / "flows_0001" / "snapshots.h5")
    study = placement_study(vehicle, snapshots, structure_of(vehicle, snapshots, Silent()), CandidateGrid())
    for name, count in LAYOUTS.items():
        found = place(study, Limits(gauges=count, spacing=0.02), Aim(starts=5), Silent())
        write_layout(found.layout, tmp_path / f"{name}.csv")
    first = "[gauges.layouts.configuration_1]"
    file.write_text(file.read_text().replace(first, entries + first))
    found_rms = rms(tmp_path, file, ["configuration_2", *LAYOUTS], 50)
    own = found_rms["configuration_2"]
    for name, most in (("placed_36", CHANCE), ("placed_18", 1.6)):
        for coefficient, one, other in zip(COEFFICIENT_NAMES, found_rms[name], own, strict=True):
            assert one <= most * other, (name, coefficient)
