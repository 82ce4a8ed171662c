"""What is found out about a mesh before it is solved on, as the settings of a structure hold it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from builder.reporting import Reporter
from builder.structure.solid.checks.locking import LockingWarning


def examination(
    report: Iterable[tuple[str, Any, str]], check: Callable[[], Mapping[int, float]], reporter: Reporter
) -> dict[str, Any]:
    """Run the locking check and return the entries ``mesh_report`` and ``locking`` of the settings.

    Parameters
    ----------
    report : what, value, unit of each line of the mesh report.
    check : returns the kept share of the wall's bending by harmonic; its warnings go to ``reporter``.
    reporter : takes stages and notes.
    """
    with reporter.stage("Locking check"), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LockingWarning)
        ratios = check()
    for one in caught:
        reporter.note(f"warning: {one.message}")
    return {
        "mesh_report": [
            [what, value if isinstance(value, int) else float(value), unit] for what, value, unit in report
        ],
        "locking": {str(harmonic): float(ratio) for harmonic, ratio in ratios.items()},
    }
