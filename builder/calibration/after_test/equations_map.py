"""A map from load equations: the loads are its states, and its estimate is the equations'.

With equations L = beta mu and A the strain per load by the same test, scaled so that beta A = 1, every reading is

    mu = A L + N y,  N an orthonormal basis of beta x = 0,

and least squares weighted by the covariance A S A' + N Y N' gives L = beta mu with the covariance S. S is of the
loads that are left out of the fit one by one, Y of what the applied loads leave in N: chi-square of y is the check
that redundant gauges allow. Without redundancy there is no y, and a fault of a gauge is a load.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np
from scipy.special import stdtrit

from builder.calibration.estimate.regression import LoadEquation, load_equation
from builder.calibration.ground_test.equations_file import AT_STATION, WHOLE, AppliedTest
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import ABSOLUTE, COEFFICIENT_NAMES, PER_PRESSURE, InverseMap

LARGEST_STRAIN = 0.1
"""Mean change of readings beyond which the stated unit must be wrong [m/m or V/V]."""

WIDE = 1e3
"""Standard deviation of a load before a reading over the largest applied one, where no gauge is redundant."""

ROUNDING = 1e-6
"""Part of a load, or of a row's own say on its prediction, below which it is rounding."""

LEAST_UNLIKE, RARE = 0.1, 1e-4
"""A reading is named where its residual exceeds this part of the gauge's largest change, and is less probable than
this in a whole test of sound readings."""

FLOOR = 1e-3
"""Part of a gauge's residual that is taken for its own, so that few rows leave a covariance of full rank."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedEquations:
    """Load equations of a test.

    Attributes
    ----------
    test : the test.
    equations : one for each load, in the order of the file.
    zero : (n_d,) reading without load [m/m].
    load_covariance : (n_l, n_l) of a load's error [(N, N m)^2].
    strain_per_load : (n_d, n_l) A [(m/m) / (N, N m)].
    """

    test: AppliedTest
    equations: tuple[LoadEquation, ...]
    zero: FloatArray
    load_covariance: FloatArray
    strain_per_load: FloatArray

    @property
    def gain(self) -> FloatArray:
        """(n_l, n_d) beta [(N, N m) / (m/m)]."""
        return _gain(self.equations, self.test.strain.shape[1])

    @property
    def predicted(self) -> FloatArray:
        """(n, n_l) loads of every row by the equations [N, N m]."""
        return np.asarray((self.test.strain - self.zero) @ self.gain.T)

    @property
    def strain_left(self) -> FloatArray:
        """(n, n_d) readings less what the predicted loads strain [m/m]; 0 without redundancy."""
        return np.asarray(self.test.strain - self.zero - self.predicted @ self.strain_per_load.T)

    @property
    def unlike(self) -> dict[int, list[str]]:
        """Gauges, by line of the table, whose readings are unlike what the other rows give at these loads.

        By Student's t of the residual over the standard deviation that the other rows leave, and beyond
        :data:`LEAST_UNLIKE` of the gauge's largest change.
        """
        fitted = ~self.test.is_check
        strain, load = self.test.strain[fitted] - self.zero, self.test.load[fitted]
        known = np.column_stack([load / np.abs(load).max(axis=0), np.ones(len(load))])
        projection = known @ np.linalg.pinv(known)
        rest, freedom = strain - projection @ strain, len(load) - known.shape[1] - 1
        alone = np.maximum(1.0 - np.diag(projection), ROUNDING)[:, None]
        variance = np.maximum((rest**2).sum(axis=0) - rest**2 / alone, 0.0) / max(freedom, 1)
        is_rare = rest**2 > stdtrit(max(freedom, 1), RARE / rest.size) ** 2 * alone * variance
        is_unlike = is_rare & (np.abs(rest) > LEAST_UNLIKE * alone * np.abs(strain).max(axis=0))
        lines, names = np.array(self.test.line)[fitted], self.test.file.readings.gauges
        return {
            int(lines[row]): [names[gauge] for gauge in np.flatnonzero(is_unlike[row])]
            for row in np.flatnonzero(is_unlike.any(axis=1))
            if freedom > 0
        }

    @property
    def redundancy(self) -> int:
        """Gauges less loads."""
        return self.test.strain.shape[1] - len(self.equations)


def fit_equations(test: AppliedTest) -> FittedEquations:
    """Return the load equations of a test.

    Raises
    ------
    InputError
        There are fewer rows or gauges than the equations need, or loads that do not differ independently.
    """
    file, fitted = test.file, ~test.is_check
    table = file.beside(file.readings.table)
    strain, load = test.strain[fitted], test.load[fitted]
    n_d, n_l = strain.shape[1], load.shape[1]
    if n_d < n_l:
        raise InputError(f"{file.path}: readings.gauges: expected at least {n_l}, one for each load, got {n_d}")
    most = max(len(load.gauges or file.readings.gauges) for load in file.load) if file.method == "all" else n_l
    if len(load) <= max(most, n_l) + 1:
        raise InputError(
            f"{table}: expected more rows than the {max(most, n_l)} gauges of an equation and one for the zeros, "
            f'got {len(load)}; apply more loads, name fewer gauges, or state method = "selected" or "ridge"'
        )
    size = np.abs(load).max(axis=0)
    _check_columns(test, strain, size)
    if np.linalg.matrix_rank(load / size) < n_l:
        raise InputError(f"{table}: expected loads that differ independently, got some that go together")
    none = ~load.any(axis=1)
    is_fitted = not none.any()
    zero, level = (
        (strain if is_fitted else strain[none]).mean(axis=0),
        load.mean(axis=0) if is_fitted else 0.0 * size,
    )
    change, of_load = strain - zero, load - level
    names = file.readings.gauges
    equations = tuple(
        load_equation(
            load.name if load.x_m is None else f"{load.name} at {load.x_m:g} m",
            change,
            of_load[:, k],
            [names.index(gauge) for gauge in load.gauges or names],
            file.method,
            known=int(is_fitted),
        )
        for k, load in enumerate(file.load)
    )
    empty = [equation.load for equation in equations if not equation.gauges]
    if empty:
        raise InputError(f"{table}: {empty[0]}: expected gauges whose T is 4 or more, got none")
    per_load = np.linalg.lstsq(of_load / size, change, rcond=None)[0].T / size
    coupling = _gain(equations, n_d) @ per_load
    if np.linalg.matrix_rank(coupling * size / size[:, None], tol=ROUNDING) < n_l:
        raise InputError(
            f"{table}: expected gauges that read the {n_l} loads differently, got such that read some alike"
        )
    per_load = per_load @ np.linalg.inv(coupling)
    left_out = np.column_stack([equation.left_out for equation in equations])
    return FittedEquations(
        test=test,
        equations=equations,
        zero=zero - per_load @ level,
        load_covariance=left_out.T @ left_out / len(left_out) + np.diag((1e-9 * size) ** 2),
        strain_per_load=per_load,
    )


def _check_columns(test: AppliedTest, strain: FloatArray, size: FloatArray) -> None:
    """Refuse loads that are never applied, gauges that never change, and readings in another unit than stated."""
    file, entries = test.file, test.file.readings
    table = file.beside(entries.table)
    never = [load.column for load, largest in zip(file.load, size, strict=True) if not largest]
    if never:
        raise InputError(f"{table}: {never[0]}: expected loads, got none in the rows that are fitted")
    still = [name for name, change in zip(entries.gauges, np.ptp(strain, axis=0), strict=True) if not change]
    if still:
        raise InputError(f"{table}: {still[0]}: expected readings that change with the loads, got one in all rows")
    change = float(np.abs(strain - strain.mean(axis=0)).mean())
    if change > LARGEST_STRAIN:
        raise InputError(
            f"{file.path}: readings.unit: expected changes of at most {LARGEST_STRAIN:g} m/m or V/V, got "
            f"{change:.3g} in '{entries.unit}'"
        )


def _gain(equations: Sequence[LoadEquation], n_gauges: int) -> FloatArray:
    gain = np.zeros((len(equations), n_gauges))
    for row, equation in zip(gain, equations, strict=True):
        row[list(equation.gauges)] = equation.coefficient
    return gain


def equations_map(fitted: FittedEquations) -> InverseMap:
    """Return the map of the equations."""
    file, gain, per_load = fitted.test.file, fitted.gain, fitted.strain_per_load
    n_d, n_l = per_load.shape
    applied = fitted.test.load[~fitted.test.is_check]
    size = np.abs(applied).max(axis=0)
    strain = fitted.test.strain[~fitted.test.is_check] - fitted.zero
    largest = np.abs(strain).max(axis=0)
    covariance = per_load @ fitted.load_covariance @ per_load.T
    if fitted.redundancy:
        residual = fitted.strain_left[~fitted.test.is_check]
        rest = residual.T @ residual / max(len(residual) - n_l, 1)
        rest += FLOOR * np.diag(np.maximum(np.diag(rest), (1e-6 * largest) ** 2))
        null = np.linalg.svd(gain * largest)[2][n_l:].T * largest[:, None]
        pick = np.linalg.inv(np.hstack([per_load * size, null]))[n_l:]
        covariance = covariance + null @ (pick @ rest @ pick.T) @ null.T
    covariance = 0.5 * (covariance + covariance.T)
    names, stations = _map_loads(fitted)
    place = [names.index((load.name, load.x_m)) for load in file.load]
    load_per_state, limits = np.zeros((len(names), n_l)), np.zeros((len(names), 2))
    load_per_state[place, np.arange(n_l)] = size
    limits[place] = np.column_stack([applied.min(axis=0), applied.max(axis=0)])
    area, length = file.reference.area_m2, file.reference.length_m
    scale = file.reference.dynamic_pressure_Pa * area * np.array([1.0, 1.0, 1.0, length, length])
    limits = np.clip(limits[: len(COEFFICIENT_NAMES)], [-np.inf, 0.0], [0.0, np.inf]) / scale[:, None]
    known = limits.any(axis=1)
    axes = np.eye(5)[known]
    is_redundant = fitted.redundancy > 0
    wide = size if is_redundant else WIDE * size
    return InverseMap(
        vehicle=file.name,
        case=1 if is_redundant else 2,
        gauge_names=tuple(file.readings.gauges),
        gauge_position=np.zeros((n_d, 3)),
        gauge_direction=np.tile([1.0, 0.0, 0.0], (n_d, 1)),
        noise_std=np.sqrt(np.diag(covariance)),
        state_operator=per_load * wide,
        gauge_covariance=covariance,
        error_strain=np.zeros((n_d, 0)),
        error_load=np.zeros((len(names), 0)),
        regularisation=0.0 if is_redundant else 1.0,
        load_per_state=load_per_state * (wide / size),
        load_of_mean=np.zeros(len(names)),
        mean_strain=np.zeros(n_d),
        strain_range=largest,
        coefficient_range=limits,
        reference_area=area,
        reference_length=length,
        nominal_dynamic_pressure=file.reference.dynamic_pressure_Pa,
        envelope_direction=np.vstack([axes, -axes]),
        envelope_limit=np.concatenate([limits[known, 1], -limits[known, 0]]),
        # The form whose FMUs state further loads; states are free, so that these do not depend on q_inf.
        form=PER_PRESSURE if len(names) > len(COEFFICIENT_NAMES) else ABSOLUTE,
        zero_offset=fitted.zero,
        section_station=stations,
        provenance={
            "made_by": "strainfmu equations",
            "load_equations": {
                "test": file.path.name,
                "tested_on": date.isoformat(file.tested_on) if file.tested_on else "",
                "method": file.method,
                "loads": [equation.load for equation in fitted.equations],
                "redundant_gauges": fitted.redundancy,
                "faults_of_gauges": "by chi-square" if is_redundant else "cannot be detected",
            },
        },
    )


def _map_loads(fitted: FittedEquations) -> tuple[list[tuple[str, float | None]], FloatArray]:
    """Return name and station of every load of the map, which has all loads of a body or a section or none, and
    the stations."""
    wanted, last = fitted.test.file.load, list(WHOLE)[-1]
    stations = sorted({load.x_m for load in wanted if load.x_m is not None})
    has_last = stations or any(load.name == last for load in wanted)
    names: list[tuple[str, float | None]] = [(name, None) for name in WHOLE if name != last or has_last]
    names += [(name, station) for name in AT_STATION for station in stations]
    return names, np.array(stations)
