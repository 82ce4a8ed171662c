"""Check of strains per load case against each other: each case is predicted from all the others.

Pressures of flight conditions are nearly combinations of each other, so that the smallest operator of some cases
predicts the strain of another one. A wrong case is off its prediction, and it spoils the predictions that it takes
part in; the predictions are therefore judged by the predictions of the cases that remain without it.

Source: leave-one-out errors of kernel ridge regression, (K^-1 s)_j / (K^-1)_jj with K = P P^T (Rasmussen and
Williams, Gaussian Processes for Machine Learning, 2006, eqs. 5.10 to 5.12).

Z_p from strains under the snapshots' own pressures: all that a map of the listed conditions needs.

A map takes Z_p of combinations of its snapshots alone. So any operator that gives the strains found under them
gives the same map; the one with the smallest norm is taken, Z = S^T (P P^T)^+ P with P the cases' pressures.

The structure around a strain operator that follows from a file of another structural code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.structure.external.load_export import LoadCases, columns_found, load_cases
from builder.structure.external.strain_table import StrainTable, SubcaseStrains, read_strain_table
from builder.structure.solid.gauge_rows import Gauges, gauge_fields
from builder.structure.structure_file import MeshCheck, Structure
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.vehicle.shape.profile_entries import profile_record
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.version import __version__


def structure_of_operator(
    strain_operator: FloatArray,
    surface: SurfaceMesh,
    layouts: Mapping[str, Gauges],
    vehicle: str,
    body: BodyOfRevolution,
    *,
    model: str,
    path: Path,
    statistics: Mapping[str, int],
    check: MeshCheck | None = None,
) -> Structure:
    """Return the structure whose gauges ``layouts`` read ``strain_operator`` (k, n_p) [1/Pa] on ``surface``.

    ``model`` and ``path`` say where it is from; the file brings no mesh of ours, so ``mesh_error`` is 0.
    """
    return Structure(
        vehicle=vehicle,
        model=model,
        settings={
            "strainfmu_version": __version__,
            "mesh": {"model": model, "file_name": path.name},
            "profile": profile_record(body),
        },
        statistics=dict(statistics),
        **gauge_fields(layouts),
        point=surface.point,
        triangle=surface.triangle,
        normal=surface.node_normal,
        strain_operator=strain_operator,
        mesh_error=np.zeros(len(strain_operator)),
        check=check,
    )


RIDGE = 1e-7
"""Added to K, relative to its largest eigenvalue: strains with four digits pass, in float64 K has an inverse."""

ODD = 0.1
"""Difference from the prediction, over the larger of the two strains, from which a case is refused."""

ODD_OVER_USUAL = 10.0
"""Score of a refused case over the usual one of the others; of right strains it is 1.5 to 7.5."""

FEWEST = 8
"""Cases below which none is judged."""

EXCHANGED = 2
"""Cases left out before the usual score is measured: an exchange spoils two."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """Cases predicted from each other.

    Attributes
    ----------
    inverse : (n, n) K^-1.
    amplitude : (n, k) K^-1 s, k gauges.
    """

    inverse: FloatArray
    amplitude: FloatArray

    @cached_property
    def score(self) -> FloatArray:
        """(n,) error of each prediction over its standard deviation, up to a common factor.

        A single wrong case has the largest, by the inequality of Cauchy and Schwarz.
        """
        return np.asarray(np.linalg.norm(self.amplitude, axis=1) / np.sqrt(np.diag(self.inverse)))

    @property
    def worst(self) -> int:
        """Place of the case with the largest score."""
        return int(self.score.argmax())

    def error(self, place: int) -> FloatArray:
        """Return the strain (k,) of a case less the one that the others predict."""
        return np.asarray(self.amplitude[place] / self.inverse[place, place])

    def without_worst(self) -> Predictions:
        """Return the predictions of the other cases from each other."""
        j = self.worst
        remaining = np.delete(np.arange(len(self.inverse)), j)
        share = self.inverse[remaining, j] / self.inverse[j, j]
        return Predictions(
            self.inverse[np.ix_(remaining, remaining)] - np.outer(share, self.inverse[j, remaining]),
            self.amplitude[remaining] - np.outer(share, self.amplitude[j]),
        )


def check_cases(pressure: FloatArray, strain: FloatArray, names: tuple[str, ...], n_flown: int) -> None:
    """Refuse a load case without strain, or one of a flight condition that is out of line with all others.

    A fault that all cases have in common shows nowhere, and flight conditions do not predict the uniform case.

    Parameters
    ----------
    pressure : (n, n_p) net pressure [Pa].
    strain : (n, k) [m/m].
    names : of the cases, for messages.
    n_flown : the first so many cases are flight conditions.

    Raises
    ------
    InputError
        Names the case.
    """
    size = np.linalg.norm(pressure, axis=1, keepdims=True)
    for name, loaded, row in zip(names, size[:, 0] > 0.0, strain, strict=True):
        if loaded and not row.any():
            raise InputError(f"{name}: expected strain under its load, got 0 at every gauge")
    if n_flown < FEWEST:
        return
    size[size == 0.0] = 1.0
    shape, strain_shape = (pressure / size)[:n_flown], (strain / size)[:n_flown]
    predictions = predicted(shape, strain_shape)
    worst, rest = predictions.worst, predictions
    for _ in range(EXCHANGED):
        rest = rest.without_worst()
    error = predictions.error(worst)
    larger = max(float(np.linalg.norm(values)) for values in (strain_shape[worst], strain_shape[worst] - error))
    odd = float(np.linalg.norm(error)) / max(larger, 1e-300)
    if odd > ODD and predictions.score[worst] > ODD_OVER_USUAL * float(np.median(rest.score)):
        raise InputError(
            f"{names[worst]}: expected the strain that the other cases predict, within {100.0 * ODD:g} %, got one "
            f"{100.0 * odd:.3g} % off: a wrong load, sign or unit, or exchanged with another case?"
        )


def predicted(pressure: FloatArray, strain: FloatArray) -> Predictions:
    """Return the predictions of ``strain`` (n, k) under ``pressure`` (n, n_p), both over the pressure's size."""
    kernel = pressure @ pressure.T
    ridge = RIDGE * float(np.linalg.eigvalsh(kernel)[-1])
    inverse = np.asarray(np.linalg.inv(kernel + ridge * np.eye(len(kernel))), dtype=np.float64)
    return Predictions(inverse, inverse @ strain)


MODEL = "strain_per_snapshot"

LINEARITY = 1e-3
"""Of a row's strain: what may be left where loads depend on each other, more is no linear structure."""

DEPENDENT = 1e-11
"""Singular value of the loads, relative to the largest, below which cases are combinations of others."""


def structure_of_strains(
    path: Path,
    vehicle: Vehicle,
    snapshots: Snapshots,
    layouts: Mapping[str, Gauges],
    results: SubcaseStrains | None = None,
) -> Structure:
    """Return the structure behind the strains of ``path``, on the surface of ``snapshots``.

    ``layouts`` are those a map needs. Displaced ones (:mod:`builder.structure.solid.gauge_layouts`) may
    be missing: placement errors of gauges must then be 0. With ``results`` the table names subcases instead of
    strains.

    Raises
    ------
    InputError
        The map's entries need more than the listed conditions, or the table does not fit snapshots or gauges.
    """
    if vehicle.map.symmetry != "listed":
        raise InputError(
            f"map.symmetry: expected 'listed' with structure.strain_per_snapshot, got '{vehicle.map.symmetry}': "
            "strains are known under the listed conditions alone"
        )
    table, cases = read_strain_table(path, results), load_cases(vehicle, snapshots)
    columns = columns_found(path, table.column, layouts, vehicle.gauges.layout)
    strain = _strain_of_cases(table, cases)[
        :, [table.column.index(name) for names in columns.values() for name in names]
    ]
    names = _names(table, cases)
    check_cases(cases.pressure, strain, names, len(cases.conditions))
    operator = smallest_operator(cases.pressure, strain, names)
    return structure_of_operator(
        operator,
        cases.surface,
        {name: layouts[name] for name in columns},
        vehicle.name,
        vehicle.body(),
        model=MODEL,
        path=path,
        statistics={"load_cases": len(cases.names)},
    )


def _strain_of_cases(table: StrainTable, cases: LoadCases) -> FloatArray:
    """Return the strains (n, k) [m/m] in the order of ``cases``."""
    ids = cases.ids()
    for case, load_id in zip(table.case, table.load_id, strict=True):
        if load_id not in ids:
            raise InputError(
                f"{table.path}: {case}: expected a load_id of these snapshots, got '{load_id}': strains of other "
                "pressures; export the loads again, or use the snapshots.h5 they were exported from"
            )
    for name, load_id in zip(cases.names, ids, strict=True):
        if load_id not in table.load_id:
            raise InputError(f"{table.path}: expected a row of {name} (load_id {load_id}), got none")
    return table.strain[[table.load_id.index(load_id) for load_id in ids]]


def _names(table: StrainTable, cases: LoadCases) -> tuple[str, ...]:
    named = dict(zip(table.load_id, table.case, strict=True))
    return tuple(f"{table.path}: {named[load_id]}" for load_id in cases.ids())


def smallest_operator(pressure: FloatArray, strain: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """Return the operator (k, n_p) [1/Pa] of smallest norm that gives ``strain`` (n, k) under ``pressure``.

    ``pressure`` is (n, n_p) [Pa], a row per case; ``names`` are the cases', for messages.

    Raises
    ------
    InputError
        Strains of dependent loads differ.
    """
    # Of equal size: the uniform case and one at low dynamic pressure count alike.
    size = np.linalg.norm(pressure, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    output, deviation, right = np.linalg.svd(pressure / size, full_matrices=False)
    significant = deviation > DEPENDENT * deviation[0]
    unit = strain / size
    amplitude = output[:, significant].T @ unit
    rms = np.linalg.norm(unit, axis=1)
    rest = np.linalg.norm(unit - output[:, significant] @ amplitude, axis=1)
    worst = int(rest.argmax())
    if rest[worst] > LINEARITY * rms.max():
        raise InputError(
            f"{names[worst]}: expected the strain that its load has as a combination of the others, got "
            f"{rest[worst] / max(rms[worst], 1e-300):.2g} of it more; is the analysis linear?"
        )
    return np.asarray((amplitude / deviation[significant, None]).T @ right[significant])
