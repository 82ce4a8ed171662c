"""Growth of time and memory with the size of the structural model: from a vehicle to Z_p, mesh by mesh.

Each case runs in a process of its own, so that its peak of memory is its own. Run as a module, this file is that
process.
"""

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from builder.processors import peak_memory
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.cyclic import sector_rows
from builder.structure.solid.gauge_layouts import solid_gauges
from builder.structure.solid.linear_solvers import CYCLIC, named_back_end
from builder.structure.solid.matter import Matter
from builder.structure.solid.solid_mesh import SUPPORT
from builder.structure.solid.strain_solution import solve_strain
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import (
    RESOLUTIONS,
    SweptResolution,
    SweptSector,
    swept_wall,
)
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.errors import InputError, StrainfmuError

SIZES = (100_000, 200_000, 500_000, 1_000_000, 2_000_000, 5_000_000)
"""Minimum numbers of displacement components of the table."""

DIRECT_LIMIT = 500_000
"""Size beyond which the table leaves direct solvers of the full mesh out: their memory grows faster."""

ROUND_UP = 4  # sectors come in fours, so that gauges a quarter turn apart are alike
FINER = 1.02  # step of resolution until a size is reached


@dataclass(frozen=True, kw_only=True)
class GrowthRow:
    """One line of the table.

    Attributes
    ----------
    solver : its name.
    n_dof : displacement components.
    n_gauges : gauges, the number of rows of Z_p.
    n_pressures : pressure nodes, the number of columns.
    seconds : from reading the vehicle to Z_p [s].
    peak_memory : of the process [byte].
    relative_residual, probe_residual : of the gauge rows and of loads that move the whole body, as in
        :class:`~builder.structure.solid.linear_solvers.SparseSolver`.
    """

    solver: str
    n_dof: int
    n_gauges: int
    n_pressures: int
    seconds: float
    peak_memory: int
    relative_residual: float
    probe_residual: float


def sector_of_size(vehicle: Vehicle, n_dof: int) -> SweptSector:
    """Return the swept mesh of a vehicle's wall with at least ``n_dof`` displacement components.

    Element lengths along and round the wall are scaled alike from the resolution ``paper``, in one layer.
    """
    if n_dof < 1:
        raise InputError(f"size {n_dof} must be at least 1")
    body, wall, base = vehicle.body(), wall_of(vehicle), RESOLUTIONS["paper"]
    paper = swept_wall(body, wall, base)
    scale = float(np.sqrt(n_dof / (paper.n_sectors * paper.n_dof)))
    while True:
        n_sectors = ROUND_UP * max(2, round(base.n_sectors * scale / ROUND_UP))
        sector = swept_wall(body, wall, SweptResolution(base.element_length / scale, 1, n_sectors))
        if n_sectors * sector.n_dof >= n_dof:
            return sector
        scale *= FINER


def measure(path: Path, n_dof: int, solver_name: str) -> GrowthRow:
    """Go from a vehicle file to Z_p of its gauge layout in this process, and return what it took."""
    start = time.perf_counter()
    vehicle = load_vehicle(path)
    sector = sector_of_size(vehicle, n_dof)
    matter = Matter(material=wall_of(vehicle).material, density=None)
    rows = sector_rows(sector, solid_gauges(vehicle, vehicle.gauges.layout, gauge_mesh(vehicle)))
    solved = solve_strain(sector, matter, Clamped(SUPPORT), rows, solver_name)
    return GrowthRow(
        solver=solver_name,
        n_dof=sector.n_sectors * sector.n_dof,
        n_gauges=len(solved.strain_operator),
        n_pressures=solved.strain_operator.shape[1],
        seconds=time.perf_counter() - start,
        peak_memory=peak_memory(),
        relative_residual=solved.statistics["relative_residual"],
        probe_residual=solved.statistics["probe_residual"],
    )


def bench_structure(
    structure: str | Path, *, solver: Sequence[str] = (), largest: int = 5_000_000
) -> Iterator[GrowthRow]:
    """Yield time and memory of a vehicle's three-dimensional structure, size by size.

    Parameters
    ----------
    structure : vehicle file whose structure is timed. Not with ``mesh``, ``gauges``, ``worst``, ``peers``.
    solver : with ``structure`` or ``mesh``: solvers. Default: cyclic.
    largest : with ``structure``: largest number of degrees of freedom.

    Raises
    ------
    InputError, StrainfmuError
        The vehicle file is wrong, there is no such solver, or a process fails.
    """
    names = solver or (CYCLIC,)
    load_vehicle(structure)  # refused here, not in the process of each size
    for name in names:
        if name != CYCLIC:
            named_back_end(name)
    yield from growth_rows(Path(structure), names, [size for size in SIZES if size <= largest])


def growth_rows(path: Path, solver_names: Sequence[str], sizes: Sequence[int] = SIZES) -> Iterator[GrowthRow]:
    """Yield the rows of the table, each measured in a process of its own.

    Solvers of the full mesh are left out above :data:`DIRECT_LIMIT`.
    """
    for size in sizes:
        for name in solver_names:
            if name == CYCLIC or size <= DIRECT_LIMIT:
                yield _measured_apart(path, size, name)


def _measured_apart(path: Path, n_dof: int, solver_name: str) -> GrowthRow:
    command = [sys.executable, "-m", __name__, str(path), str(n_dof), solver_name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        errors = done.stderr.strip().splitlines() or [f"exit code {done.returncode}, out of memory?"]
        raise StrainfmuError(f"growth, {solver_name} at {n_dof} dofs: {errors[-1]}")
    return GrowthRow(**json.loads(done.stdout))


def growth_table(rows: Sequence[GrowthRow]) -> str:
    """Return the rows as text, one line each."""
    names = f"{'solver':<10}{'dofs':>10}{'pressures':>11}{'gauges':>8}"
    head = f"{names}{'seconds':>9}{'peak GiB':>10}{'residual':>10}{'probes':>8}"
    lines = [
        f"{row.solver:<10}{row.n_dof:>10}{row.n_pressures:>11}{row.n_gauges:>8}{row.seconds:>9.1f}"
        f"{row.peak_memory / 2**30:>10.2f}{row.relative_residual:>10.0e}{row.probe_residual:>8.0e}"
        for row in rows
    ]
    return "\n".join([head, *lines])


def main(arguments: Sequence[str]) -> int:
    """Measure one case (vehicle file, size, solver) and print its row as JSON."""
    path, n_dof, solver_name = arguments
    try:
        row = measure(Path(path), int(n_dof), solver_name)
    except StrainfmuError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    print(json.dumps(asdict(row)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
