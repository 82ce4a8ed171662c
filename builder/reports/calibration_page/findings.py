"""What the report of a calibration is made from."""

from __future__ import annotations

from dataclasses import dataclass

from builder.calibration.estimate.case_faults import Fault
from builder.calibration.estimate.check_loads import CheckLoad, LeftOut
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.load_steps import SteppedCase
from builder.calibration.estimate.outside_terms import OutsideModel
from builder.calibration.estimate.regression import LoadEquation
from builder.calibration.plan.worth_of_test import WorthOfTest
from builder.reports.page.origin import Origin


@dataclass(frozen=True, kw_only=True)
class UsedCell:
    """A load cell as the file of the test states it.

    Attributes
    ----------
    name : of the load cell.
    serial_number, calibrated_on : empty where they are not stated.
    loads : number of loads that it read.
    """

    name: str
    serial_number: str
    calibrated_on: str
    loads: int


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibrationFindings:
    """A calibration, and what its report says of it.

    Attributes
    ----------
    title : of the page.
    estimate : from the readings.
    faults : gauges and load cases that were left out.
    outside : tests of what is taken for zero.
    left_out : each case predicted from the others.
    equations : regression load equations.
    checks : check loads.
    steps : cases with loading and unloading.
    worth : what the test is worth in flight.
    origin : files, version and date of the report.
    tested_on : date of the test, empty where it is not stated.
    cells : load cells.
    accepted : why the map was written although no known error explains the readings; empty otherwise.
    """

    title: str
    estimate: Estimate
    faults: tuple[Fault, ...]
    outside: OutsideModel
    left_out: tuple[LeftOut, ...]
    equations: tuple[LoadEquation, ...]
    checks: tuple[CheckLoad, ...]
    steps: tuple[SteppedCase, ...]
    worth: WorthOfTest
    origin: Origin
    tested_on: str = ""
    cells: tuple[UsedCell, ...] = ()
    accepted: str = ""
