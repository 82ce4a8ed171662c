"""The command ``strainfmu``.

Errors a user can cause end in one line on standard error and exit code 2, others in one line and exit code 1.
Set STRAINFMU_TRACEBACK=1 to see where an error came from.
"""

from __future__ import annotations

import os
import sys
import traceback


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code."""
    try:
        from strainfmu.commands import app
    except ImportError as error:
        _fail(f"the command line needs '{error.name}': pip install 'strainfmu[all]'", 1)
    from strainfmu.errors import StrainfmuError

    try:
        app(args=arguments, prog_name="strainfmu")
    except KeyboardInterrupt:
        _fail("interrupted; what was finished is kept", 130)
    except StrainfmuError as error:
        _fail(str(error), error.exit_code)
    except ImportError as error:
        _fail(f"'{error.name}' is not installed: pip install 'strainfmu[all]'", 1)
    except OSError as error:
        _fail(f"{error.filename or 'file system'}: {error.strerror or error}", 1)
    except Exception as error:
        _fail(f"internal error, please report it: {type(error).__name__}: {error}", 1)


def _fail(message: str, exit_code: int) -> None:
    """Print one line and leave."""
    if os.environ.get("STRAINFMU_TRACEBACK"):
        traceback.print_exc()
    line = " ".join(message.split())
    print(f"strainfmu: {line}", file=sys.stderr)
    sys.exit(exit_code)
