"""A pipeline of stages from file to file in one folder: a file that is up to date is not made again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import AnyStructure
from builder.reporting import Reporter
from builder.vehicle.file import Vehicle
from builder.workspace import Workspace


class Pipeline:
    """The files made so far, and the means to make the next."""

    def __init__(self, vehicle: Vehicle, workspace: Workspace, reporter: Reporter) -> None:
        self.vehicle, self.workspace, self.reporter = vehicle, workspace, reporter
        self.files: dict[str, str] = {}
        self.reused: list[str] = []
        self.map_parts: tuple[Snapshots, AnyStructure] | None = None

    def make(self, name: str, holds: str, inputs: dict[str, Any], write: Callable[[Path], object]) -> None:
        """Make the file ``name`` with ``write(path)``, or reuse it and report that."""
        if self.workspace.ensure(name, inputs, write):
            self.reused.append(name)
            self.reporter.note(f"{name}: up to date, reused")
        self.files[name] = holds

    def made_from(self, *names: str) -> list[str]:
        """Return what each of ``names`` was made from, to be an input of the next file."""
        return [self.workspace.made_from(name) for name in names]
