"""Load cases whose readings are of another load than the one stated: found by the other cases, and named.

The readings of each case are predicted by all other cases together, of a model that is linear at the drawing. A
case is wrong where the readings of an eighth of its gauges are off: a gauge at fault is off in all cases, but
alone. The case that is off most is left out first, then the others are judged again. What would make its
readings right is its name: a factor of a unit, another sign, the loads of another case, another attitude, a
recorder balanced again, a mass that hangs on a load; otherwise the factor that fits best. Source: leave-one-out
residuals of a Gaussian model, Rasmussen & Williams, *Gaussian Processes for Machine Learning*, section 5.4.2,
block by block.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from scipy.sparse import csr_array
from scipy.special import chdtrc

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.gaussian import GaussianModel
from builder.calibration.estimate.readings_model import DRIFT, ReadingsModel, scaled_columns
from builder.calibration.ground_test.equations_file import FORCES
from builder.calibration.ground_test.load_changes import cell_force, hanging, is_along
from builder.calibration.ground_test.load_test import LoadCase
from builder.structure.as_built.as_built_structure import OF_MASS
from builder.structure.loads.applied import STANDARD_GRAVITY, PadForce, PointForce, Weight
from strainfmu.arrays import BoolArray, FloatArray

OFF = 4.0
"""Standard deviations from which the reading of a gauge is off."""

GAUGES_OFF = 0.12
"""Part of the gauges of a case from which the load, not a gauge, is wrong."""

MOST_CASES = 0.34
"""Part of the cases that may be wrong; more, and it is rather the vehicle or all loads."""

MODEL = 0.01
"""Part of the strain by which the linear model may err."""

MASS, SIZE = 10.0, 0.3
"""Standard deviations of a mass that hangs on a load [kg], and of a load's own error [1]."""

FITS = 1e-3
"""Probability from which the readings of a gauge or of a case fit a cause."""

FACTORS = {
    FORCES[actual] / FORCES[stated]: f"stated in {stated}, applied in {actual}"
    for stated, actual in (*permutations(("N", "kgf", "lbf"), 2), ("N", "kN"))
} | {-1.0: "wrong sign of the load", 0.0: "no load acted"}
"""Causes that multiply a load, by the factor."""

NO_CAUSE = "its readings fit no cause that is known"

NEAR_UNIT = 0.1
"""Part of a unit's factor by which the factor of a load may differ from it to be said to be near."""

TURNS = {90.0: "turned by 90 deg", 180.0: "turned by 180 deg", 270.0: "turned by -90 deg"}
"""Attitudes other than the stated one, by the change of the roll angle that is up [deg]."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A gauge or a load case that does not fit.

    Attributes
    ----------
    where : name of the gauge or of the load case.
    kind : of gauges "swapped", "sign", "unit", "dead", "gain" or "gauge"; of cases "unit", "sign", "no load",
        "duplicate", "interchanged", "mislabelled", "attitude", "balance", "mass" or "load".
    line : one sentence for the user.
    factor : that makes a case of kind "load" fit; NaN of others, and where none does.
    """

    where: str
    kind: str
    line: str
    factor: float = float("nan")


@dataclass(frozen=True, eq=False, kw_only=True)
class _Cause:
    """Readings (n_d,) of a case by one cause, and derivatives (n_d, n) by the vector.

    ``more`` (n_d, k) is what quantities of its own add, of standard deviation 1 about 0; ``size`` says the first
    one in words.
    """

    kind: str
    text: str
    reading: FloatArray
    columns: FloatArray
    more: FloatArray | None = None
    size: Callable[[float], str] = lambda size: ""


def case_faults(model: ReadingsModel, used: BoolArray) -> list[Fault]:
    """Return the cases whose readings no vehicle has under the loads as stated; none where too many are wrong.

    ``used`` (n_cases, n_d) are the readings to judge by.
    """
    screen = _Screen(model, used)
    wrong = screen.wrong_cases()
    return [screen.named(case, wrong) for case in sorted(wrong)]


def case_fault_after(fit: Estimate, case: int) -> Fault:
    """Return what is wrong with a case by the vehicle that the other cases of an estimate show."""
    return _Screen(fit.model, fit.used).named(case, {case})


class _Screen:
    """The linear model of all readings."""

    def __init__(self, model: ReadingsModel, used: BoolArray) -> None:
        self.model, self.used = model, used
        self.predicted, jacobian = model.at_drawing()
        self.rows = scaled_columns(jacobian, model.std)
        self.reading = model.test.readings
        self.noise = model.test.reading_stds**2 + (MODEL * self.predicted) ** 2

    def columns(self, case: int) -> FloatArray:
        """Return the derivatives (n_d, n) of a case by the vector in its standard deviations."""
        n_d = self.used.shape[1]
        return np.asarray(self.rows[case * n_d : (case + 1) * n_d].toarray())

    def wrong_cases(self) -> set[int]:
        """Return the numbers of the wrong cases: the worst first, then those that are left."""
        sound = [k for k in range(len(self.used)) if self.used[k].any()]
        most, wrong = MOST_CASES * len(sound), set[int]()
        while len(sound) > 2:
            off = self._left_out(sound)
            worst = max(off, key=lambda k: off[k][1])
            if off[worst][0] < GAUGES_OFF:
                return wrong
            wrong.add(worst)
            sound.remove(worst)
            if len(wrong) > most:
                return set()
        return set()

    def _left_out(self, sound: list[int]) -> dict[int, tuple[float, float]]:
        """Return, for each case of ``kept``, the part of its gauges that are off, and its chi-square."""
        linear, distances, first = self._linear(sound), {}, 0
        for k in sound:
            rows = np.arange(first, first + int(self.used[k].sum()))
            error, covariance = linear.without(rows)
            off = np.abs(error) > OFF * np.sqrt(np.diag(covariance))
            distances[k] = float(np.mean(off)), float(error @ linear.weighted[rows])
            first += len(rows)
        return distances

    def _linear(self, chosen: list[int]) -> GaussianModel:
        """Return the model of the readings of the cases ``kept``, which follow each other."""
        some = np.zeros(self.used.shape, dtype=bool)
        some[chosen] = self.used[chosen]
        weight = 1.0 / np.sqrt(self.noise[some])
        rows = scaled_columns(self.rows[np.flatnonzero(some)], np.ones(self.rows.shape[1]), weight)
        return GaussianModel(rows, weight * (self.reading - self.predicted)[some], self.model.gauge_of)

    def named(self, case: int, wrong: set[int]) -> Fault:
        """Return what is wrong with a case, by the vehicle that the cases other than ``wrong`` show."""
        sound = self._linear([k for k in range(len(self.used)) if k not in wrong and self.used[k].any()])
        mean, name = sound.mean, self.model.test.cases[case].name
        best, most, text = None, -np.inf, ""
        for cause in self._causes(case, wrong):
            chance, likelihood, size = self._fit(case, cause, sound)
            if chance > FITS and likelihood > most:
                best, most, text = cause, likelihood, cause.text + cause.size(size)
        if best is not None and best.kind != "load":
            return Fault(where=name, kind=best.kind, line=f"load case '{name}': {text}")
        text, factor = self._by_a_factor(case, mean)
        return Fault(where=name, kind="load", line=f"load case '{name}': {text}", factor=factor)

    def _fit(self, case: int, cause: _Cause, sound: GaussianModel) -> tuple[float, float, float]:
        """Return the probability of readings as far from a cause's, the logarithm of their density, its size.

        ``sound`` is the model of the other cases.
        """
        gauges = np.flatnonzero(self.used[case])
        noise = self.model.test.reading_stds[case, gauges] ** 2 + (MODEL * cause.reading[gauges]) ** 2
        single, common = sound.precision.halves(csr_array(cause.columns[gauges]))
        covariance = (single @ single.T).toarray() + common @ common.T + np.diag(noise)
        if cause.more is not None:
            covariance += cause.more[gauges] @ cause.more[gauges].T
        residual = self.reading[case, gauges] - cause.reading[gauges] - cause.columns[gauges] @ sound.mean
        weighted = np.linalg.solve(covariance, residual)
        square = float(residual @ weighted)
        size = 0.0 if cause.more is None else float(cause.more[gauges, 0] @ weighted)
        density = -0.5 * (square + float(np.linalg.slogdet(covariance)[1]))
        return float(chdtrc(len(gauges), square)), density, size

    def _parts(self, case: int) -> tuple[FloatArray, FloatArray]:
        """Return the columns (n_d, n) of ``case`` by zeros of the recorder, and by all else."""
        is_zero, columns = self.model.is_zero, self.columns(case)
        return np.where(is_zero, columns, 0.0), np.where(is_zero, 0.0, columns)

    def _causes(self, case: int, wrong: set[int]) -> Iterator[_Cause]:
        """Yield what the readings of a case may be of."""
        (of_zeros, of_load), load = self._parts(case), self.predicted[case]
        weight, of_weight = self._of_weight(case)
        for factor, text in FACTORS.items():
            kind = {-1.0: "sign", 0.0: "no load"}.get(factor, "unit")
            if self._weighs(case):
                continue  # no load cell reads it; the vehicle upside down is an attitude
            yield _Cause(
                kind=kind,
                text=text,
                reading=weight + factor * (load - weight),
                columns=of_zeros + of_weight + factor * (of_load - of_weight),
            )
        yield _Cause(kind="balance", text="the recorder was balanced again", reading=load, columns=of_load)
        yield from self._of_masses(case)
        yield from self._of_other_cases(case, wrong)
        yield from self._of_attitudes(case, of_zeros)

    def _of_masses(self, case: int) -> Iterator[_Cause]:
        """Yield what hangs on a load without being stated, and a load of another size to compare it with."""
        stated, structure = self.model.test.cases[case], self.model.structure
        load, columns = self.predicted[case], self.columns(case)
        for known in stated.loads:
            force = known.load
            if not isinstance(force, PadForce | PointForce):
                continue
            weight = hanging(force, stated, MASS)
            per_mass, of_force = structure.nominal_strain(structure.exactly_built(), (weight, force))
            yield _Cause(kind="load", text="", reading=load, columns=columns, more=SIZE * of_force[:, None])
            if is_along(force, weight):
                continue  # a load of another size
            yield _Cause(
                kind="mass",
                text="its loads are as stated, and a mass hangs on them that is not: ",
                reading=load,
                columns=columns,
                more=per_mass[:, None],
                size=lambda size: f"{size * MASS:.2g} kg",
            )

    def _of_weight(self, case: int) -> tuple[FloatArray, FloatArray]:
        """Return what own weight and inertia of a case strain (n_d,), and its columns (n_d, n)."""
        stated = self.model.test.cases[case]
        loads = tuple(known for known in stated.loads if isinstance(known.load, OF_MASS))
        none = np.zeros((self.used.shape[1], self.rows.shape[1]))
        if not loads:
            return np.zeros(len(none)), none
        reading, of_vehicle = self._bare((replace(stated, loads=loads),))
        none[:, : self.model.n_built] = of_vehicle[0]
        return reading[0], none

    def _bare(self, cases: tuple[LoadCase, ...]) -> tuple[FloatArray, FloatArray]:
        """Return readings (n, n_d) of other cases, and their columns (n, n_d, n_built), 0 of zeros."""
        model = ReadingsModel(self.model.structure, replace(self.model.test, cases=cases), self.model.prior)
        reading, jacobian = model.at_drawing()
        of_vehicle = scaled_columns(jacobian, model.std)[:, : model.n_built].toarray().reshape(*reading.shape, -1)
        of_vehicle[..., model.is_zero[: model.n_built]] = 0.0
        return reading, of_vehicle

    def _of_other_cases(self, case: int, wrong: set[int]) -> Iterator[_Cause]:
        names = [stated.name for stated in self.model.test.cases]
        for number in range(len(names)):
            same = np.array_equal(self.reading[case], self.reading[number], equal_nan=True)
            if number == case or (self._weighs(case) and self._weighs(number) and not same):
                continue  # another attitude, which has a name of its own
            kind, text = "mislabelled", f"its readings fit the loads of case '{names[number]}'"
            noise = np.hypot(self.model.test.reading_stds[case], self.model.test.reading_stds[number])
            difference = np.abs(self.reading[case] - self.reading[number])
            if np.nanmax(difference / noise) < 2.0 * OFF:
                kind, text = "duplicate", f"its readings repeat case '{names[number]}'"
            elif number in wrong:
                kind, text = "interchanged", f"its readings are interchanged with case '{names[number]}'"
            columns, more = self.columns(number), None
            drift = self.model.entries[DRIFT]
            columns[:, drift] = self.columns(case)[:, drift]
            if kind == "mislabelled":  # the loads were applied once more, with errors of their own
                entries = np.append(self.model.entries["load"], self.model.entries["pad"])
                more, columns[:, entries] = columns[:, entries].copy(), 0.0
            yield _Cause(kind=kind, text=text, reading=self.predicted[number], columns=columns, more=more)

    def _weighs(self, case: int) -> bool:
        """Return whether own weight is the only load of a case."""
        return all(isinstance(known.load, Weight) for known in self.model.test.cases[case].loads)

    def _of_attitudes(self, case: int, of_zeros: FloatArray) -> Iterator[_Cause]:
        stated = self.model.test.cases[case]
        if len(stated.loads) != 1 or not isinstance(weight := stated.loads[0].load, Weight):
            return
        angles = (weight.up_roll_angle + np.deg2rad([*TURNS])).tolist()
        turned = tuple(
            replace(stated, name=text, loads=(replace(stated.loads[0], load=replace(weight, up_roll_angle=up)),))
            for up, text in zip(angles, TURNS.values(), strict=True)
        )
        reading, of_vehicle = self._bare(turned)
        for k, attitude in enumerate(turned):
            columns = of_zeros.copy()
            columns[:, : self.model.n_built] += of_vehicle[k]
            yield _Cause(
                kind="attitude", text=f"the vehicle is {attitude.name}", reading=reading[k], columns=columns
            )

    def _by_a_factor(self, case: int, mean: FloatArray) -> tuple[str, float]:
        """Return by how much the loads differ at best, in words; own weight apart where it is not the only one."""
        (of_zeros, of_load), load = self._parts(case), self.predicted[case]
        gauges = np.flatnonzero(self.used[case])
        if not self._weighs(case):
            weight, of_weight = self._of_weight(case)
            of_zeros, of_load, load = of_zeros + of_weight, of_load - of_weight, load - weight
        residual = (self.reading[case] - (self.predicted[case] - load) - of_zeros @ mean)[gauges]
        load = (load + of_load @ mean)[gauges]
        factor = float(load @ residual) / max(float(load @ load), 1e-300)
        rest = float(np.linalg.norm(residual - factor * load) / max(float(np.linalg.norm(residual)), 1e-300))
        if rest > 0.5:
            return NO_CAUSE, float("nan")
        text = f"loads differ by {factor - 1.0:+.1%} from what is stated"
        units = [name for unit, name in FACTORS.items() if abs(factor - unit) < NEAR_UNIT * unit]
        if units:
            return f"{text}, nearly as if {units[0]}", factor
        forces = [cell_force(known.load) for known in self.model.test.cases[case].loads]
        if len(forces) == 1 and forces[0] > 0.0:
            more = (factor - 1.0) * forces[0]
            text += f", by {more:+.3g} N, the weight of {more / STANDARD_GRAVITY:+.2g} kg"
        return text, factor
