"""Builds of large maps in a process whose address space is limited.

Arguments: build or field, and a folder. Run by ``test_memory.py`` in a process of its own: a limit of the
address space cannot be lifted again.
"""

import json
import resource
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from ensembles import listed_ensemble
from random_map import nothing_of

from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.model import gauge_noise
from builder.inverse.solution import Problem
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.map_options import MapEntry, Noise
from builder.vehicle.shape.geometry import surface_grid
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.estimator.map.inverse_map import save_inverse_map

GIB = 2**30


def address_space() -> int:
    """Return the address space of this process [bytes]."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()


def allow(more: int) -> None:
    """Allow ``more`` bytes beyond what the process has mapped now, its inputs among it."""
    limit = address_space() + more
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def build(folder: Path) -> dict[str, object]:
    """Case 1 and Case 2 of 60,000 nodes, 54 gauges, 243 snapshots, within 1 GiB; sizes of the files."""
    vehicle = load_vehicle(IC3X)
    grid = surface_grid(vehicle.body(), 242, 250)
    random = np.random.default_rng(0)
    n_p, n, n_d = grid.n_nodes, 243, 54
    condition = np.column_stack([np.linspace(5.0, 7.0, n), np.zeros((n, 2)), np.full(n, 20e3)])
    # Waves of falling size, and noise: of full rank, as snapshots are.
    waves = np.cos(np.outer(np.arange(60), np.linspace(0.0, np.pi, n_p))) * np.geomspace(1e3, 1.0, 60)[:, None]
    pressure = 1e4 + random.normal(size=(n, 60)) @ waves + random.normal(size=(n, n_p))
    mesh = mesh_of_grid(grid)
    snapshots = Snapshots(
        vehicle=vehicle.name,
        engine="table",
        settings={},
        condition=condition,
        pressure=pressure,
        internal_pressure=np.full(n, 5474.9),
        reference=np.array([0.1, 0.4, 2.0]),
        point=mesh.point,
        triangle=mesh.triangle,
        station=grid.x,
        radius=grid.radius,
        meridian_angle=grid.angle,
        solved=np.ones(n, dtype=bool),
        flow=np.arange(n),
        momentum_error=np.full(n, np.nan),
        repairs=np.zeros(n, dtype=np.int64),
    )
    names = tuple(f"G{i}" for i in range(n_d))
    layout = GaugeLayout(names, random.normal(size=(n_d, 3)), random.normal(size=(n_d, 3)))
    name = vehicle.gauges.layout
    operator = 1e-9 * random.normal(size=(n_d, n_p))
    structure = MappedStructure(
        surface=grid, description="random", layouts={name: layout}, operators={name: operator}, is_external=True
    )
    allow(GIB)
    found: dict[str, object] = {"nodes": n_p}
    for case in (1, 2):
        changed = vehicle.model_copy(
            update={
                "map": MapEntry(case=case, keep_field=True, symmetry="listed"),
                "noise": Noise(std_um_per_m=0.4).without_hardware_errors(),
            }
        )
        start = perf_counter()
        inverse_map = build_inverse_map(changed, snapshots, structure)
        found[f"case {case}, seconds"] = perf_counter() - start
        names = ("field_mean", "field_modes", "field_std", "point", "triangle")
        bare = replace(inverse_map, **nothing_of(*names))
        for which, one in (("with", inverse_map), ("without", bare)):
            save_inverse_map(one, folder / "map.h5")
            found[f"case {case}, bytes {which} field"] = (folder / "map.h5").stat().st_size
    return found


def field(_: Path) -> dict[str, object]:
    """Both cases with fields of 200,000 nodes, within 1 GiB; n_p x n_p would be 320 GB."""
    n_p, n, n_d = 200_000, 12, 6
    random = np.random.default_rng(0)
    pressure = random.normal(1e4, 1e3, size=(n, n_p))
    operator, loads = 1e-9 * random.normal(size=(n_d, n_p)), 1e-6 * random.normal(size=(5, n_p))
    noise, area = (gauge_noise(1e-14 * np.eye(n_d)),), np.ones(n_p)
    allow(GIB)
    entries = (
        MapEntry(case=2),
        MapEntry(case=2, prior_modes=5, gamma="morozov", form="absolute"),
        MapEntry(case=1, modes=3),
        MapEntry(case=1, modes=3, inner_product="area"),
    )
    shapes = [
        Problem(
            ensemble=listed_ensemble(pressure),
            errors=(),
            strain_operator=operator,
            load_operator=loads,
            node_area=area,
            noise=noise,
            entry=entry,
            tolerances=Noise(std_um_per_m=1.0),
            reference=ReferenceQuantities(1.0, 1.0, 0.0),
            inside="ambient",
        ).solution.field_modes.shape
        for entry in entries
    ]
    return {"shapes": shapes}


if __name__ == "__main__":
    print(json.dumps({"build": build, "field": field}[sys.argv[1]](Path(sys.argv[2]))))
