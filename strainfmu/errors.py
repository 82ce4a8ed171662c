"""The errors a user can cause or meet; each carries one line with the cause and the cure.

The command line prints that line and ends with :attr:`StrainfmuError.exit_code`.
"""


class StrainfmuError(Exception):
    """Something failed that is not the user's input: exit code 1."""

    exit_code = 1


class InputError(StrainfmuError):
    """An input is wrong: which file, entry or signal, what was found, what is allowed. Exit code 2."""

    exit_code = 2


class FlowReachError(InputError):
    """A flight condition is outside what the marching flow solver can compute."""
