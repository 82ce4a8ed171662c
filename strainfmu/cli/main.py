"""The command ``strainfmu``.

Whatever goes wrong ends in one line on standard error, or one for each wrong entry of a file: exit code 2 for an
input, 1 for anything else.
Set STRAINFMU_TRACEBACK=1 to see where an error came from.
"""

import gc
import os
import sys
import traceback
from typing import NoReturn

from strainfmu.errors import StrainfmuError

EXTRAS = {
    **dict.fromkeys(("typer", "rich"), "cli"),
    **dict.fromkeys(("scipy", "skfem", "numba", "pydantic"), "build"),
    **dict.fromkeys(("fmpy", "pythonfmu"), "fmu"),
    **dict.fromkeys(("can", "cantools", "msgpack"), "can"),
    **dict.fromkeys(("dask", "distributed"), "campaign"),
    **dict.fromkeys(("gmsh", "meshio"), "mesh"),
    **dict.fromkeys(("matplotlib", "reportlab"), "report"),
    "cryptography": "auth",
    "asammdf": "mf4",
    "nptdms": "tdms",
    "pyarrow": "parquet",
    "vtk": "cfd",
    "sklearn": "rivals",
}
"""The smallest extra of this package that has a module."""

GARBAGE = 50_000
"""Objects made between searches for unreachable ones. With Python's 700 the searches take 4 % of a command that
computes for half a minute."""

INTERRUPTED = 130
"""Exit code of a command that Ctrl-C ended, as a shell has it."""


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and leave the process with its exit code."""
    typed = sys.argv[1:] if arguments is None else arguments
    gc.set_threshold(GARBAGE)
    try:
        from typer.main import get_command

        from strainfmu.cli.commands import program
        from strainfmu.cli.commands.help_layout import MODULES

        names = {*typed[:1]} & {*MODULES, "--version"}
        app = program(names) if names else program(with_options=False)
        code = get_command(app).main(args=arguments, prog_name="strainfmu", standalone_mode=False)
    except KeyboardInterrupt:
        _fail("interrupted; what was finished is kept", INTERRUPTED)
    except StrainfmuError as error:
        _fail_with([_with_help(line, typed) for line in error.lines], error.exit_code)
    except ImportError as error:
        _fail(missing_text((error.name or str(error)).partition(".")[0]), 1)
    except OSError as error:
        _fail(f"{error.filename or 'file system'}: {error.strerror or error}", 1)
    except Exception as error:
        message = getattr(error, "format_message", None)  # a wrong option or argument
        if message is not None and message():
            command = getattr(getattr(error, "ctx", None), "command_path", "strainfmu")
            text = message().rstrip(".").replace("Value error, ", "")
            _fail(f"{text}{' See' if text.endswith('?') else '; see'} '{command} --help'", 2)
        if message is not None:
            sys.exit(2)  # no arguments at all: the help has been printed
        if type(error).__name__ == "Abort":
            _fail("interrupted; what was finished is kept", INTERRUPTED)
        _fail(f"internal error, please report it: {type(error).__name__}: {error}", 1)
    if code == INTERRUPTED:  # by typer, which says nothing
        _fail("interrupted; what was finished is kept", INTERRUPTED)
    sys.exit(code if isinstance(code, int) else 0)


def missing_text(module: str) -> str:
    """Return what to install for a module that is missing: the smallest extra, or all."""
    extra = EXTRAS.get(module, "all")
    use = "; it is enough to estimate with a map, inspect and export it" if extra == "cli" else ""
    return f"'{module}' is not installed: pip install 'strainfmu[{extra}]'{use}"


def _with_help(line: str, arguments: list[str]) -> str:
    """Return a line that refuses an option, with the help of the command that takes it; another line as it is."""
    command = next((argument for argument in arguments if not argument.startswith("-")), "")
    return f"{line}; see 'strainfmu {command} --help'" if line.startswith("--") and command else line


def _fail(message: str, exit_code: int) -> NoReturn:
    """Print one line and leave."""
    _fail_with([" ".join(message.split())], exit_code)


def _fail_with(lines: list[str], exit_code: int) -> NoReturn:
    """Print lines and leave."""
    if os.environ.get("STRAINFMU_TRACEBACK"):
        traceback.print_exc()
    for line in lines:
        print(f"strainfmu: {line}", file=sys.stderr)
    sys.exit(exit_code)
