"""Description of an FMU besides its variables, for both FMI versions."""

import hashlib
import re
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from strainfmu.errors import InputError
from strainfmu.files import build_time, stated_time
from strainfmu.fmu.description.port import Port
from strainfmu.interface.fmi_variables import Variable, value_references
from strainfmu.version import __version__

_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_DNS, "strainfmu")

_NO_TIME = "1980-01-01T00:00:00Z"
"""Stamp of FMUs whose data state no time: the time of their zip entries, the earliest a zip can hold."""

AUTHOR = "strainfmu developers"
COPYRIGHT = "strainfmu developers; the data inside belong to their makers"
LICENSE = "BSD-3-Clause"
TOLERANCE = "1e-06"

LOG_CATEGORIES = {
    "logEvents": "What happens, as another state of health, with status OK",
    "logStatusWarning": "Messages with status Warning",
    "logStatusDiscard": "Messages with status Discard",
    "logStatusError": "Messages with status Error",
    "logStatusFatal": "Messages with status Fatal",
    "logAll": "All messages",
}


@dataclass(frozen=True, kw_only=True)
class FmuDescription:
    """Description of an FMU.

    Attributes
    ----------
    model_name : free text, shown by tools.
    description : one sentence on what it computes.
    interface : the variables that are listed, in their order.
    content_hash : hash of everything inside that decides the results.
    stop_time : end of the default experiment [s].
    step_size : communication step size of the default experiment [s].
    capabilities : attributes of the CoSimulation element.
    fmi_version : "2" for FMI 2.0, "3" for FMI 3.0.
    source_files : names inside ``sources/`` of the files to compile, none for a Python FMU.
    model_exchange : attributes of the ModelExchange element; None for an FMU without it.
    n_arrays : number of arrays that an interface of scalars stands for in FMI 3.0; None for one of the arrays.
    ports : to a CAN bus (FMI 3.0).
    build_date : time at which the data inside were made, "" for none stated.
    numbers : number of each variable by name, its value reference but for scalars of FMI 3.0; None for its index
        in ``interface``.
    """

    model_name: str
    description: str
    interface: Sequence[Variable]
    content_hash: str
    stop_time: float
    step_size: float
    capabilities: Mapping[str, str] = field(default_factory=dict)
    fmi_version: str = "2"
    source_files: Sequence[str] = ()
    model_exchange: Mapping[str, str] | None = None
    n_arrays: int | None = None
    build_date: str = ""
    ports: Sequence[Port] = ()
    numbers: Mapping[str, int] | None = None

    @property
    def model_identifier(self) -> str:
        """The model name turned into a C name, as file names of binaries must be (section 2.2.1)."""
        return model_identifier(self.model_name)

    @property
    def references(self) -> Mapping[str, int]:
        """The number of each variable by name."""
        return value_references(self.interface) if self.numbers is None else self.numbers

    @cached_property
    def guid(self) -> str:
        """A name-based UUID: equal content and interface give an equal guid, any change another one."""
        variables = [tuple(vars(variable).values()) for variable in self.interface]
        content = repr((self.model_name, self.content_hash, __version__, self.fmi_version, variables))
        return f"{{{uuid.uuid5(_NAMESPACE, hashlib.sha256(content.encode()).hexdigest())}}}"


def model_identifier(model_name: str) -> str:
    """Return ``model_name`` as a C name.

    Raises
    ------
    InputError
        It holds no letter or digit to make one from.
    """
    identifier = re.sub(r"[^A-Za-z0-9]+", "_", model_name).strip("_")
    if not identifier:
        raise InputError(f"model name: '{model_name}' found, at least one letter from A to Z is needed")
    return f"m_{identifier}" if identifier[0].isdigit() else identifier


def generation_time(build_date: str = "") -> str:
    """Return the time to stamp, for XML: SOURCE_DATE_EPOCH, else ``build_date``, "" for none, else 1980-01-01.

    Raises
    ------
    InputError
        SOURCE_DATE_EPOCH is no number of seconds.
    """
    return build_time() if stated_time() is not None else build_date or _NO_TIME


def root_attributes(fmu: FmuDescription) -> dict[str, str]:
    """Return the attributes of ``fmiModelDescription`` common to FMI 2.0 and 3.0."""
    return {
        "modelName": fmu.model_name,
        "description": fmu.description,
        "author": AUTHOR,
        "version": __version__,
        "copyright": COPYRIGHT,
        "license": LICENSE,
        "generationTool": f"strainfmu {__version__}",
        "generationDateAndTime": generation_time(fmu.build_date),
        "variableNamingConvention": "structured",
    }


def default_experiment(fmu: FmuDescription) -> dict[str, str]:
    """Return the attributes of ``DefaultExperiment``."""
    return {
        "startTime": "0",
        "stopTime": repr(fmu.stop_time),
        "tolerance": TOLERANCE,
        "stepSize": repr(fmu.step_size),
    }


def number_text(value: float | int | bool) -> str:
    """Return ``value`` as FMI's XML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int) else repr(float(value))
