"""The command line that studies of one map share: a vehicle file, its map, and flows of the independent model."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from strainfmu.errors import StrainfmuError


def study_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """Return the parser of ``python -m builder.stress.NAME`` with the files and the seed of a study."""
    parser = argparse.ArgumentParser(
        prog=f"python -m builder.stress.{name}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("vehicle", type=Path, help="vehicle file of the map")
    parser.add_argument("map", type=Path, help="map.h5")
    parser.add_argument("flows", type=Path, help="independent_flows.h5, or other flows of the independent model")
    parser.add_argument("--seed", type=int, default=1)
    return parser


def run_study(main: Callable[[], None]) -> None:
    """Run ``main``; what it refuses is one line, and the exit code is not 0."""
    try:
        main()
    except StrainfmuError as error:
        print(f"strainfmu: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
