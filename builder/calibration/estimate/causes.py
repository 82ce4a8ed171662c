"""What readings that do not fit may be of, scored against each other: vehicle, test, load or gauge.

A soft support, a joint, forces that are all turned, zeros that drift or noise larger than stated make several
gauges look at fault, and one gauge at fault makes the vehicle look different. So all causes compete: of the model
that is linear about a vector, each adds some covariance to the readings, and the one that makes them most probable
counts.
With the residual r of the model without errors, its covariance S and P = S^-1, columns C of terms set free add

    ln p(C) - ln p = (b' A^-1 b - ln det A) / 2,  b = C' P r,  A = 1 + C' P C;

a gauge or a case whose cause is not known adds scatter of its own to what the other readings predict of it. Wide
priors pay for their freedom, so that the simpler cause wins where both fit.

Source: Rasmussen & Williams, *Gaussian Processes for Machine Learning*, sections 5.2 and 5.4.2.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array

from builder.calibration.estimate.gaussian import GaussianModel
from builder.calibration.estimate.readings_model import Cause, ReadingsModel, Where, scaled_columns
from builder.calibration.ground_test.load_changes import change_by, hanging
from builder.structure.as_built.as_built_vehicle import slices
from builder.structure.as_built_kinds import KINDS
from builder.structure.loads.applied import PadForce, PointForce
from strainfmu.arrays import BoolArray, FloatArray, IntArray

LEAST = 12.0
"""Logarithm of how much more probable the readings must be: odds of 160,000 to 1, for one of about 150 causes."""

LEAST_OF_MASS = 5.0
"""The same for a mass that hangs on a load without being stated. Across a force it looks like a force that is
turned: 10 kg on 1500 N by 3.7 deg, with 1 deg stated. One sound test of 12 pads in 400 has a force turned so
far."""

LEAST_OF_SMALL = 4.0
"""The same for taper, second harmonic and the size of all pads: few tests are without them, and to estimate one
for nothing costs little. Pads that are all 30 % longer had 7.5 to 11 in six tests, sound tests had -3 to -1."""

SMALL = ("taper", "second harmonic", "pad size")

WALL = {
    "support": {"clamp_axial": 0.05, "clamp_transverse": 0.05},
    "taper": {"wall_taper": 0.03},
    "second harmonic": {"wall_second_cosine": 0.03, "wall_second_sine": 0.03},
    "modulus": {"region_modulus": 0.1},
}
"""Parameters that each cause of the wall sets free, with their standard deviations [m, m, 1, 1, 1, 1]."""

WIDE_JOINT = 0.05
"""Of the softness of a joint [m]."""

WIDE_TURN = float(np.deg2rad(10.0))
"""Of the direction that all forces have in common [rad]."""

WIDE_DRIFT, WIDE_HYSTERESIS = 5e-6, 0.05
"""Of the drift of each gauge [m/m], and of the hysteresis [1]; gauges differ by a fifth of that."""

WIDE_RIG, WIDE_SIZE = 10.0, 1.0
"""Of the mass that hangs on every pad [kg], and of the size that all pads have in common [1]."""

WIDE_CELL = (0.03, 0.02, 0.01)
"""Of gain, quadratic and cubic curve of a load cell [1]. A cell that is not straight has no certain gain."""

WIDE_LOAD = 0.3
"""Of the relative error of one load."""

WIDE_MASS = 10.0
"""Of a mass that hangs on a load without being stated [kg]."""

WIDE_GAUGE = 20.0
"""Of what is wrong with one gauge, over its standard deviation before the test."""

NOISES = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
"""Noise over what is stated. Beyond, the readings are of another test."""

SCATTERS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4)
"""Scatter of one gauge or case whose cause is not known, in standard deviations of its noise."""

NO_ENTRY = np.zeros(0, dtype=np.int64)

OF_GAUGE = ("gauge_gain", "orientation", "axial_shift", "circumferential_shift", "transverse_sensitivity")


def causes_of(model: ReadingsModel) -> list[Cause]:
    """Return every cause that sets entries of the vector free and does so by more than the model does already."""
    causes = [*_of_vehicle(model), *_of_test(model), *_of_loads(model), *_of_gauges(model)]
    return [fault for fault in causes if fault.together or np.any(fault.wide > model.std[fault.entries])]


def _of_vehicle(model: ReadingsModel) -> Iterator[Cause]:
    where, counts = slices(model.structure.counts), model.structure.counts
    for kind, wide_of in WALL.items():
        if kind != "modulus" or model.structure.has_moduli:
            entries = np.concatenate([np.arange(where[name].start, where[name].stop) for name in wide_of])
            wide = np.concatenate([np.full(counts.of(KINDS[name]), std) for name, std in wide_of.items()])
            yield Cause(where="vehicle", kind=kind, entries=entries, wide=wide)
    for number in range(counts.joint):
        entries = np.array([where["joint_softness"].start + number])
        yield Cause(where="vehicle", kind="joint", number=number, entries=entries, wide=np.array([WIDE_JOINT]))


def _of_test(model: ReadingsModel) -> Iterator[Cause]:
    of, n_d = model.entries, model.structure.n_gauges
    common = {
        "direction": (of["direction"], np.full(len(of["direction"]), WIDE_TURN)),
        "rig": (of["rig"], np.array([WIDE_RIG])),
        "pad size": (of["size"], np.array([WIDE_SIZE])),
        "drift": (of["drift"], np.full(n_d, WIDE_DRIFT)),
        "hysteresis": (
            np.append(of["hysteresis"], of["hysteresis of all"]),
            np.append(np.full(n_d, WIDE_HYSTERESIS / 5.0), WIDE_HYSTERESIS),
        ),
    }
    for kind, (entries, wide) in common.items():
        yield Cause(where="vehicle", kind=kind, entries=entries, wide=wide)
    for cell, (gain, _, *curve) in enumerate(of["cell"].T):
        if model.std[gain] > 0.0:
            entries = np.array([gain, *curve])
            yield Cause(where="vehicle", kind="load cell", number=cell, entries=entries, wide=np.array(WIDE_CELL))


def _of_loads(model: ReadingsModel) -> Iterator[Cause]:
    of_load, of_pad = model.entries["load"], model.entries["pad"]
    for number, (_, known) in enumerate(model.loads):
        if known.std > 0.0:
            entries = of_load[[number]]
            yield Cause(where="load", kind="load", number=number, entries=entries, wide=np.array([WIDE_LOAD]))
    for number, (case, known) in enumerate(model.loads):
        if isinstance(known.load, PadForce | PointForce):
            change = change_by(known.load, hanging(known.load, model.test.cases[case], WIDE_MASS))
            entries = np.array([of_load[number], *of_pad[number, -2:]])  # the tilts are the last two
            yield Cause(where="load", kind="mass", number=number, entries=entries, wide=change, together=True)


def _of_gauges(model: ReadingsModel) -> Iterator[Cause]:
    where = slices(model.structure.counts)
    for gauge in range(model.structure.n_gauges):
        entries = np.array([where[kind].start + gauge for kind in OF_GAUGE])
        yield Cause(
            where="gauge",
            kind="gauge",
            number=gauge,
            entries=entries,
            wide=WIDE_GAUGE * model.std[entries],
        )
        gain = entries[: OF_GAUGE.index("gauge_gain") + 1]
        yield Cause(where="gauge", kind="gain", number=gauge, entries=gain, wide=WIDE_GAUGE * model.std[gain])


class Evidence:
    """How probable the readings ``used`` (n_cases, n_d) and the steps of their cases are by each cause.

    All is linear about ``vector`` (n,).

    ``model_error`` is the part of the strain by which the linear model may err, as noise.
    """

    def __init__(
        self, model: ReadingsModel, used: BoolArray, vector: FloatArray, model_error: float = 0.0
    ) -> None:
        self.model, self.used, self.causes = model, used, causes_of(model)
        wide = model.std.copy()
        for cause in self.causes:
            wide[cause.entries] = np.maximum(wide[cause.entries], cause.wide)
        predicted, jacobian = model.with_std(wide).jacobian(vector)
        self._noise = np.hypot(model.test.reading_stds, model_error * predicted)[used]
        self._predicted = predicted[used]
        free = model.std > 0.0
        slope = model.slopes(used, jacobian, self._noise)
        misfit = model.misfit(used, vector, predicted, self._noise) + slope @ vector
        rows = scaled_columns(slope, model.std)[:, np.flatnonzero(free)]
        self._linear, self._slope = GaussianModel(rows, misfit, model.gauge_of[free]), slope.tocsc()

    def ranking(self) -> list[tuple[Cause, float]]:
        """Return every cause, the best first, with the logarithm of how much more probable it makes the readings
        than it must."""
        every = [*zip(self.causes, self._of_terms(self.causes), strict=True)]
        gains = (
            (cause, gain - least_of(cause)) for cause, gain in (*every, *self._of_scatter(), self._of_noise())
        )
        return sorted(gains, key=lambda pair: -pair[1])

    def best(self) -> Cause | None:
        """Return the cause that makes the readings most probable; None where none does so by enough."""
        cause, more = self.ranking()[0]
        return cause if more > 0.0 else None

    def sizes(self, cause: Cause) -> FloatArray:
        """Return what the readings say of the entries of ``cause``, (n_entries,), or of its one quantity, (1,)."""
        ((b, a, std),) = self._terms([cause])
        return np.asarray(std * np.linalg.solve(a, b))

    def part_of_gauge(self, cause: Cause) -> float:
        """Return what ``cause`` of a gauge changes of its readings, over the changes from case to case [1]."""
        rows = np.argwhere(self.used)[:, 1] == cause.number
        if len(cause.entries):
            change = (self._slope[:, cause.entries] @ self.sizes(cause))[: len(rows)][rows] * self._noise[rows]
        else:
            change = cause.factor * self._noise[rows]
        strain = float(np.std(self._predicted[rows]))
        return float(np.sqrt(np.mean(change**2))) / strain if strain > 0.0 else np.inf

    def _of_terms(self, causes: Sequence[Cause]) -> Iterator[float]:
        for cause, (b, a, _) in zip(causes, self._terms(causes), strict=True):
            size = np.linalg.solve(a, b)
            upwards = cause.kind == "mass" and size[0] <= 0.0  # no mass hangs so
            yield -np.inf if upwards else 0.5 * float(b @ size - np.linalg.slogdet(a)[1])

    def _terms(self, causes: Sequence[Cause]) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Return b and A of the module's formula, and the standard deviations that the columns are scaled by."""
        stds, parts, place, size = list[FloatArray](), list[slice](), list[IntArray](), list[FloatArray]()
        for cause in causes:
            start = parts[-1].stop if parts else 0
            if cause.together:
                std, scale, column = np.ones(1), cause.wide, np.full(len(cause.entries), start)
            else:
                std = np.sqrt(np.maximum(cause.wide**2 - self.model.std[cause.entries] ** 2, 0.0))
                scale, column = std, start + np.arange(len(std))
            stds.append(std)
            parts.append(slice(start, start + len(std)))
            place.append(np.stack([cause.entries, column]))
            size.append(scale)
        shape = len(self.model.std), parts[-1].stop
        columns = self._slope @ csr_array((np.concatenate(size), np.hstack(place)), shape=shape)
        terms = self._linear.terms(columns.tocsr(), parts)
        return [(b, np.eye(len(a)) + a, std) for (b, a), std in zip(terms, stds, strict=True)]

    def _of_noise(self) -> tuple[Cause, float]:
        before = self.model.noise_factor  # noise that was taken for larger before another cause was found
        factors = [level / before for level in (1.0, *NOISES) if not np.isclose(level, before)]
        factor, density = _highest(factors, self._linear.density)
        cause = Cause(where="noise", kind="noise", entries=NO_ENTRY, wide=np.zeros(0), factor=factor)
        return cause, density - self._linear.density()

    def _of_scatter(self) -> Iterator[tuple[Cause, float]]:
        """Yield gauges and cases whose readings are not what the others predict of them, of no known cause."""
        places = np.argwhere(self.used)
        kinds: tuple[tuple[Where, int], ...] = (("gauge", 1), ("case", 0))
        for kind, axis in kinds:
            for number in np.unique(places[:, axis]).tolist():
                rows = np.flatnonzero(places[:, axis] == number)
                scatter, gain = _highest(
                    SCATTERS, partial(self._gain_of_scatter, rows, self._linear.precision_of(rows))
                )
                cause = Cause(
                    where=kind, kind=kind, number=number, entries=NO_ENTRY, wide=np.zeros(0), factor=scatter
                )
                yield cause, gain

    def _gain_of_scatter(self, rows: IntArray, precision: FloatArray, size: float) -> float:
        """Return how much more probable the readings ``rows`` are that scatter by ``size`` more."""
        root = np.linalg.cholesky(np.eye(len(rows)) + size**2 * precision)
        half = size * solve_triangular(root, self._linear.weighted[rows], lower=True)
        return 0.5 * float(half @ half) - float(np.sum(np.log(np.diag(root))))


def _highest(values: Sequence[float], gain_of: Callable[[float], float]) -> tuple[float, float]:
    """Return the first of ``values`` from which the gain falls, and the gain there; it has one maximum."""
    best, gain = values[0], gain_of(values[0])
    for value in values[1:]:
        more = gain_of(value)
        if more < gain:
            break
        best, gain = value, more
    return best, gain


def least_of(cause: Cause) -> float:
    """Return the logarithm of how much more probable ``cause`` must make the readings."""
    if cause.kind in SMALL:
        return LEAST_OF_SMALL
    return LEAST_OF_MASS if cause.kind == "mass" else LEAST


def freed(model: ReadingsModel, cause: Cause) -> ReadingsModel:
    """Return ``model`` with what ``cause`` of the vehicle, the test or the noise sets free; it is noted there."""
    if cause.where == "noise":
        return model.of_causes(cause).with_readings(model.test.readings, cause.factor * model.test.reading_stds)
    return model.with_wider_std(cause.entries, cause.wide).of_causes(cause)
