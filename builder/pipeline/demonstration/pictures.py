"""Pictures of the vehicle in three dimensions, in the folder of a demonstration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from builder.campaign.snapshots import load_snapshots
from builder.figures.scene.picture_files import write_picture
from builder.figures.scene.scene import scene_of_snapshot
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.used_files import MAP, SNAPSHOTS
from strainfmu.estimator.map.inverse_map import load_inverse_map


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
