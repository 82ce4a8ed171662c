"""Errors of the vehicle and its gauges as built: as terms of the weights, and as functions of the current strain.

The strain of an error at a flow follows from the derivative of Z_p of the vehicle as built by the error, times the
size that [noise] states. The kinds are listed in :mod:`builder.structure.as_built_kinds`.

Derivatives of the strain operator by errors of the vehicle as built, with the structural model of the map.

Error of strain by the mesh, in units of the gauges' sigma: what a map's sigmas hold of it, and what not.

What a second mesh says of the same gauges differs from the first by a pattern that follows the pressure. A third
would differ by about as much, in a pattern that is partly the same. So half of the variance counts as one error
that all gauges have in common, half as an error of each gauge on its own.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from builder.aero.surface.mesh import grid_of
from builder.inverse.ensemble import ROWS_AT_ONCE, Ensemble
from builder.inverse.noise.model import NoiseTerm, common_error, gauge_errors, nuisance_modes
from builder.structure.as_built.as_built_vehicle import (
    AsBuilt,
    Counts,
    Key,
    as_drawn,
    parameter_derivatives,
    stated_keys,
)
from builder.structure.as_built.displaced_structure import KNOWN, DisplacedGauges, ways_of
from builder.structure.as_built.revolved import SOLVED, RevolvedStructure, revolved_structure, table_under
from builder.structure.as_built.wall_regions import counts_of
from builder.structure.as_built_kinds import BY_REGION, KINDS
from builder.structure.fourier.fourier_model import StructuralModel, structural_model_on
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid.gauge_layouts import displaced_name
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.gauge_entries import Gauges
from builder.vehicle.map_options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import PAIRS

WALL_STEP = 0.01
"""Step of the wall's thickness, relative to it."""

GAINS = ("gauge_gain", "common_gain")


def strain_derivatives(
    vehicle: Vehicle, structure: StructuralModel | MappedStructure, layout: str, keys: Collection[Key]
) -> dict[Key, FloatArray]:
    """Return the derivatives of Z_p (n_d, n_p) [1/Pa] by ``keys`` at the vehicle of the file, in their order.

    Raises
    ------
    InputError
        A gauge lies within a step of the end of its surface, the structure holds no displaced gauges, or the model
        has none of an error.
    """
    if isinstance(structure, StructuralModel):
        return _derivatives(of_model(vehicle, structure, layout, keys), keys)
    of_wall = [key for key in keys if key[0] in (*SOLVED, *BY_REGION) and key[0] != "axial_shift"]
    of_gauges = [key for key in keys if key not in of_wall]
    derivatives: dict[Key, FloatArray] = {}
    if of_wall:
        derivatives |= _wall_derivatives(vehicle, structure, layout, of_wall)
    strain = of_displaced(structure, layout, moved=any(key[0] not in GAINS for key in of_gauges))
    derivatives |= parameter_derivatives(strain, as_drawn(counts_of_layout(vehicle, structure, layout)), of_gauges)
    return {key: derivatives[key] for key in keys}


def _derivatives(model: RevolvedStructure, keys: Collection[Key]) -> dict[Key, FloatArray]:
    return parameter_derivatives(model.strain_operator, as_drawn(model.counts), list(keys))


def of_model(
    vehicle: Vehicle, structure: StructuralModel, layout: str, keys: Collection[Key]
) -> RevolvedStructure:
    """Return the semi-analytic model of the map, solved for ``keys``."""
    return revolved_structure(
        vehicle,
        layout,
        names=structure.layouts[layout].names,
        placed=structure.placed[layout],
        nominal=structure.response,
        surface=structure.surface,
        kinds={kind for kind, _ in keys},
        wall_step=WALL_STEP,
    )


def counts_of_layout(vehicle: Vehicle, structure: StructuralModel | MappedStructure, layout: str) -> Counts:
    """Return the numbers of what has errors of its own; errors as
    :func:`~builder.structure.as_built.wall_regions.counts_of`."""
    roll_angle = DisplacedGauges(structure.layouts[layout].position).roll_angle
    return counts_of(vehicle, roll_angle, in_flight=True)


def of_displaced(structure: MappedStructure, layout: str, moved: bool) -> Callable[[AsBuilt], FloatArray]:
    """Return Z_p (n_d, n_p) [1/Pa] of a vehicle as built, from the displaced gauges that ``structure`` holds.

    Raises
    ------
    InputError
        The structure holds no displaced gauges of ``layout``, and ``moved`` says that they are needed.
    """

    def strain_of(how: str) -> FloatArray:
        name = displaced_name(layout, how)
        if name not in structure.operators:
            raise InputError(
                f"structure: layout '{name}' is missing, which noise.gauge_position_mm, gauge_orientation_deg and "
                "layout_roll_deg need; compute the structure again with the same vehicle file, or set them to 0"
            )
        return structure.strain_operator(name)

    parts = ways_of(structure.strain_operator(layout), strain_of if moved else None).transpose(0, 2, 1)
    gauges = DisplacedGauges(structure.layouts[layout].position)
    return lambda as_built: gauges.as_built(parts, as_built).T


def _wall_derivatives(
    vehicle: Vehicle, structure: MappedStructure, layout: str, keys: Collection[Key]
) -> dict[Key, FloatArray]:
    """Return the derivatives by the wall and its support of a structure that is none of the semi-analytic model.

    That stands in with gauges at points inside: what counts is how strain changes, and that follows from membrane
    and bending alike. On a surface without stations, with gauges off the wall, or of a structure of another code,
    strain goes with 1 / t.

    Raises
    ------
    InputError
        The body is not one of revolution that is clamped aft, and an error is another than the thickness.
    """
    grid = grid_of(structure.surface)
    unknown_kind = next((kind for kind, _ in keys if kind not in KNOWN), None)
    if grid is not None and not (structure.is_external and unknown_kind is None):
        inside = vehicle.model_copy(update={"gauges": _with_points_inside(vehicle.gauges, layout)})
        try:
            model = structural_model_on(inside, grid, vehicle.resolution.map, [layout])
            return _derivatives(of_model(inside, model, layout, keys), keys)
        except InputError:
            if unknown_kind is not None:
                raise
    if unknown_kind is not None:
        entry = KINDS[unknown_kind].entry
        raise InputError(f"noise.{entry}: expected 0 but for a body of revolution that is clamped aft")
    counts = counts_of_layout(vehicle, structure, layout)
    return parameter_derivatives(of_displaced(structure, layout, moved=False), as_drawn(counts), list(keys))


def _with_points_inside(gauges: Gauges, layout: str) -> Gauges:
    """Return ``gauges``, the layout ``layout`` at points on the inner surface."""
    entry = gauges.layouts[layout]
    changed = {
        "rows": None
        if entry.rows is None
        else [row.model_copy(update={"surface": "inner", "length_mm": 0.0}) for row in entry.rows],
        "surface": None if entry.file is None else "inner",
        "length_mm": None,
    }
    return gauges.model_copy(update={"layouts": {**gauges.layouts, layout: entry.model_copy(update=changed)}})


@dataclass(frozen=True, eq=False, kw_only=True)
class HardwareError:
    """One error in proportion to strain.

    Attributes
    ----------
    name : for reports.
    strain : (n, n_d) its strain at the members of the ensemble, at one standard deviation [m/m].
    common : whether all gauges have the same error, or each its own.
    of_mesh : whether it is an error of the structure's mesh, not of the hardware.
    with_rest : whether the nonlinear estimator counts, gauge by gauge, what no load follows of a common error.
    """

    name: str
    strain: FloatArray
    common: bool
    of_mesh: bool = False
    with_rest: bool = False


def hardware_errors(
    vehicle: Vehicle,
    structure: StructuralModel | MappedStructure,
    strain_operator: FloatArray,
    ensemble: Ensemble,
    modulus_std: float = 0.0,
) -> list[HardwareError]:
    """Return the errors of the section [noise] that are in proportion to strain; errors of size 0 are left out.

    ``strain_operator`` is Z_p (n_d, n_p) [1/Pa] of the layout in use, ``modulus_std`` the relative error of
    Young's modulus by the wall's temperature.

    Raises
    ------
    InputError
        A gauge lies within a step of the end of its surface, or the structure holds no displaced gauges.
    """
    entry, layout = vehicle.noise, vehicle.gauges.layout
    keys = stated_keys(entry, counts_of_layout(vehicle, structure, layout))
    if isinstance(structure, StructuralModel) and ensemble.grid is not None:
        strain = _by_harmonics(of_model(vehicle, structure, layout, keys), keys, ensemble)
    else:
        derivatives = strain_derivatives(vehicle, structure, layout, keys)
        strain = {key: ensemble.responses(derivative) for key, derivative in derivatives.items()}
    kinds = [KINDS[key[0]] for key in keys]
    errors = list[HardwareError]()
    for kind, key in zip(kinds, keys, strict=True):
        strain[key] *= kind.std(entry)  # in place: of many gauges the largest arrays of a build
        errors.append(HardwareError(name=kind.column_name, strain=strain[key], common=kind.extent != "gauge"))
    if modulus_std > 0.0:
        of_modulus = modulus_std * ensemble.responses(strain_operator)
        gains = sum(kind.name in GAINS for kind in kinds)
        errors.insert(gains, HardwareError(name="modulus with temperature", strain=of_modulus, common=True))
    # Errors of each gauge first.
    return sorted((error for error in errors if np.any(error.strain)), key=lambda error: error.common)


def _by_harmonics(model: RevolvedStructure, keys: Collection[Key], ensemble: Ensemble) -> dict[Key, FloatArray]:
    """Return (n, n_d) the strain at the members of ``ensemble`` by each of ``keys``.

    The flows act at the stations of the gauges first, for all gauges there. What a gauge makes of the amplitudes
    follows some gauges at a time, station by station.
    """
    pressure = np.moveaxis(ensemble.harmonics[: model.n_harmonics], 0, 2)  # N, n_x, n_m
    under_flows = replace(model, table=table_under(model.table, pressure))
    n_d = len(model.names)
    strain = {key: np.empty((len(ensemble.member_weight), n_d)) for key in keys}
    by_station = np.argsort(model.on_wall.station, kind="stable")
    for some in np.array_split(by_station, 1 + n_d // ROWS_AT_ONCE):
        part = under_flows.some(some)
        amplitudes = cast(Any, part.strain_amplitudes)  # complex: derivatives are of any numbers
        derivatives: dict[Key, Any] = {**parameter_derivatives(amplitudes, as_drawn(part.counts), list(keys))}
        for key, derivative in derivatives.items():
            strain[key][:, some] = ensemble.of_amplitudes(derivative)
    return strain


def hardware_terms(
    entry: Noise, errors: list[HardwareError], ensemble: Ensemble, strain_operator: FloatArray
) -> list[NoiseTerm]:
    """Return the noise terms of ``errors``, averaged over the ensemble, and of those that do not follow strain."""
    terms = error_terms(errors, ensemble)
    if entry.apparent_strain_um_per_m > 0.0:
        column, std = np.ones((len(strain_operator), 1)), np.array([KINDS["apparent_strain"].std(entry)])
        terms.append(replace(nuisance_modes("apparent strain", column, std), hardware=True))
    if entry.internal_pressure_percent > 0.0:
        rms = rms_ambient_pressure(ensemble)
        column = strain_operator.sum(axis=1)[:, None]
        std = np.array([KINDS["internal_pressure"].std(entry) * rms])
        terms.append(replace(nuisance_modes("internal pressure", column, std), hardware=True, scales=True))
    return terms


def error_terms(errors: list[HardwareError], ensemble: Ensemble) -> list[NoiseTerm]:
    """Return the noise terms of ``errors``, averaged over the ensemble; errors of one name are one term."""
    terms: dict[str, NoiseTerm] = {}
    for error in errors:
        if error.common:
            error_term = common_error(error.name, ensemble.columns_by_harmonic(error.strain))
        else:
            error_term = gauge_errors(error.name, error.strain, 1.0, ensemble.member_weight)
        if error.name in terms:
            error_term = replace(error_term, strain=np.hstack([terms[error.name].columns, error_term.columns]))
        terms[error.name] = replace(error_term, hardware=not error.of_mesh)
    return list(terms.values())


def rms_ambient_pressure(ensemble: Ensemble) -> float:
    """Return the root mean square of p_inf over the flows [Pa]."""
    return float(np.sqrt(np.average(ensemble.ambient_pressure**2, weights=ensemble.weight)))


def error_model(
    errors: list[HardwareError], ensemble: Ensemble, coefficients: FloatArray
) -> dict[str, FloatArray]:
    """Return fields of a map: how ``errors`` follow the coefficients (n, 5) of the members; none without errors.

    The strain of an error is regressed on [1, C] over the members. What the regression leaves stays in the
    weights.
    """
    if not errors:
        return {}
    weight = ensemble.member_weight
    c = np.hstack([np.ones((len(coefficients), 1)), coefficients])
    root = np.sqrt(weight)[:, None]
    n_d = errors[0].strain.shape[1]
    of_gauge, common = np.zeros((len(PAIRS), n_d)), []
    for error in errors:
        slope = np.linalg.pinv(root * c, rcond=1e-10) @ (root * error.strain)
        if error.common:
            common.append(slope)
            continue
        for row, (a, b) in enumerate(PAIRS):
            of_gauge[row] += (1.0 if a == b else 2.0) * slope[a] * slope[b]
    return {
        "gauge_error_product": of_gauge,
        "common_error": np.array(common).reshape(-1, 6, n_d),
        "mean_product": np.array([weight @ (c[:, a] * c[:, b]) for a, b in PAIRS]),
    }


COUNTED = 0.03
"""Root mean square in sigma from which the error is a term of the noise; below it adds 1e-3 of a variance."""

TRUSTED = 1.0
"""Root mean square in sigma up to which a map's sigmas are to be trusted."""


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshError:
    """Error of the gauges' strain by the mesh.

    Attributes
    ----------
    against : what it was measured against.
    strain : (n, n_d) at the members of the ensemble [m/m].
    in_sigma : (n_d,) root mean square over the members, over each gauge's own noise.
    """

    against: str
    strain: FloatArray
    in_sigma: FloatArray

    @property
    def rms(self) -> float:
        """Root mean square over the gauges, in sigma."""
        return float(np.sqrt(np.mean(self.in_sigma**2)))

    @property
    def trusted(self) -> bool:
        """Whether sigmas that hold this error are to be trusted."""
        return self.rms <= TRUSTED

    def terms(self) -> list[HardwareError]:
        """Return the errors that the noise holds; none where they are too small to count."""
        if self.rms < COUNTED:
            return []
        half = np.sqrt(0.5)
        return [
            HardwareError(name=name, strain=half * self.strain, common=common, of_mesh=True)
            for name, common in (("mesh, of each gauge", False), ("mesh, in common", True))
        ]

    def record(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Return what a map's provenance says of it."""
        worst = int(self.in_sigma.argmax())
        return {
            "against": self.against,
            "rms_sigma": float(f"{self.rms:.4g}"),
            "largest_sigma": float(f"{self.in_sigma[worst]:.4g}"),
            "largest_at": names[worst],
            "sigmas_trusted": self.trusted,
        }


def mesh_error_notes(provenance: Mapping[str, Any]) -> list[str]:
    """Return in lines what a map's provenance says of the mesh's error: its size, and a warning above 1 sigma."""
    mesh_error = provenance.get("mesh_error")
    if mesh_error is None:
        return []
    lines = [
        f"mesh error {mesh_error['rms_sigma']:.2g} sigma of gauge noise (rms), {mesh_error['largest_sigma']:.2g} "
        f"at {mesh_error['largest_at']}, against {mesh_error['against']}"
    ]
    if not mesh_error["sigmas_trusted"]:
        lines.append(
            f"warning: the mesh's error is above {TRUSTED:g} sigma of gauge noise: the sigmas of this map are not "
            "to be trusted; take a finer mesh"
        )
    return lines
