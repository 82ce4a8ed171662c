"""The file of a trade study (``study.toml``): a vehicle, entries that are set, entries that are swept, the trial.

.. code-block:: toml

    vehicle = "my_vehicle.toml"            # next to this file
    [set]
    "map.estimator" = "linear"
    [sweep]                                # all combinations
    "structure.wall_thickness_mm" = [3.0, 4.0, 5.0]
    "map.modes" = [3, 5]
    [trial]
    conditions = 200
    draws = 5
    seed = 1

Names of entries are as in messages on the vehicle file: ``section.entry``, items of lists by their number.
"""

from __future__ import annotations

from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from builder.pipeline.stages import check_before_long_work
from builder.trial.cases import Plan
from builder.truth.independent_model import refuse_without_independent_model
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.toml.reading import read_sections
from builder.vehicle.toml.sections import Section
from strainfmu.errors import FaultsError, InputError

MOST_DESIGNS = 10_000
"""Designs of one study at most."""

Single = bool | int | float | str
Value = Single | list[Single]


class Trial(Section):
    """On what each design is tried.

    ``conditions`` flight conditions of the independent model inside the envelope, at each ``draws`` vehicles with
    installation errors and noise of their own.
    """

    conditions: int = Field(default=200, ge=1, le=100_000)
    draws: int = Field(default=5, ge=1, le=10_000)
    seed: int = Field(default=1, ge=0, le=2**31 - 1)

    @property
    def plan(self) -> Plan:
        """The plan of a trial by it."""
        return Plan(conditions=self.conditions, vehicles=self.draws, seed=self.seed)


class StudyFile(Section):
    """The whole file; ``set`` and ``sweep`` are by the names of entries of the vehicle file."""

    vehicle: str
    set: dict[str, Value] = Field(default_factory=dict)
    sweep: dict[str, Annotated[list[Value], Field(min_length=1)]] = Field(min_length=1)
    trial: Trial = Trial()


class Design(Section):
    """One design: its number from 1 on, and the ``values`` of the entries that are swept."""

    number: int
    values: dict[str, Value]

    @property
    def name(self) -> str:
        """The folder of the design."""
        return f"design_{self.number:04d}"

    @property
    def text(self) -> str:
        """The values, as a user wrote them."""
        return ", ".join(f"{name} = {value}" for name, value in self.values.items())


def load_study(path: Path) -> StudyFile:
    """Read and check a file of a study.

    Raises
    ------
    InputError
        The file is missing, no TOML, or wrong: one line for each entry.
    """
    found = read_sections(path, StudyFile, "file of a trade study", _faults)
    vehicle = path.parent / found.vehicle
    if not vehicle.is_file():
        raise InputError(f"{path}: vehicle: expected a vehicle file next to it, got '{found.vehicle}'")
    return found


def _faults(study: StudyFile) -> list[str]:
    both = sorted(study.set.keys() & study.sweep.keys())
    faults = [f"sweep.{name}: expected in one of [set] and [sweep], got both" for name in both]
    for name, values in study.sweep.items():
        if len({repr(one) for one in values}) < len(values):
            faults.append(f"sweep.{name}: expected each value once, got {values}")
    count = prod(len(values) for values in study.sweep.values())
    if count > MOST_DESIGNS:
        faults.append(f"sweep: expected at most {MOST_DESIGNS} combinations, got {count}")
    return faults


def designs_of(study: StudyFile) -> list[Design]:
    """Return all combinations of the values, the last entry changing first."""
    combinations = product(*study.sweep.values())
    return [
        Design(number=number, values=dict(zip(study.sweep, values, strict=True)))
        for number, values in enumerate(combinations, start=1)
    ]


def vehicle_of(path: Path, study: StudyFile, design: Design) -> Vehicle:
    """Return the vehicle of a design, which has an independent model.

    Raises
    ------
    InputError
        An entry is unknown, or a value outside its limits: the lines name study and design.
    """
    changes: dict[str, Any] = {**study.set, **design.values}
    try:
        vehicle = load_vehicle(path.parent / study.vehicle, changes)
        refuse_without_independent_model(vehicle)
        check_before_long_work(vehicle, len(vehicle.flight_conditions()))
        return vehicle
    except InputError as error:
        lines = [f"{path}: design {design.number} ({design.text}): {line}" for line in error.lines]
        raise FaultsError("\n".join(lines)) from error
