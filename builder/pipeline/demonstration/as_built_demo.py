"""A vehicle as built, from its ground test to its flight: the map before the test, after it, and exact.

The vehicle is drawn from the tolerances of the section [calibration]. It is tested and flies on the independent
model, finer than the map's, with a wall of its own; the map sees the readings of the test alone.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from builder.calibration.after_test.calibrated_map import calibrated_map
from builder.calibration.after_test.left_by_test import Remaining
from builder.calibration.ground_test.ground_test_readings import read_load_test
from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.ground_test.load_test_file import read_test_file
from builder.calibration.score.simulated_test import simulate_ground_test, standard_load_cases, write_ground_test
from builder.campaign.snapshots import load_snapshots
from builder.figures.calibration import as_built_figure
from builder.figures.drawing import save
from builder.pipeline.calibrate import calibrate, with_levels_of
from builder.pipeline.demonstration.flight_scores import SCORE_VERSION, Flown, flown_estimators
from builder.pipeline.demonstration.flown_shape import FLIGHT, make_numbers
from builder.pipeline.pipeline import MAP, SNAPSHOTS, Pipeline
from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.as_built_vehicle import AsBuilt, as_built_std, draw_as_built
from builder.structure.as_built.wall_regions import counts_of
from builder.structure.gauge_checks import gauge_roll_angles
from builder.structure.loads.applied import Weight
from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.zeros_file import load_zeros
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map

CASES = 12
"""Load cases of the ground test, in addition to own weight in four attitudes."""

TEST, CALIBRATED, EXACT, ZEROS = "loadtest.toml", "calibrated.h5", "exact.h5", "calibrated_zeros.toml"


@dataclass(frozen=True, eq=False, kw_only=True)
class AsBuiltRun:
    """A vehicle of the file at ``vehicle_path`` drawn with ``seed``, in the folder of ``pipeline``."""

    pipeline: Pipeline
    vehicle_path: Path
    seed: int

    @cached_property
    def flown_vehicle(self) -> AsBuilt:
        """The vehicle that flies."""
        vehicle = self.pipeline.vehicle
        std = as_built_std(vehicle.calibration, counts_of(vehicle, gauge_roll_angles(vehicle), in_flight=False))
        return draw_as_built(std, np.random.default_rng(self.seed))

    @cached_property
    def truth(self) -> AsBuiltStructure:
        """The independent model, with the wall of the vehicle that flies."""
        vehicle = self.pipeline.vehicle
        with self.pipeline.reporter.stage("Structure: the vehicle that flies, as built") as progress:
            return as_built_structure(
                vehicle,
                vehicle.gauges.layout,
                resolution=vehicle.resolution.truth,
                known_thickness=self.flown_vehicle.wall_thickness,
                known_taper=self.flown_vehicle.wall_taper,
                progress=progress,
            )

    @property
    def inputs(self) -> dict[str, Any]:
        """What the vehicle that flies depends on."""
        vehicle = self.pipeline.vehicle
        parts = {"structure", "material", "gauges", "calibration", "profile", "resolution"}
        return {"seed": self.seed, "cases": CASES, "vehicle": vehicle.model_dump(mode="json", include=parts)}

    def make_test(self) -> None:
        """Test the vehicle on the ground: loadtest.toml, channels.toml and the recording."""

        def write(path: Path) -> None:
            noise = load_inverse_map(self.pipeline.path(MAP)).noise_std
            random = np.random.default_rng([self.seed, 1])
            truth, flown_vehicle, vehicle = self.truth, self.flown_vehicle, self.pipeline.vehicle
            weighs = vehicle.material.density_kg_per_m3 is not None
            cases = standard_load_cases(CASES, vehicle.body().length, weighs)
            with self.pipeline.reporter.stage(f"Ground test: {CASES} load cases"):
                test = simulate_ground_test(truth, flown_vehicle, cases, LoadErrors(), noise, random=random)
            file = Path(os.path.relpath(self.vehicle_path, path.parent)).as_posix()
            write_ground_test(test, path.parent, f"{vehicle.name}: ground test", file)

        inputs = self.pipeline.inputs(MAP, **self.inputs)
        holds = "ground test: load cases; loadtest.csv and channels.toml hold the recording"
        self.pipeline.make(TEST, holds, inputs, write)

    def make_maps(self) -> None:
        """Calibrate the map by the test, and make the one that a vehicle known exactly would have, with the alarm
        levels of the calibrated one."""
        pipeline, vehicle = self.pipeline, self.pipeline.vehicle

        def calibrated(path: Path) -> None:
            snapshots = pipeline.path(SNAPSHOTS)
            made = calibrate(
                pipeline.path(MAP), pipeline.path(TEST), path, snapshots=snapshots, progress=pipeline.reporter
            )
            for line in (*(fault.line for fault in made.faults), *made.notes):
                pipeline.reporter.note(line)

        def exact(path: Path) -> None:
            none = np.zeros((len(self.flown_vehicle.vector),) * 2)
            known = Remaining(parameters=self.flown_vehicle, covariance=none)
            with pipeline.reporter.stage("Structure: as it may be built") as progress:
                structure = as_built_structure(vehicle, vehicle.gauges.layout, progress=progress)
            made = calibrated_map(vehicle, load_snapshots(pipeline.path(SNAPSHOTS)), structure, known)
            save_inverse_map(with_levels_of(made, load_inverse_map(pipeline.path(CALIBRATED))), path)

        inputs = {"test": pipeline.made_from(TEST), "map": pipeline.made_from(MAP)}
        holds = f"the map as calibrated, and report (.html, .pdf); {ZEROS}: the zero offsets for other maps"
        pipeline.make(CALIBRATED, holds, inputs, calibrated)
        pipeline.make(EXACT, "the map of the same vehicle known exactly", inputs, exact)

    def start_values(self) -> dict[str, float]:
        """Return the zeros that the estimator takes off what the plant reads."""
        zeros = self.zeros()["after"]
        return {f"estimator.zero[{i}]": value for i, value in enumerate(zeros.tolist(), start=1)}

    def zeros(self) -> dict[str, FloatArray]:
        """Return the zeros (n_d,) [m/m] by map: before the test, from a tare, the mean of all attitudes."""
        inverse_map = load_inverse_map(self.pipeline.path(MAP))
        test, _ = read_load_test(read_test_file(self.pipeline.path(TEST)), inverse_map.gauge_names)
        tare = [
            case.reading for case in test.cases if all(isinstance(applied.load, Weight) for applied in case.loads)
        ]
        return {
            "before": np.mean(tare, axis=0),
            "after": load_zeros(self.pipeline.path(ZEROS), inverse_map.gauge_names).value,
            "exact": self.flown_vehicle.zero,
        }

    def score(self, recording: Recording) -> dict[str, Any]:
        """Fly the three maps on the strains of one flight; return their accuracy, and draw it."""
        pipeline = self.pipeline

        def entries() -> dict[str, Any]:
            flown = self._flown(recording)
            errors = {name: (of_map.error, of_map.made.std) for name, of_map in flown.items()}
            save(as_built_figure(recording.time, errors, pipeline.vehicle.name), pipeline.path("as_built.png"))
            return {name: of_map.record() for name, of_map in flown.items()}

        inputs = pipeline.inputs(FLIGHT, version=SCORE_VERSION, maps=pipeline.made_from(MAP, CALIBRATED, EXACT))
        holds = "map before and after the test, and exact, on the same strains (and as a figure, as_built.png)"
        return make_numbers(pipeline, "as_built.json", holds, inputs, entries)

    def _flown(self, recording: Recording) -> dict[str, Flown]:
        zeros, flights = self.zeros(), dict[str, Flown]()
        for name, file in (("before", MAP), ("after", CALIBRATED), ("exact", EXACT)):
            inverse_map = load_inverse_map(self.pipeline.path(file))
            # The calibrated map subtracts its own.
            rest = zeros[name] - inverse_map.zero_offset[: len(zeros[name])]
            flown = flown_estimators(inverse_map, recording, zeros=rest)
            flights[name] = flown["linear" if inverse_map.manifold is None else "nonlinear"]
        return flights
