"""The file of a trial: what is tried, a row for each case; rows for one vehicle, with classes by what its file
states.

.. code-block:: toml

    [trial]                                # optional: effort and estimators
    conditions = 100
    estimators = ["linear", "nonlinear"]
    [[group]]                              # what the cases of a group have in common
    class = "beyond"
    cases = [
        { error = "bias of one gauge", size = "+50 um/m", fault = { of = 1, add_um_per_m = 50.0 } },
    ]

The sections of a case stand with what they do: :class:`~builder.trial.conditions.Where`,
:class:`~builder.trial.faults.Fault`, :class:`~builder.trial.faults.Lost`, :class:`~builder.trial.faults.Inertia`,
:class:`~builder.trial.flows.Flow`, :class:`~builder.trial.faults.Heating` and
:class:`~builder.trial.conditions.Motion`; others are here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, PositiveFloat, PrivateAttr, model_validator

from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built_kinds import IN_NOISE, KINDS
from builder.trial.conditions import FEWER_BEYOND, Motion, Quantity, Where, edges_of, is_inside
from builder.trial.faults import Fault, Heating, Inertia, Lost
from builder.trial.flows import Flow
from builder.vehicle.file import Vehicle
from builder.vehicle.model_form import model_form
from builder.vehicle.toml.reading import read_sections
from builder.vehicle.toml.toml_sections import Section
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import TEMPERATURE


class GroundTest(Section):
    """The test of one vehicle, and what goes wrong with wall, rig and readings; other errors of it are
    :class:`Built`.

    Attributes
    ----------
    pads : of the test, in addition to its attitudes.
    reading_std_um_per_m, noise_times : stated standard deviation of a reading; the true one over it.
    said : part of a line that names the error; empty where nothing is to be said.
    wrong, and_another : an error of a load case or gauge, which is to be named as such, of
        :data:`builder.calibration.score.ground_rows.SPOILS`; with one more of any kind.
    taper_percent : the wall of each piece is thicker at its aft end, and thinner at its fore end.
    second_harmonic_percent : standard deviation of cosine and sine of twice the roll angle in its thickness.
    tilt_deg, pads_percent : all pads push towards the tail; all are longer than stated.
    rig_kg : mass that hangs on every pad without being stated.
    zero_um_per_m : zeros of the recorder: half this size in common, and a heavy-tailed scatter of this size
        (Student's t of three degrees of freedom). 0 for zeros by [calibration].
    drift_um_per_m : standard deviation of what zeros drift by until the last case.
    hysteresis_percent : part of a case's strain that the next one still reads.
    load_percent, load_cell_percent : stated errors of each load, and of all loads of a load cell together.
    load_cells : that the loads stand on in turn.
    """

    pads: int = Field(default=12, ge=1)
    reading_std_um_per_m: PositiveFloat = 0.05
    noise_times: float = Field(default=1.0, ge=0.0)
    said: str = ""
    wrong: str | None = None
    and_another: bool = False
    taper_percent: float = 0.0
    second_harmonic_percent: float = Field(default=0.0, ge=0.0)
    tilt_deg: float = 0.0
    pads_percent: float = Field(default=0.0, gt=-100.0)
    rig_kg: float = 0.0
    zero_um_per_m: float = Field(default=0.0, ge=0.0)
    drift_um_per_m: float = Field(default=0.0, ge=0.0)
    hysteresis_percent: float = 0.0
    load_percent: float = Field(default=0.5, ge=0.0)
    load_cell_percent: float = Field(default=0.5, ge=0.0)
    load_cells: int = Field(default=1, ge=1)


class GroundTests(Section):
    """What all tests have in common.

    Attributes
    ----------
    walls : "smooth" vary smoothly along the body; "stated" by the regions and sizes of [calibration].
    proposed : the test that `strainfmu loadtest` proposes; otherwise pads at even distances.
    draws : of gauge noise for each flight.
    """

    walls: Literal["smooth", "stated"] = "smooth"
    proposed: bool = True
    draws: int = Field(default=8, ge=1)


FILES = Path(__file__).with_name("files")
"""Trials that are shipped, by name."""

ALL_STATED = "all_stated"
"""Error that stands for all that sigma includes, drawn together: the first row of a table."""

CaseClass = Literal["drawn", "alone", "beyond", "unobservable", "stated"]
"""``drawn``, all errors that sigma includes together at their stated sizes; ``alone``, some of them of at most
twice their sizes; ``beyond`` the envelope, the stated sizes, or what any sigma includes; ``stated``: ``alone`` up
to twice what the vehicle file states, ``beyond`` above. :data:`builder.trial.score.LIMITS` has the aims of each.

``unobservable``: the strain is the strain of another flight inside the envelope: no function of strain and air
data separates the two, only another sensor does. On the shipped vehicle the strain of these differs from the
nearest flight's inside by a chi-square of 1 to 3, median over flights, with all hardware errors in the covariance;
the strain of cases ``beyond`` with many undetected samples by 60 to 870."""

LEAST_STRAIN_UM_PER_M = 1.0
"""Strain [um/m] of a slender vehicle without incidence: 0.76 at most on the shipped one at 20 km."""


class Built(Section):
    """The vehicle.

    Attributes
    ----------
    stated : all errors are drawn at so many times their stated sizes.
    set : single errors by kind, in the unit of the entry that states their size.
    signs : whether each of these gets a sign of its own, drawn.
    middle : errors of the gauges of the middle third alone, in the same units.
    """

    stated: float = Field(default=0.0, ge=0.0)
    set: dict[str, float] = Field(default_factory=dict)
    signs: bool = False
    middle: dict[str, float] = Field(default_factory=dict)

    def with_errors(self, vehicle: AsBuilt, random: np.random.Generator) -> AsBuilt:
        """Return ``vehicle``, or several at once, with the single errors."""
        for name, value in self.set.items():
            size = getattr(vehicle, name).shape
            sign = random.choice([-1.0, 1.0], size=size) if self.signs else np.ones(size)
            vehicle = vehicle.changed(**{name: KINDS[name].scale * value * sign})
        return vehicle


class Air(Section):
    """What the estimator is given besides strain: exact q_inf, M and p_inf, but for each entry.

    Attributes
    ----------
    navigation : whether M and p_inf are given.
    drawn : whether M and p_inf have errors of the stated sizes.
    source : q_inf is computed from M and p_inf, or M and altitude, which have errors of the stated sizes.
    mach_off, altitude_off : errors of M [1] and of the altitude [m] in all inputs, where q_inf is computed.
    day : the day's pressure over the pressure of the standard atmosphere, where q_inf is computed [1].
    angles : whether both angles are measured, with errors of the default standard deviation.
    inertial : whether an inertial unit measures the specific force, with errors of the stated sizes.
    vibration_um_per_m : standard deviation of the vibration that is stated with it; 0 for none.
    parameters_percent : standard deviation of flow parameters that are given, of their ranges [%]; 0 for none.
    parameters_off : by how many of these each parameter is off, in addition to an error that is drawn.
    temperature : whether the temperature sensors of the map give readings, of a wall that warms.
    """

    navigation: bool = True
    drawn: bool = False
    source: Literal["pressure", "altitude"] | None = None
    mach_off: float = 0.0
    altitude_off: float = 0.0
    day: float = 1.0
    angles: bool = False
    inertial: bool = False
    vibration_um_per_m: float = 0.0
    parameters_percent: float = 0.0
    parameters_off: float = 0.0
    temperature: bool = True


class OverTime(Section):
    """A filter over time: each condition is flown for ``steps`` samples with gauge noise of their own, the last
    counts.

    Attributes
    ----------
    steps, time_step, time_constant : number, [s], [s].
    zero, common_zero : standard deviations of the zeros, of each gauge and in common, over the gauges' noise. The
        errors are drawn once for each vehicle.
    """

    steps: int = Field(default=20, ge=1)
    time_step: float = 0.1
    time_constant: float = 10.0
    zero: float = 0.0
    common_zero: float = 0.0


AIMS = (
    *("flagged_percent", "alarm_percent", "undetected_percent", "no_estimate_percent"),
    *("right_ok_percent", "right_flagged_percent", "wrong_flagged_percent"),
    *("covered_percent", "covered_1_percent", "worst_set_percent"),
    *("rms", "rms_z", "rms_of_range", "bias", "sigma", "over_bound", "over_single", "over_exact"),
)
"""Columns of the table, of all loads together or of each load, that a case may aim at."""


class Case(Section):
    """One row: what is tried.

    Attributes
    ----------
    error, size : names.
    what : what is done, and why the case is of its class.
    when : properties of the vehicle that the case needs, of :data:`PROPERTIES`; ``not`` before one negates it.
    each_stated : stands for a row for each stated error alone, of so many times its size.
    all_stated : stands for all errors that sigma includes, drawn together at their stated sizes.
    map_errors : whether errors of pressure and numerics that the map includes are drawn, at their sizes there.
    draws : vehicles of the trial, times this.
    tenths_by : quantities of the flight; the samples are scored in tenths of the flights by each of them, too.
    at_least, at_most : what is aimed at in addition to the limits of the class, by :data:`AIMS`.
    """

    model_config = ConfigDict(populate_by_name=True)

    error: str
    size: str = ""
    group: CaseClass = Field(validation_alias="class")
    what: str = ""
    when: list[str] = Field(default_factory=list)
    each_stated: float = 0.0
    all_stated: bool = False
    map_errors: bool = False
    draws: float = Field(default=1.0, gt=0.0)
    where: Where = Where()
    as_built: Built = Field(default=Built(), validation_alias="built")
    fault: Fault | None = None
    inertia: Inertia | None = None
    air: Air = Air()
    flow: Flow | None = None
    heating: Heating | None = None
    friction: float = 0.0
    lost: Lost | None = None
    ground: GroundTest | None = None
    over_time: OverTime | None = None
    motion: Motion | None = None
    tenths_by: list[Quantity] = Field(default_factory=list)
    at_least: dict[str, float] = Field(default_factory=dict)
    at_most: dict[str, float] = Field(default_factory=dict)

    @property
    def name(self) -> str:
        """Error and size, which the draws of the case follow from."""
        return f"{self.error} {self.size}"


class Group(Section):
    """Cases, and entries that they have in common unless they say otherwise."""

    cases: list[Case] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _common_entries(cls, entries: Any) -> Any:
        if not isinstance(entries, dict) or not isinstance(entries.get("cases"), list):
            return entries
        common = {name: value for name, value in entries.items() if name != "cases"}
        cases = [{**common, **case} if isinstance(case, dict) else case for case in entries["cases"]]
        return {"cases": cases}


class Plan(Section):
    """How a trial is flown.

    Attributes
    ----------
    conditions : flight conditions of each case.
    vehicles : vehicles at every condition, each with errors and noise of its own; draws of a case in time.
    seed : of all draws.
    estimators : by name, see :mod:`builder.trial.estimators`.
    training : of estimators of several kinds: flights for each regression, a third as many for its bands. Their
        maps are built for the errors of each case.
    """

    conditions: int = Field(default=200, ge=1, le=1_000_000)
    vehicles: int = Field(default=20, ge=1, le=100_000)
    seed: int = Field(default=1, ge=0, le=2**31 - 1)
    estimators: list[str] = Field(default=["map"], min_length=1)
    training: int | None = Field(default=None, ge=1200, le=10_000_000)


class LoopFault(Section):
    """A fault of a gauge in a closed loop: its name, kind, and value [um/m, um/m per s]."""

    error: str
    kind: Literal["dropout", "bias", "drift", "stuck", "frozen"]
    value: float = 0.0


class ClosedLoop(Section):
    """A scenario of ``strainfmu fly``, flown with ``seeds`` of noise, then with each fault of ``every`` so many-th
    gauge from ``fails_at`` on, over the time of the scenario."""

    seeds: int = Field(default=5, ge=1)
    every: int = Field(default=3, ge=1)
    fails_at: float = Field(default=0.5, ge=0.0, le=1.0)
    fault: list[LoopFault] = Field(min_length=1)


class TrialFile(Section):
    """The whole file: cases, of ground tests or of flights alone, or a closed loop."""

    trial: Plan = Plan()
    group: list[Group] = Field(default_factory=list)
    closed_loop: ClosedLoop | None = None
    ground: GroundTests | None = None
    _path: Path = PrivateAttr(default=Path("trial.toml"))

    @property
    def path(self) -> Path:
        """Where the file is."""
        return self._path

    @property
    def cases(self) -> list[Case]:
        """All of them, for any vehicle."""
        return [case for group in self.group for case in group.cases]

    def changed(self, changes: Mapping[str, Any]) -> TrialFile:
        """Return the file with other entries of its section [trial], by name."""
        return self.model_copy(update={"trial": self.trial.model_copy(update=changes)})


PROPERTIES: dict[str, Callable[[Vehicle], bool]] = {
    "revolution": lambda vehicle: vehicle.is_axisymmetric,
    "edges": lambda vehicle: not vehicle.is_axisymmetric and bool(edges_of(vehicle)),
    "per pressure": lambda vehicle: vehicle.map.follows_pressure,
    "mass": lambda vehicle: vehicle.mass is not None,
    TEMPERATURE: lambda vehicle: vehicle.temperature is not None,
    "density": lambda vehicle: vehicle.material.density_kg_per_m3 is not None,
    "held": lambda vehicle: vehicle.is_axisymmetric and vehicle.structure.support != "free_flight",
    "sensors": lambda vehicle: vehicle.sensors is not None,
    "parameters": lambda vehicle: bool(vehicle.conditions.parameters),
    "faint strain": lambda vehicle: vehicle.noise.apparent_strain_um_per_m >= LEAST_STRAIN_UM_PER_M,
    "own newtonian": lambda vehicle: not vehicle.is_axisymmetric and vehicle.aerodynamics.engine == "newtonian",
}
"""Of a vehicle and its map, by name. "faint strain": nearly none is a flight without incidence, where as much
apparent strain is expected."""


def load_trial(name: str | Path) -> TrialFile:
    """Read and check a file, by its path or by the name of a shipped one.

    Raises
    ------
    InputError
        The file is missing, no TOML, or wrong: one line for each entry.
    """
    path, shipped = Path(name), {file.stem: file for file in sorted(FILES.glob("*.toml"))}
    if not path.is_file() and not path.suffix:
        if path.name not in shipped:
            raise InputError(
                f"{name}: expected the path of a file, or a trial that is shipped: {', '.join(shipped)}"
            )
        path = shipped[path.name]
    file = read_sections(path, TrialFile, "file of a trial", _faults)
    file._path = path
    return file


def _faults(file: TrialFile) -> list[str]:
    cases, known = file.cases, ", ".join(PROPERTIES)
    faults = ["group: expected cases, or a section closed_loop"] * (bool(cases) == bool(file.closed_loop))
    faults += [
        f"group: '{case.name}': expected properties of the vehicle, {known}, got '{name}'"
        for case in cases
        for name in (entry.removeprefix("not ") for entry in case.when)
        if name not in PROPERTIES
    ]
    faults += [
        f"group: '{case.name}': expected aims of columns, {', '.join(AIMS)}, got '{name}'"
        for case in cases
        for name in (*case.at_least, *case.at_most)
        if name not in AIMS
    ]
    kinds = ", ".join(kind.name for kind in IN_NOISE)
    for case in cases:
        for name, value in (*case.as_built.set.items(), *case.as_built.middle.items()):
            where = f"group: '{case.name}'"
            if name not in KINDS or (file.ground is None and "noise" not in KINDS[name].sections):
                faults.append(f"{where}: expected kinds of error, {kinds}, got '{name}'")
            elif KINDS[name].unit == "%" and value <= -100.0:
                faults.append(f"{where}: {name}: expected more than -100 %, got {value:g}")
    return faults


def cases_for(vehicle: Vehicle, file: TrialFile, only: Sequence[str] = ()) -> list[Case]:
    """Return the rows of a file for ``vehicle``, with their classes; of ``only`` these errors, all by default.

    Raises
    ------
    InputError
        Two rows have one name, or no row has one of the names ``only``.
    """
    has = {name: test(vehicle) for name, test in PROPERTIES.items()}
    has |= {f"not {name}": not value for name, value in has.items()}
    listed = [case for case in file.cases if all(has[name] for name in case.when)]
    rows = [row for case in listed for row in _rows(case, vehicle)]
    names = [case.name for case in rows]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"{file.path}: cases: expected each error and size once, got '{twice[0]}' twice")
    errors = dict.fromkeys(case.error for case in rows)
    if unknown := [name for name in only if name not in errors]:
        raise InputError(f"--only: expected errors of {', '.join(errors)}, got '{unknown[0]}'")
    return [case for case in rows if not only or case.error in only]


def _rows(case: Case, vehicle: Vehicle) -> list[Case]:
    """Return the case of ``vehicle``, or a case for each stated error."""
    if case.each_stated:
        return _of_stated(case, vehicle)
    if case.all_stated:
        return [_all_stated(case, vehicle)]
    changes: dict[str, Any] = {"group": _class_of(case, vehicle)}
    if not vehicle.is_axisymmetric and case.where.is_beyond:
        changes["draws"] = FEWER_BEYOND * case.draws
    return [case.model_copy(update=changes)]


def _of_stated(case: Case, vehicle: Vehicle) -> list[Case]:
    rows = []
    for kind in IN_NOISE:
        size = case.each_stated * float(getattr(vehicle.noise, kind.entry))
        if size == 0.0:
            continue
        unit = f"{kind.unit} of {kind.relative_to}" if kind.relative_to else kind.unit
        whose = "the sign drawn" if kind.is_one_in_flight else "each with its own sign"
        changes = {
            "error": kind.error,
            "size": f"+-{size:g} {unit}",
            "what": f"{case.what} {kind.entry}, {whose}; all else exact.",
            "as_built": Built(set={kind.name: size}, signs=True),
            "each_stated": 0.0,
        }
        rows.append(case.model_copy(update=changes))
    return rows


def _all_stated(case: Case, vehicle: Vehicle) -> Case:
    """Return ``case`` with all errors that sigma includes: hardware, air data, inertia and flow models."""
    changes: dict[str, Any] = {"as_built": Built(stated=1.0), "air": Air(drawn=True), "all_stated": False}
    names, mass = ["installation errors", "air data"], vehicle.mass
    if mass is not None:
        across, bending = mass.lateral_g, sqrt(2.0) * mass.vibration_um_per_m  # the amplitude
        changes["inertia"] = Inertia(
            load_factor=across, drawn=True, extra_kg=mass.unlisted_kg, bending_um_per_m=bending
        )
        names.append(f"{across:g} g along both axes, vibration")
    if vehicle.map.estimator == "nonlinear":
        changes |= {"map_errors": True, "as_built": Built(stated=1.0, set={"internal_pressure": 0.0})}
        names.append("errors of the pressure on the surface, internal pressure and numerics by the map's list")
    elif (size := _of_flow_models(vehicle)) > 0.0:
        changes["flow"] = Flow(engine="newtonian", drawn=size)
        names.append(f"{size:g} times the difference to another flow model")
    return case.model_copy(update={**changes, "what": f"{case.what} {', '.join(names)}.".lstrip()})


def _of_flow_models(vehicle: Vehicle) -> float:
    """Return the stated size of the difference between two flow models, over the difference [1]."""
    form = model_form(vehicle.map, vehicle.noise)
    if vehicle.aerodynamics.engine == "newtonian":  # the leeward side alone is open, of a shape with another one
        return 0.0 if vehicle.is_axisymmetric else form.of_leeward
    return 0.0 if vehicle.conditions.parameters else form.of_newtonian


def _class_of(case: Case, vehicle: Vehicle) -> CaseClass:
    """Return the class, by what the vehicle file states where that decides."""
    if case.group in ("drawn", "alone") and not is_inside(case.where, vehicle):
        return "beyond"
    if case.group != "stated":
        return case.group
    noise, mass = vehicle.noise, vehicle.mass
    sizes = [(value, float(getattr(noise, KINDS[name].entry))) for name, value in case.as_built.set.items()]
    if (inertia := case.inertia) is not None:
        across = 0.0 if mass is None else mass.lateral_g
        sizes += [
            (0.0 if case.air.inertial else inertia.load_factor, across),
            (inertia.extra_kg, 0.0 if mass is None else mass.unlisted_kg),
            (inertia.bending_um_per_m, 0.0 if mass is None else mass.vibration_um_per_m),
        ]
    return "alone" if all(abs(value) <= 2.0 * stated + 1e-9 for value, stated in sizes) else "beyond"
