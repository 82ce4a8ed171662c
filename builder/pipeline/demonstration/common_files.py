"""Files of a demonstration whatever the shape of its vehicle: the estimator FMU, the recording, pictures."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from builder.campaign.snapshots import load_snapshots
from builder.figures import demonstration as figures
from builder.figures.drawing.canvas import save
from builder.figures.scene.picture_files import write_picture
from builder.figures.scene.scene import scene_of_snapshot
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.used_files import MAP, SNAPSHOTS
from strainfmu.cosim.systems.recording import Recording, load_recording, save_csv, save_hdf5
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.fmu.native.package import shipped_libraries

STEP_SIZE = 0.01
"""Time between communication points, and samples, of the flight [s]: 100 Hz."""

ESTIMATOR, FLIGHT = "estimator.fmu", "flight.h5"


def digest_of(library: str) -> str:
    """Return what identifies the compiled code of ``library`` on all platforms."""
    found = shipped_libraries(library)
    return sha256(b"".join(content for _, (_, content) in sorted(found.items()))).hexdigest()


def make_estimator(pipeline: Pipeline, map_name: str = MAP, takes_zeros: bool = False) -> None:
    """Package the map ``map_name``, with inputs for zero offsets where a ground test gives some."""
    inputs = {"map": pipeline.made_from(map_name), "kind": "native", "library": digest_of("estimator")}
    pipeline.make(
        ESTIMATOR,
        "FMI 2.0 co-simulation FMU, native: strains in, coefficients out",
        inputs | ({"zero_inputs": True} if takes_zeros else {}),
        lambda path: export_estimator(pipeline.path(map_name), path, ExportOptions(zero_inputs=takes_zeros)),
    )


def make_flight(pipeline: Pipeline, holds: str, inputs: dict[str, Any], fly: Callable[[], Recording]) -> Recording:
    """Make the recording of a flight as HDF5 and CSV, and return it."""
    pipeline.make(FLIGHT, holds, inputs, lambda path: save_hdf5(fly(), path))
    recording = load_recording(pipeline.path(FLIGHT))
    of_flight = {"flight": pipeline.made_from(FLIGHT)}
    pipeline.make("flight.csv", "the same as CSV", of_flight, lambda path: save_csv(recording, path))
    return recording


def make_coefficients(pipeline: Pipeline, recording: Recording, title: str) -> None:
    """Draw estimated against true coefficients."""
    pipeline.make(
        "coefficients.png",
        "figure: estimated against true coefficients, 3 sigma bands",
        {"flight": pipeline.made_from(FLIGHT), "title": title},
        lambda path: save(figures.coefficients(recording, title), path),
    )


def make_pictures(pipeline: Pipeline) -> None:
    """Make vehicle.png and vehicle.glb from the map and the snapshots in the pipeline's folder."""
    title = pipeline.vehicle.name
    inputs: dict[str, Any] = {
        "snapshots": pipeline.made_from(SNAPSHOTS),
        "map": pipeline.made_from(MAP),
        "title": title,
    }

    def draw(path: Path) -> None:
        snapshots, one = load_snapshots(pipeline.path(SNAPSHOTS)), load_inverse_map(pipeline.path(MAP))
        write_picture(scene_of_snapshot(snapshots, one, title), path)

    pipeline.make("vehicle.png", "figure: vehicle and gauges in three dimensions, from two sides", inputs, draw)
    pipeline.make("vehicle.glb", "the same to be turned: glTF, for browsers and Blender", inputs, draw)
