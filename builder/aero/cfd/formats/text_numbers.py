"""Numbers from text files: fast where all is well, line by line where a wrong word has to be named."""

import warnings
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.files import read_bytes


def read_file(path: Path) -> bytes:
    """Return the bytes of a file that must exist and hold something.

    Raises
    ------
    InputError
        The file is missing, cannot be read or is empty.
    """
    content = read_bytes(path)
    if not content.strip():
        raise InputError(f"{path}: the file is empty")
    return content


def numbers_of(path: Path, content: bytes, first_line: int = 1) -> FloatArray:
    """Return all numbers of a text, separated by blanks or line ends.

    ``first_line`` is the number of the text's first line in the file, for messages.

    Raises
    ------
    InputError
        A word is no number, or a number is not finite: line, word.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = np.fromstring(content, sep=" ")
        except (DeprecationWarning, ValueError):
            values = np.array([np.nan])
    if not np.isfinite(values).all():
        _refuse_first_bad_word(path, content, first_line)
    return values


def _refuse_first_bad_word(path: Path, content: bytes, first_line: int) -> None:
    numbers_ahead = False  # without any, it is another file, of which nothing is shown
    for number, line in enumerate(content.splitlines(), start=first_line):
        for word in line.split():
            try:
                good = bool(np.isfinite(float(word)))
            except ValueError:
                good = False
            if not good:
                shown = repr(word.decode("ascii", "replace")[:40]) if numbers_ahead else "other text"
                raise InputError(f"{path}: line {number}: {shown} found, must be a finite number")
            numbers_ahead = True
    raise InputError(f"{path}: a number is not finite")
