"""What a ground test should read: the vehicle as built, and the errors of the loads that were applied.

    reading = sum over the loads of (1 + own error + load cell's) (strain + pad errors) + weight of the rig
              + zero of the recorder + drift of the zero + what the case before it leaves by hysteresis.

The vector of a test is the vehicle's parameters, the zeros of further groups of cases, the relative error of
every load, gain and offset of every load cell, place, roll, shape and direction of every load, what all loads have
in common (direction, mass of the rig, size of the pads), the curve of every load cell, the drift of every gauge
from the first case to the last, and the hysteresis of every gauge and of all.

A load cell that reads R applies R (1 + gain) + offset + X (q 4 u (1 - u) + c 6 sqrt(3) u (1 - u) (1 - 2 u)),
u = R / X, X its full scale. The curve vanishes at both ends, q and c are its largest values over X. Steps of
the loads show it: :mod:`builder.calibration.estimate.load_steps`.

Where readings do not fit, a :class:`Cause` sets entries of the vector free, or adds scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, vstack

from builder.calibration.estimate.gaussian import GaussianModel
from builder.calibration.estimate.load_steps import StepParts, step_parts
from builder.calibration.ground_test.load_changes import (
    DIRECTED,
    PLACED,
    cell_force,
    common_turns,
    elsewhere,
    hanging,
    scaled,
)
from builder.calibration.ground_test.load_test import LoadTest
from builder.structure.as_built.as_built_structure import OF_MASS
from builder.structure.as_built.as_built_vehicle import (
    GAUGE_KINDS,
    HELD_KINDS,
    AsBuilt,
    Key,
    StrainOfLoads,
    derivative_keys,
    of_gauges,
    parameter_names,
    slices,
    uncertain_keys,
)
from builder.structure.as_built.displaced_structure import AnyAsBuilt
from builder.structure.as_built_kinds import KINDS
from builder.structure.loads.applied import Load, PadForce, PointForce, load_kind
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import ZERO

Where = Literal["vehicle", "noise", "load", "gauge", "case"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Cause:
    """One cause.

    Attributes
    ----------
    where : what differs: the vehicle or the whole test, the noise, a load, a gauge or a case.
    kind : of the vehicle or the test "direction", "rig", "pad size", "load cell", "support", "joint", "modulus",
        "taper", "second harmonic", "drift" or "hysteresis"; of a gauge "gain" or "gauge"; the kind of ``where``
        otherwise.
    number : of the load cell, joint, load, gauge or case.
    entries : of the vector that are set free; empty where scatter is added.
    wide : (n,) their standard deviations.
    factor : of the noise; of a gauge or a case without entries what its scatter adds to its noise, over it.
    together : whether the entries go together, as ``wide`` and its opposite: one quantity, not each on its own.
    """

    where: Where
    kind: str
    number: int = 0
    entries: IntArray
    wide: FloatArray
    factor: float = 1.0
    together: bool = False


PAD_STEPS = {
    "place": KINDS["pad_position"].step,
    "roll": KINDS["pad_roll"].step,
    "shape": KINDS["pad_shape"].step,
    "first tilt": KINDS["tilt"].step,
    "second tilt": KINDS["tilt"].step,
}
"""Steps of the differences for the place of pads and points and the direction of forces [m, rad, 1]."""

FAR = np.array([0.02, 0.1, 0.5, 0.2, 0.2])
"""Errors up to which pads are taken about where they stand [m, rad, 1, rad]; steps on the way may be larger."""

DIRECTIONS = ("towards the tail", "around the body")
"""Turns of all forces alike: of each towards +x, and towards the axis' direction crossed with it."""

CELL, CURVE = ("load cell", "load cell offset"), ("load cell quadratic", "load cell cubic")
"""Errors of a load cell: gain and offset, and how far it is from a straight line."""

PAD = 0.02
"""Half the length of the pad that stands for a point [m]; its unit in the vector."""

DRIFT, RIG = "drift", "mass of the rig"
HYSTERESIS = "hysteresis"


@dataclass(frozen=True, eq=False, kw_only=True)
class StatedErrors:
    """Errors of one vector, by load.

    Attributes
    ----------
    zero : (n_groups, n_d) [m/m].
    scale : (n_loads,) relative, own and of the load cell [1].
    pad : (n_loads, 5) place [m], roll [rad], shape [1], two tilts [rad], with the common tilt of all forces.
    rig : mass that hangs on every pad and point [kg].
    size : of all pads, over their length; of points, over a pad of :data:`PAD` [1].
    drift : (n_d,) of the zeros, from the first case to the last [m/m].
    hysteresis : (n_d,) part of a case's strain that the next case still reads [1].
    """

    zero: FloatArray
    scale: FloatArray
    pad: FloatArray
    rig: float
    size: float
    drift: FloatArray
    hysteresis: FloatArray

    @property
    def along(self) -> FloatArray:
        """(n_loads,) part of each force that is left in its stated direction: a tilt does not change its size."""
        return np.asarray(1.0 / np.sqrt(1.0 + np.sum(self.pad[:, -2:] ** 2, axis=1)))


class _PadChanges(NamedTuple):
    """What errors of the loads change of the readings: linear about some errors, and exact there.

    Attributes
    ----------
    columns : of each load (5, n_d) per place, roll, shape and both tilts.
    sizes : (n_loads, n_d) per size of all pads.
    rest : (n_loads, n_d) what these leave of the change [m/m].
    """

    columns: list[FloatArray]
    sizes: FloatArray
    rest: FloatArray


class _Derivatives:
    """Derivatives (n_cases, n_d, n) by the parts that are not zero."""

    def __init__(self, n_cases: int, n_gauges: int, size: int) -> None:
        self.rows, self.size = np.arange(n_cases * n_gauges).reshape(n_cases, n_gauges), size
        self._parts = list[list[FloatArray]]()

    def add(self, rows: IntArray, entries: ArrayLike, value: ArrayLike) -> None:
        """Add ``value`` to the derivatives of the readings ``rows`` by ``entries``, all broadcast together."""
        parts = np.broadcast_arrays(rows, entries, value)
        some = np.nonzero(parts[2])
        self._parts.append([part[some] for part in parts])

    def joined(self) -> csr_array:
        """Return the derivatives (n_cases n_d, n)."""
        rows, entries, value = (np.concatenate(parts) for parts in zip(*self._parts, strict=True))
        place = rows.astype(np.int64), entries.astype(np.int64)
        return csr_array((value, place), shape=(self.rows.size, self.size))


def scaled_columns(rows: csr_array, by_column: FloatArray, by_row: FloatArray | None = None) -> csr_array:
    """Return ``rows`` (m, n) times a factor for each column (n,), and for each row (m,)."""
    value = rows.data * by_column[rows.indices]
    if by_row is not None:
        value *= np.repeat(by_row, np.diff(rows.indptr))
    return csr_array((value, rows.indices, rows.indptr), shape=rows.shape)


class ReadingsModel:
    """A test's readings as a function of its vector.

    Attributes
    ----------
    names : of the vector's entries.
    std : (n,) of the vector before the test.
    entries : where the errors of the test stand in the vector: "zero" (n_groups, n_d), "load" (n_loads,), "cell"
        (4, n_cells) by :data:`CELL` and :data:`CURVE`, "pad" (n_loads, 5) by :data:`PAD_STEPS`, "direction" (2,)
        of all forces, "rig" and "size" of all pads (1,), "drift" and "hysteresis" (n_d,), "hysteresis of all".
    causes : what the readings themselves have set free.
    time : (n_cases,) of each case in the order of the file, 0 for the first and 1 for the last.
    """

    def __init__(self, structure: AnyAsBuilt, test: LoadTest, prior: AsBuilt, ahead: Sequence[Load] = ()) -> None:
        """``ahead`` are loads of later models of the ``structure``, which it is solved for at once."""
        self.structure, self.test, self.prior = structure, test, _of_test(prior, test)
        self.n_built = len(prior.vector)
        self.groups = list(dict.fromkeys(case.group for case in test.cases))
        self.loads = [(k, known) for k, case in enumerate(test.cases) for known in case.loads]
        self.cells = list(dict.fromkeys(known.load_cell for _, known in self.loads if known.on_load_cell)) or ["1"]
        self.causes: tuple[Cause, ...] = ()
        self._on_cell = self._load_cells()
        self._turns = np.array([common_turns(known.load) for _, known in self.loads]).reshape(
            -1, 2, len(DIRECTIONS)
        )
        self.time = np.linspace(0.0, 1.0, len(test.cases))
        self._hung = _hung_loads(test)
        try:
            structure.solve_for([*solved_loads(test), *ahead])
        except InputError:
            for case, known in self.loads:
                try:
                    structure.response(known.load)
                except InputError as error:
                    raise InputError(f"load case '{test.cases[case].name}': {error}") from error
            raise
        none = np.zeros((len(self.loads), len(PAD_STEPS)))
        self._pads = self._pad_changes(partial(structure.nominal_strain, structure.solved), none, 0.0)
        self._together: dict[str, Any] = {}
        self._kept: dict[tuple[bool, bool], tuple[FloatArray, FloatArray, csr_array]] = {}
        vehicle_names = parameter_names(structure.gauges.names, structure.counts)
        parts = self._parts_of_test()
        self.names = (*vehicle_names, *(name for names, _ in parts.values() for name in names))
        self.std = np.concatenate([self.prior.vector, *(std for _, std in parts.values())])
        ends = self.n_built + np.cumsum([len(std) for _, std in parts.values()])
        of = {what: np.arange(end - len(parts[what][1]), end) for what, end in zip(parts, ends, strict=True)}
        zero = np.arange(self.n_built)[slices(structure.counts)[ZERO]]
        of[ZERO] = np.append(zero, of[ZERO]).reshape(len(self.groups), -1)
        of["cell"] = np.append(of["cell"], of["curve"]).reshape(len(CELL + CURVE), -1)
        of["pad"] = of["pad"].reshape(-1, len(PAD_STEPS))
        self.entries = of

    def with_readings(self, readings: FloatArray, stds: FloatArray | None = None) -> ReadingsModel:
        """Return the model of the same loads with other readings (n_cases, n_d) [m/m]; solved parts are shared.

        ``stds`` (n_cases, n_d) are their standard deviations [m/m]; as they are by default.
        """
        reading_stds = self.test.reading_stds if stds is None else stds
        cases = tuple(
            replace(case, reading=row, reading_std=std)
            for case, row, std in zip(self.test.cases, readings, reading_stds, strict=True)
        )
        model = copy(self)
        model.test = replace(self.test, cases=cases)
        return model

    @property
    def noise_factor(self) -> float:
        """The noise that counts over what the test states [1]."""
        return float(np.prod([cause.factor for cause in self.causes if cause.where == "noise"]))

    def with_pads_of(self, vector: FloatArray) -> ReadingsModel:
        """Return the same model with changes by place, length and direction of loads of the vehicle and the errors
        in ``vector`` (n,). Taken from the drawing they would be wrong by its tolerances, a few percent."""
        model, errors = copy(self), self.errors(vector)
        model._kept = {}
        model._pads = self._pad_changes(self.structure.strain_near(self.built(vector)), errors.pad, errors.size)
        return model

    def with_std(self, std: FloatArray) -> ReadingsModel:
        """Return the same model with other standard deviations (n,) of the vector before the test."""
        model = copy(self)
        model.std, model.prior = std, self.prior.of_vector(std[: self.n_built])
        return model

    def with_wider_std(self, entries: IntArray, std: FloatArray | float) -> ReadingsModel:
        """Return the same model where ``entries`` (k,) have at least the standard deviations ``std`` (k,)."""
        wide = self.std.copy()
        wide[entries] = np.maximum(wide[entries], std)
        return self.with_std(wide)

    def of_causes(self, *causes: Cause) -> ReadingsModel:
        """Return the same model with more ``causes``."""
        model = copy(self)
        model.causes = (*self.causes, *causes)
        return model

    def at_drawing(self) -> tuple[FloatArray, csr_array]:
        """Return :meth:`jacobian` of the vehicle and the loads as stated."""
        return self.jacobian(np.zeros(len(self.std)))

    @property
    def group_of_case(self) -> IntArray:
        """(n_cases,) number of the zeros that each case has."""
        return np.array([self.groups.index(case.group) for case in self.test.cases], dtype=np.int64)

    @property
    def case_of_load(self) -> IntArray:
        """(n_loads,) number of the case of each load."""
        return np.array([k for k, _ in self.loads], dtype=np.int64)

    @property
    def is_zero(self) -> BoolArray:
        """(n,) whether an entry of the vector is a zero of the recorder, or its drift."""
        is_zero = np.zeros(len(self.std), dtype=bool)
        is_zero[self.entries[ZERO]] = is_zero[self.entries[DRIFT]] = True
        return is_zero

    @cached_property
    def gauge_of(self) -> IntArray:
        """(n,) the gauge whose readings alone depend on an entry of the vector, -1 of others."""
        gauge_of, where = np.full(len(self.std), -1), slices(self.structure.counts)
        for kind in GAUGE_KINDS:
            gauge_of[where[kind]] = np.arange(self.structure.n_gauges)
        for entries in (*self.entries[ZERO], self.entries[DRIFT], self.entries[HYSTERESIS]):
            gauge_of[entries] = np.arange(self.structure.n_gauges)
        return gauge_of

    def misfit(
        self, used: BoolArray, vector: FloatArray, predicted: FloatArray, noise: FloatArray | None = None
    ) -> FloatArray:
        """Return (n,) readings ``used`` less ``predicted``, then steps of their cases, over ``noise`` (n_used,) or
        what the test states."""
        residual = (self.test.readings - predicted)[used] / (
            self.test.reading_stds[used] if noise is None else noise
        )
        steps = self._steps(used)
        return np.concatenate(
            [residual, (steps.value - self._step_slopes(steps) @ vector[self.entries["cell"].ravel()]) / steps.std]
        )

    def slopes(self, used: BoolArray, jacobian: csr_array, noise: FloatArray | None = None) -> csr_array:
        """Return (m, n) derivatives of what :meth:`misfit` is of, over the same noise."""
        steps, noise = self._steps(used), self.test.reading_stds[used] if noise is None else noise
        readings = scaled_columns(jacobian[np.flatnonzero(used)], np.ones(len(self.std)), 1.0 / noise)
        of_steps = np.zeros((len(steps.value), len(self.std)))
        of_steps[:, self.entries["cell"].ravel()] = self._step_slopes(steps) / steps.std[:, None]
        return vstack([readings, csr_array(of_steps)]).tocsr()

    def linear(
        self, used: BoolArray, vector: FloatArray, predicted: FloatArray, jacobian: csr_array
    ) -> GaussianModel:
        """Return the readings ``used``, linear about ``vector``, by unknowns in their standard deviations."""
        free = np.flatnonzero(self.std > 0.0)
        rows = scaled_columns(self.slopes(used, jacobian), self.std)[:, free]
        misfit = self.misfit(used, vector, predicted) + rows @ (vector[free] / self.std[free])
        return GaussianModel(rows, misfit, self.gauge_of[free])

    def _steps(self, used: BoolArray) -> StepParts:
        return step_parts(self.test, np.asarray(used.any(axis=1)))

    def _step_slopes(self, steps: StepParts) -> FloatArray:
        """Return (m, 4 n_cells) derivatives of the values of :func:`step_parts`."""
        slopes = np.zeros((len(steps.value), len(CELL + CURVE), len(self.cells)))
        for row, cell, force, part in zip(slopes, steps.cell, steps.force, steps.part, strict=True):
            row[:, self.cells.index(cell)] = self._cell_columns(cell, part * force) - self._cell_columns(
                cell, force
            )
        return slopes.reshape(len(slopes), len(CELL + CURVE) * len(self.cells))

    def built(self, vector: FloatArray) -> AsBuilt:
        """Return the vehicle's part of a vector."""
        return self.prior.of_vector(vector[: self.n_built])

    def errors(self, vector: FloatArray) -> StatedErrors:
        """Return the test's part of a vector."""
        of = {what: vector[entries] for what, entries in self.entries.items()}
        of["pad"][:, -2:] += self._turns @ of["direction"]
        return StatedErrors(
            zero=of[ZERO],
            scale=of["load"] + self._on_cell @ of["cell"].ravel(),
            pad=of["pad"],
            rig=float(of["rig"][0]),
            size=float(of["size"][0]),
            drift=of[DRIFT],
            hysteresis=of["hysteresis of all"] + of[HYSTERESIS],
        )

    def load_strains(self, as_built: AsBuilt) -> FloatArray:
        """Return (n_loads, n_d) readings of every load as stated, without zeros [m/m]."""
        if not self.loads:
            return np.zeros((0, self.structure.n_gauges))
        return self.structure.response_strain(as_built, self._responses)

    def _load_slopes(self, as_built: AsBuilt) -> tuple[FloatArray, dict[Key, FloatArray]]:
        """Return :meth:`load_strains`, and their derivatives (n_d, n_loads) by key."""
        if not self.loads:
            return self.load_strains(as_built), {}
        reading, slopes = self.structure.response_slopes(as_built, self._responses, self.structure.solved_keys)
        return reading.T, slopes

    @property
    def _responses(self) -> Any:
        if "loads" not in self._together:
            self._together["loads"] = self.structure.responses([known.load for _, known in self.loads])
        return self._together["loads"]

    def _weighs_rig(self, vector: FloatArray) -> bool:
        """Whether the mass of the rig is, or may be, another one than zero."""
        (rig,) = self.entries["rig"]
        return bool(self.std[rig] > 0.0 or vector[rig] != 0.0)

    def _rig_strains(self, as_built: AsBuilt, exact: bool) -> FloatArray:
        """Return (n_cases, n_d) what a rig of 1 kg strains in each case; on the wall of the drawing if not
        ``exact``."""
        strain = np.zeros((len(self.test.cases), self.structure.n_gauges))
        if not self._hung:
            return strain
        key = "rig" if exact else "rig, by the drawing"
        if key not in self._together:
            loads, structure = [load for _, load in self._hung], self.structure
            self._together[key] = structure.responses(loads) if exact else structure.nominal_response(loads)
        np.add.at(
            strain, [k for k, _ in self._hung], self.structure.response_strain(as_built, self._together[key])
        )
        return strain

    def readings(self, vector: FloatArray) -> FloatArray:
        """Return what the gauges should read (n_cases, n_d) [m/m]."""
        as_built = self.built(vector)
        rig = self._rig_strains(as_built, self._weighs_rig(vector))
        return self._joined(self.load_strains(as_built), self.errors(vector), rig)

    def jacobian(self, vector: FloatArray) -> tuple[FloatArray, csr_array]:
        """Return readings (n_cases, n_d) and their derivatives (n_cases n_d, n), 0 for what is known exactly.

        The derivatives at the last vector are kept for the next time, and the derivatives at the drawing.
        Measured readings and standard deviations do not change them.
        """
        place = not vector.any(), self._weighs_rig(vector)
        if place not in self._kept or not np.array_equal(self._kept[place][0], vector):
            self._kept[place] = vector.copy(), *self._slopes(vector)
        _, readings, jacobian = self._kept[place]
        unknown = np.ones(len(self.std))
        for key in set(derivative_keys(self.structure.counts)) - set(uncertain_keys(self.prior)):
            unknown[self._of_key(key)] = 0.0
        return readings, scaled_columns(jacobian, unknown)

    def _of_key(self, key: Key) -> slice:
        """Return where the parameters of a key stand in the vector."""
        place = slices(self.structure.counts)[key[0]]
        return place if of_gauges(key) else slice(place.start + key[1], place.start + key[1] + 1)

    def _slopes(self, vector: FloatArray) -> tuple[FloatArray, csr_array]:
        """Return :meth:`jacobian` by all keys that the structure was solved for."""
        as_built, errors = self.built(vector), self.errors(vector)
        n_d, where = self.structure.n_gauges, slices(self.structure.counts)
        slopes, gauge = _Derivatives(len(self.test.cases), n_d, len(vector)), np.arange(n_d)
        strain, derivatives = self._load_slopes(as_built)
        for key, value in derivatives.items():
            numbers = gauge if of_gauges(key) else key[1]
            slopes.add(
                slopes.rows, where[key[0]].start + numbers, self._summed((1.0 + errors.scale)[:, None] * value.T)
            )
        for rows, group in zip(slopes.rows, self.group_of_case.tolist(), strict=True):
            slopes.add(rows, self.entries[ZERO][group], 1.0)
        pads = [columns.copy() for columns in self._pads.columns]
        for columns, numbers, tilt in zip(pads, strain, errors.pad[:, -2:], strict=True):
            columns[-2:] -= np.outer(tilt, numbers)
        self._load_derivatives(slopes, strain, pads)
        rig = self._rig_strains(as_built, self._weighs_rig(vector))
        readings = self._joined(strain, errors, rig)
        slopes.add(slopes.rows, self.entries["rig"], rig)
        slopes.add(slopes.rows, self.entries["size"], self._summed(self._pads.sizes))
        slopes.add(slopes.rows, self.entries[DRIFT], self.time[:, None])
        before = (readings - self._zeros(errors))[:-1]
        for entries in (self.entries[HYSTERESIS], self.entries["hysteresis of all"]):
            slopes.add(slopes.rows[1:], entries, before)
        return readings, slopes.joined()

    def held_derivatives(self, vector: FloatArray) -> dict[Key, FloatArray]:
        """Return the derivatives (n_cases, n_d) of the readings by what is taken for zero but need not be."""
        known = set(uncertain_keys(self.prior))
        regions = range(self.structure.n_regions)
        keys = [(kind, k) for kind in HELD_KINDS for k in regions if (kind, k) not in known]
        std = self.std.copy()
        for key in keys:
            std[self._of_key(key)] = 1.0
        slopes, shape = self.with_std(std).jacobian(vector)[1].tocsc(), self.test.readings.shape
        return {key: slopes[:, [self._of_key(key).start]].toarray().reshape(shape) for key in keys}

    def _joined(self, strain: FloatArray, errors: StatedErrors, rig: FloatArray) -> FloatArray:
        pads = self._pads
        moved = np.array([pad @ columns for pad, columns in zip(errors.pad, pads.columns, strict=True)])
        moved = (moved + errors.size * pads.sizes + pads.rest).reshape(strain.shape)
        total = ((1.0 + errors.scale) * errors.along)[:, None] * (strain + moved)
        strain = self._summed(total) + errors.rig * rig
        strain[1:] += errors.hysteresis * strain[:-1].copy()
        return strain + self._zeros(errors)

    def _zeros(self, errors: StatedErrors) -> FloatArray:
        """Return what every case reads without load (n_cases, n_d)."""
        return np.asarray(errors.zero[self.group_of_case] + self.time[:, None] * errors.drift)

    def _summed(self, by_load: FloatArray) -> FloatArray:
        """Return (n_cases, n_d) sums of (n_loads, n_d) over the loads of each case."""
        total = np.zeros((len(self.test.cases), self.structure.n_gauges))
        np.add.at(total, self.case_of_load, by_load)
        return total

    def _load_derivatives(self, slopes: _Derivatives, strain: FloatArray, pads: list[FloatArray]) -> None:
        """Add the derivatives by the errors of every load, and of their cells and direction in common."""
        of = self.entries
        for number, (case, _) in enumerate(self.loads):
            rows = slopes.rows[case][:, None]
            slopes.add(rows, of["load"][number], strain[number][:, None])
            slopes.add(rows, of["cell"].ravel(), np.outer(strain[number], self._on_cell[number]))
            slopes.add(rows, of["pad"][number], pads[number].T)
            slopes.add(rows, of["direction"], pads[number][-2:].T @ self._turns[number])

    def _load_cells(self) -> FloatArray:
        """Return (n_loads, 4 n_cells) relative change of every load by each error of every cell."""
        changes = np.zeros((len(self.loads), len(CELL + CURVE), len(self.cells)))
        for row, (_, known) in zip(changes, self.loads, strict=True):
            if known.on_load_cell:
                row[:, self.cells.index(known.load_cell)] = self._cell_columns(
                    known.load_cell, cell_force(known.load)
                )
        return changes.reshape(len(changes), len(CELL + CURVE) * len(self.cells))

    @cached_property
    def full_scale(self) -> dict[str, float]:
        """Full scale of each load cell, the largest of its forces where none is stated [N]."""
        scales = dict.fromkeys(self.cells, 0.0)
        for _, known in self.loads:
            if known.on_load_cell:
                scales[known.load_cell] = max(scales[known.load_cell], cell_force(known.load))
        return scales | {name: self.test.full_scale[name] for name in scales if name in self.test.full_scale}

    def _cell_columns(self, cell: str, force: float) -> FloatArray:
        """Return (4,) relative change of a load of which the cell reads ``force`` [N] by each of its errors."""
        if force <= 0.0:
            return np.array([1.0, 0.0, 0.0, 0.0])
        u = force / self.full_scale[cell]
        curve = 6.0 * np.sqrt(3.0) * (1.0 - u) * (1.0 - 2.0 * u)
        return np.array([1.0, 1.0 / force, 4.0 * (1.0 - u), curve])

    def _pad_changes(self, strain_of: StrainOfLoads, error: FloatArray, size: float) -> _PadChanges:
        """Return what errors of the loads change about ``error`` (n_loads, 5), the ``size`` of all pads in it."""
        loads, about = [known.load for _, known in self.loads], error.copy()
        about[:, 2] += [0.0 if isinstance(load, PointForce) else size for load in loads]
        changes = [self._pad_columns(load, strain_of, at) for load, at in zip(loads, about, strict=True)]
        sizes = [
            self._size_column(load, slopes[2], strain_of) for load, (slopes, _) in zip(loads, changes, strict=True)
        ]
        return _PadChanges(
            [slopes for slopes, _ in changes], np.array(sizes), np.array([rest for _, rest in changes])
        )

    def _pad_columns(
        self, load: Load, strain_of: StrainOfLoads, error: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return (5, n_d) change of the readings by place, roll, shape and both tilts of a load about an ``error``
        (5,) of these, zeros for what it does not have; and (n_d,) what that leaves of their change by the error.

        A tilt adds to the force here, which is linear; that its size stays is :attr:`StatedErrors.along`.
        """
        placed, tilts = isinstance(load, PLACED), isinstance(load, DIRECTED) and any(load.force)
        has = np.array([placed, placed, placed and not isinstance(load, PointForce), tilts, tilts])
        slopes = np.zeros((len(PAD_STEPS), self.structure.n_gauges))
        if not has.any():
            return slopes, slopes[0]
        least, most = -FAR, FAR.copy()
        if isinstance(load, PLACED):  # a pad at an end of the body stays on it
            least[0], most[0] = np.clip(np.asarray(self.structure.outer_span) - load.station, -FAR[0], FAR[0])

        def at(change: FloatArray) -> Load:
            possible = np.clip(change, least, most) * has
            return scaled(elsewhere(load, possible), float(np.hypot(1.0, np.hypot(*possible[-2:]))))

        rows, steps = np.flatnonzero(has), np.diag(list(PAD_STEPS.values()))
        centre = np.clip(error, least, most)
        parts = [(1.0, -1.0)] * 3 + [(0.0, -outward) for outward in np.copysign(1.0, centre[-2:]).tolist()]
        ends = [centre + part * steps[row] for row in rows for part in parts[row]]
        strain, (moved_strain, stated) = np.split(strain_of([*map(at, ends), at(centre), load]), [2 * len(rows)])
        length = np.array([np.clip(end, least, most)[row] for row, end in zip(rows.repeat(2), ends, strict=True)])
        slopes[rows] = (strain[::2] - strain[1::2]) / (length[::2] - length[1::2])[:, None]
        return slopes, moved_strain - stated - centre @ slopes

    def _size_column(self, load: Load, by_shape: FloatArray, strain_of: StrainOfLoads) -> FloatArray:
        """Return (n_d,) change of the readings by the size of a pad, ``by_shape``, or by a point that is a pad."""
        if not isinstance(load, PointForce):
            return by_shape
        radius = self.structure.loaded.outer_radius(load.station)
        pad = PadForce(
            station=load.station,
            roll_angle=load.roll_angle,
            half_length=PAD,
            half_angle=PAD / radius,
            force=load.force,
        )
        point, spread = strain_of([load, pad])
        return np.asarray(spread - point)

    def _parts_of_test(self) -> dict[str, tuple[list[str], FloatArray]]:
        """Return names and standard deviations of the entries behind the vehicle's, in their order."""
        gauges, errors = self.structure.gauges.names, self.test.errors
        labels = [
            f"{load_kind(known.load)} {number} of {self.test.cases[case].name}"
            for number, (case, known) in enumerate(self.loads, start=1)
        ]
        cells = [""] if self.cells == ["1"] else [f" {cell}" for cell in self.cells]
        stated = [errors.common, errors.cell_offset, errors.cell_curve, errors.cell_curve]
        of_cells, of_curves = np.split(np.repeat(stated, len(self.cells)) * self._on_cell.any(axis=0), 2)
        pad = np.array([errors.pad_position, errors.pad_roll, errors.pad_shape, errors.tilt, errors.tilt])
        of_pads = [pad * columns.any(axis=1) for columns in self._pads.columns]
        none, mass = np.zeros(len(gauges)), errors.rig_mass if self._hung else 0.0
        return {
            ZERO: (
                [f"zero {gauge}, zeros '{group}'" for group in self.groups[1:] for gauge in gauges],
                np.tile(self.prior.zero, len(self.groups) - 1),
            ),
            "load": ([f"load {label}" for label in labels], np.array([known.std for _, known in self.loads])),
            "cell": ([f"{error}{cell}" for error in CELL for cell in cells], of_cells),
            "pad": (
                [f"pad {what} {label}" for label in labels for what in PAD_STEPS],
                np.array(of_pads).ravel(),
            ),
            "direction": ([f"direction of all forces {along}" for along in DIRECTIONS], np.zeros(len(DIRECTIONS))),
            "rig": ([RIG], np.array([mass])),
            "size": (["size of all pads"], np.zeros(1)),
            "curve": ([f"{error}{cell}" for error in CURVE for cell in cells], of_curves),
            DRIFT: ([f"{DRIFT} {gauge}" for gauge in gauges], none + errors.drift),
            HYSTERESIS: ([f"{HYSTERESIS} {gauge}" for gauge in gauges], none),
            "hysteresis of all": ([HYSTERESIS], np.zeros(1)),
        }


def _hung_loads(test: LoadTest) -> list[tuple[int, Load]]:
    """Return what 1 kg of rig makes of every pad and point, each with the number of its case."""
    return [
        (k, hanging(known.load, case, 1.0))
        for k, case in enumerate(test.cases)
        for known in case.loads
        if isinstance(known.load, PLACED)
    ]


def solved_loads(test: LoadTest) -> list[Load]:
    """Return the loads that a structure is solved for by a model of ``test``."""
    return [known.load for case in test.cases for known in case.loads] + [load for _, load in _hung_loads(test)]


def _of_test(prior: AsBuilt, test: LoadTest) -> AsBuilt:
    """Return ``prior`` with the mass as the test states it; without a load of mass that is not in the readings."""
    if not any(isinstance(known.load, OF_MASS) for case in test.cases for known in case.loads):
        return prior.changed(mass=0.0, region_mass=np.zeros(prior.n_regions))
    return prior if test.errors.mass is None else prior.changed(mass=test.errors.mass)
