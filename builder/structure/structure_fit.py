"""Fit of a file of a three-dimensional structure to a vehicle: body, wall, material, support and gauges.

The mesh is the file's own affair: swept, by Gmsh or imported, of any resolution.
"""

from collections.abc import Mapping
from math import isclose
from typing import Any

import numpy as np

from builder.structure.solid.case import SolidCase, structure_case
from builder.structure.solid.gauge_layouts import is_displaced
from builder.structure.solid.gauge_rows import Gauges
from builder.structure.structure_file import Structure
from builder.vehicle.file import Vehicle
from builder.vehicle.map_needs import used_layouts
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.vehicle.shape.profile_entries import profile_misfits
from builder.workspace import Misfit

SAME = 1e-9
SAME_BODY = 0.02  # of length and base radius: what an imported mesh of the body may differ


def structure_misfits(structure: Structure, vehicle: Vehicle) -> list[Misfit]:
    """Return in what ``structure`` is not of ``vehicle``: entries of its file, and gauges.

    Raises
    ------
    InputError
        A layout of the vehicle file is wrong, or the wall does not fit the body.
    """
    case = structure_case(vehicle, used_layouts(vehicle))
    return [
        *(_extent_misfits(structure, case) if case.body is None else _body_misfits(structure, case.body)),
        *_entry_misfits(structure.settings, case),
        *_gauges(structure, case),
    ]


def on_solid_model(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with the three-dimensional model for its map, whatever its file says."""
    return vehicle.model_copy(update={"structure": vehicle.structure.model_copy(update={"model": "solid"})})


def structure_record(structure: Structure) -> dict[str, Any]:
    """Return what ``structure`` was made of, for a map's provenance: model, mesh and its file, size, solver."""
    used = structure.statistics
    return {
        "model": structure.model,
        **{name: value for name, value in structure.settings.get("mesh", {}).items() if name != "model"},
        **{
            name: used[name]
            for name in ("degrees_of_freedom", "load_cases", "loaded_nodes", "solver")
            if name in used
        },
        "strainfmu_version": structure.settings.get("strainfmu_version", "unknown"),
    }


def structure_line(structure: Structure) -> str:
    """Return in a few words what ``structure`` was made of."""
    mesh = structure.settings.get("mesh", {})
    source = mesh.get("file_name") or mesh.get("resolution")
    origin = f" ({source})" if source else ""
    return f"{structure.model.replace('_', ' ')}{origin}, {structure.size}"


def _body_misfits(structure: Structure, body: BodyOfRevolution) -> list[Misfit]:
    stated = structure.settings.get("profile")
    if stated is not None:
        return profile_misfits(stated, body)
    length = float(np.ptp(structure.point[:, 0]))
    radius = float(np.hypot(structure.point[:, 1], structure.point[:, 2]).max())
    largest = float(body.radius(np.linspace(0.0, body.length, 200)).max())
    pairs = (("length of the mesh", body.length, length), ("largest radius of the mesh", largest, radius))
    return [
        Misfit(entry=what, expected=f"{expected:.6g} m", actual=f"{actual:.6g} m")
        for what, expected, actual in pairs
        if abs(actual / expected - 1.0) > SAME_BODY
    ]


def _extent_misfits(structure: Structure, case: SolidCase) -> list[Misfit]:
    """Return the extents along x, y and z in which the surface of a free shape differs from its case's mesh."""
    expected = np.ptp(case.mesh.full.node, axis=0)
    actual = np.ptp(structure.point, axis=0)
    return [
        Misfit(entry=f"extent of the mesh along {axis}", expected=f"{wanted:.6g} m", actual=f"{actual:.6g} m")
        for axis, wanted, actual in zip("xyz", expected, actual, strict=True)
        if abs(actual - wanted) > SAME_BODY * expected.max()
    ]


def _entry_misfits(settings: Mapping[str, Any], case: SolidCase) -> list[Misfit]:
    """Return the entries of wall, material and support that differ; entries that a file lacks are not compared."""
    numbers = [
        ("structure.wall_thickness_mm", 1e3, "wall", "thickness_m"),
        ("structure.solid_tip_length_m", 1.0, "wall", "solid_tip_length_m"),
        ("material.youngs_modulus_GPa", 1e-9, "material", "youngs_modulus_Pa"),
        ("material.poisson_ratio", 1.0, "material", "poisson_ratio"),
    ]
    if case.support is None:
        numbers.append(("material.density_kg_per_m3", 1.0, "material", "density_kg_per_m3"))
    misfits = []
    for entry, factor, section, name in numbers:
        expected, stated = case.record[section].get(name), settings.get(section, {}).get(name)
        if expected is not None and stated is not None and not isclose(stated, expected, rel_tol=SAME):
            misfits.append(
                Misfit(entry=entry, expected=f"{factor * expected:.9g}", actual=f"{factor * stated:.9g}")
            )
    masses, held_masses = case.record.get("regions_and_masses", {}), settings.get("regions_and_masses", {})
    if held_masses != masses:
        entry = "structure.mesh_materials, point_masses and covers"
        misfits.append(Misfit(entry=entry, expected=f"{masses}", actual=f"{held_masses}"))
    wall, profile = settings.get("wall", {}), case.record["wall"].get("profile", [])
    if wall and wall.get("profile", []) != profile:
        misfits.append(
            Misfit(entry="structure.wall_thickness_at", expected=f"{profile}", actual=f"{wall.get('profile', [])}")
        )
    support, held_support = case.record["support"], settings.get("support")
    if held_support is not None and held_support != support:
        misfits.append(Misfit(entry="structure.support", expected=_words(support), actual=_words(held_support)))
    return misfits


def _gauges(structure: Structure, case: SolidCase) -> list[Misfit]:
    """Return the first layout that is missing, or has another gauge.

    Others may follow from it: the gauges displaced of [noise] are layouts, too.
    """
    for layout, wanted in case.layouts.items():
        if layout not in structure.layouts:
            layouts = ", ".join(name for name in structure.layouts if not is_displaced(name))
            return [Misfit(entry="gauges", expected=f"layout '{layout}'", actual=f"the layouts {layouts}")]
        misfit = _gauge_misfit(structure, layout, wanted)
        if misfit is not None:
            return [misfit]
    return []


def _gauge_misfit(structure: Structure, layout: str, wanted: Gauges) -> Misfit | None:
    index = structure.gauges_of(layout)
    where = f"gauges of layout '{layout}'"
    names = tuple(structure.gauge_names[i] for i in index)
    if len(names) != len(wanted.name):
        return Misfit(entry=where, expected=f"{len(wanted.name)}", actual=f"{len(names)}")
    direction = wanted.direction / np.linalg.norm(wanted.direction, axis=1, keepdims=True)
    for number, i in enumerate(index):
        pairs = (
            ("name", wanted.name[number], names[number]),
            ("surface", wanted.surface[number], structure.gauge_surface[i]),
            ("position [m]", wanted.position[number], structure.gauge_position[i]),
            ("direction", direction[number], structure.gauge_direction[i]),
            ("length [m]", wanted.length[number], structure.gauge_length[i]),
        )
        for what, expected, stated in pairs:
            if not _same(expected, stated):
                entry = f"{where}, gauge {number + 1} ({wanted.name[number]}), {what}"
                return Misfit(entry=entry, expected=_text(expected), actual=_text(stated))
    return None


def _same(expected: Any, stated: Any) -> bool:
    if isinstance(expected, str):
        return bool(expected == stated)
    return bool(np.allclose(expected, stated, rtol=SAME, atol=SAME))


def _text(value: Any) -> str:
    if isinstance(value, str):
        return f"'{value}'"
    return " ".join(f"{number:.6g}" for number in np.atleast_1d(value))


def _words(support: Mapping[str, Any]) -> str:
    numbers = ", ".join(f"{name} {value:g}" for name, value in support.items() if isinstance(value, float))
    return f"{support.get('kind', 'unknown')}{f' ({numbers})' if numbers else ''}"
