"""A pipeline of stages from file to file in one folder: a file that is up to date is not made again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from builder.campaign.snapshots import Snapshots
from builder.inverse.problem import AnyStructure
from builder.inverse.solution import Problem
from builder.reporting import Reporter
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import Vehicle
from builder.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class FilesGiven:
    """What the user says of the files on the way.

    Attributes
    ----------
    snapshots, structure : files to use, from anywhere; None for the files of the folder.
    rebuild : make the files of the folder by the vehicle file, whatever options those there were made with.
    """

    snapshots: str | Path | None = None
    structure: str | Path | None = None
    rebuild: bool = False

    def as_text(self) -> dict[str, str]:
        """Return the files to use, by the option that gives them."""
        named = {"--snapshots": self.snapshots, "--structure": self.structure}
        return {option: str(path) for option, path in named.items() if path is not None}


class Pipeline:
    """The files made so far, and the means to make the next.

    ``elsewhere`` holds files that are used and were not made here, by name; ``flown`` is the vehicle with the
    engine and the conditions of such snapshots.
    """

    def __init__(
        self, vehicle: Vehicle, workspace: Workspace, reporter: Reporter, files_given: FilesGiven | None = None
    ) -> None:
        self.vehicle, self.workspace, self.reporter = vehicle, workspace, reporter
        self.files_given = files_given or FilesGiven()
        self.elsewhere: dict[str, Path] = {}
        self.flown: Vehicle | None = None
        self.files: dict[str, str] = {}
        self.reused: list[str] = []
        self.map_parts: tuple[Snapshots, AnyStructure] | None = None
        self.problem: Problem | None = None
        self.true_structure: TrueStructure | None = None

    def path(self, name: str) -> Path:
        """Return where the file ``name`` is: the one used, or the folder's."""
        return self.elsewhere.get(name, self.workspace.path(name))

    def use(self, name: str, path: Path, made_from: str) -> None:
        """Take ``path`` as the file ``name``; ``made_from`` identifies its content."""
        self.elsewhere[name] = path
        self.workspace.use(name, made_from)

    def take(self, name: str, holds: str) -> bool:
        """Return whether the file ``name`` is one that was not made here, and list it if so."""
        if name not in self.elsewhere:
            return False
        self.reused.append(name)
        self.files[name] = holds
        return True

    def make(
        self,
        name: str,
        holds: str,
        inputs: dict[str, Any],
        write: Callable[[Path], object],
        files_given: dict[str, str] | None = None,
        *,
        shared: bool = False,
    ) -> None:
        """Make the file ``name`` with ``write(path)``, or reuse it, if ``shared`` any command's; report that."""
        if where := self.workspace.ensure(name, inputs, write, files_given, shared=shared):
            self.reused.append(name)
            self.reporter.note(f"{name}: {where}, reused")
        self.files[name] = holds

    def made_from(self, *names: str) -> list[str]:
        """Return what each of ``names`` was made from, to be an input of the next file."""
        return [self.workspace.made_from(name) for name in names]

    def inputs(self, *names: str, **more: Any) -> dict[str, Any]:
        """Return what files are made from by their names without suffix, and ``more``: inputs of the next file."""
        return {**{Path(name).stem: self.made_from(name) for name in names}, **more}
