"""A ground test in memory: load cases, how exactly their loads are known, and what the gauges read."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from builder.structure.loads.applied import Load
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError

REPLACED = "replaced"
"""What happens to a gauge after a test, if not that it is balanced again: it has other errors."""


@dataclass(frozen=True, kw_only=True)
class KnownLoad:
    """One load of a case and how exactly it is known.

    Attributes
    ----------
    load : as stated.
    std : relative error of its size, on its own [1].
    on_load_cell : whether the errors of its load cell touch it, :attr:`LoadErrors.common` and ``cell_offset``.
    load_cell : name of that; loads of one load cell have its errors in common.
    """

    load: Load
    std: float = 0.0
    on_load_cell: bool = True
    load_cell: str = "1"


@dataclass(frozen=True, kw_only=True)
class LoadErrors:
    """Standard deviations of the loads of a ground test.

    Attributes
    ----------
    load : relative error of each load, where it states none of its own [1].
    common : relative error of all loads of a load cell together [1].
    cell_offset : error of all loads of a load cell, whatever their size [N].
    cell_curve : nonlinearity of a load cell over its full scale [1].
    rig_mass : what hangs on every pad and point and no load cell reads [kg].
    drift : of each gauge from the first case to the last [m/m].
    pad_position : of each pad and point along the body [m].
    pad_roll : of each pad and point round it [rad].
    pad_shape : relative error of each pad's length [1].
    tilt : of each force about both axes across it [rad]; a pad that presses along the normal has none.
    mass : relative error of the vehicle's own weight and inertia [1]; None for the section [calibration]'s.
    """

    load: float = 0.005
    common: float = 0.005
    cell_offset: float = 0.0
    cell_curve: float = 0.0005
    rig_mass: float = 0.0
    drift: float = 0.1e-6
    pad_position: float = 0.002
    pad_roll: float = float(np.deg2rad(0.3))
    pad_shape: float = 0.1
    tilt: float = float(np.deg2rad(1.0))
    mass: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadStep:
    """A reading on the way to the loads of a case, or back.

    Attributes
    ----------
    part : of the loads that a load cell reads [1].
    unloading : whether it was read after the whole load.
    reading, reading_std : (n_d,) as of a case [m/m].
    """

    part: float
    unloading: bool
    reading: FloatArray
    reading_std: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadCase:
    """One load case.

    Attributes
    ----------
    name : of the case.
    loads : all that act.
    reading : (n_d,) what the gauges read, zeros included [m/m]; NaN where there is none.
    reading_std : (n_d,) standard deviation of it, as of a mean over a window [m/m].
    group : cases of one group share the recorder's zeros.
    check : whether the case is predicted and not fitted.
    steps : readings on the way to its loads and back, in the order of time.
    """

    name: str
    loads: tuple[KnownLoad, ...]
    reading: FloatArray
    reading_std: FloatArray
    group: str = "1"
    check: bool = False
    steps: tuple[LoadStep, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadTest:
    """A ground test.

    Attributes
    ----------
    gauge_names : n_d names, the order of the readings.
    cases : in the order of the file.
    errors : of what is stated of the loads.
    left_out : a line for each channel whose readings were left out, as it stands still in its recording.
    full_scale : of load cells, where it is stated [N].
    changed : gauges that changed after the test, :data:`REPLACED` or balanced again.

    Raises
    ------
    InputError
        There is no case, a name is there twice, or shapes differ.
    """

    gauge_names: tuple[str, ...]
    cases: tuple[LoadCase, ...]
    errors: LoadErrors = field(default_factory=LoadErrors)
    left_out: tuple[str, ...] = ()
    full_scale: Mapping[str, float] = field(default_factory=dict)
    changed: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.cases:
            raise InputError("load test: expected at least one case")
        shape, names = (len(self.gauge_names),), set[str]()
        for case in self.cases:
            if case.name in names:
                raise InputError(f"load test: expected one case '{case.name}', got two")
            names.add(case.name)
            if np.shape(case.reading) != shape or np.shape(case.reading_std) != shape:
                got = f"{np.shape(case.reading)} and {np.shape(case.reading_std)}"
                raise InputError(f"load test: case '{case.name}': expected readings {shape}, got {got}")

    @property
    def readings(self) -> FloatArray:
        """(n_cases, n_d) [m/m]."""
        return np.array([case.reading for case in self.cases])

    @property
    def fitted(self) -> BoolArray:
        """(n_cases,) whether a case is fitted; check loads are predicted alone."""
        return np.array([not case.check for case in self.cases])

    @property
    def reading_stds(self) -> FloatArray:
        """(n_cases, n_d) [m/m]."""
        return np.array([case.reading_std for case in self.cases])
