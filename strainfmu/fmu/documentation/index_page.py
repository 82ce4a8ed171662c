"""``documentation/`` of an FMU: one HTML page that needs no other file, and the texts next to it.

Source of the folder and file names: FMI 2.0.5, section 2.3; FMI 3.0.2, section 2.5.
"""

from collections.abc import Sequence
from html import escape
from importlib import resources

from strainfmu.fmu.description.fmu_description import FmuDescription
from strainfmu.interface.enumerations import HEALTH_TYPE, Q_SOURCE_TYPE, TARE_TYPE, Items, used_enumerations
from strainfmu.interface.fmi_variables import Variable
from strainfmu.pages import STYLE, table_html

_STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em;line-height:1.4;color:#222}"
    "table{font-size:90%}td,th{border:1px solid #bbb;padding:.2em .5em}"
    "th{background:#eee}code,pre{background:#f4f4f4}"
)

PYTHON_HOSTS = (
    "A host that holds no Python interpreter of its own, such as fmusim, the command line of OMSimulator or a C "
    "program, cannot load it: its library has undefined symbols of Python, which only LD_PRELOAD of libpython3 "
    "provides on Linux"
)
"""The first that a user of the kind python must know, without its full stop."""

PYTHON_FOLDERS = (
    "The path of the folder that a host unzips it to may hold letters from A to Z, digits, blanks and . _ - ~ "
    "only: PythonFMU ends the process of the host where it holds others, such as an umlaut in the name of a user"
)
"""The second, without its full stop."""

HOSTS = {
    "python": (
        "PythonFMU runs it: the host needs a 64-bit Python 3.11 or newer with numpy and h5py, on Linux or "
        "Windows; externalDependencies.txt lists the rest. strainfmu itself need not be installed.",
        f"{PYTHON_HOSTS}.",
        f"{PYTHON_FOLDERS}.",
        "PythonFMU lets no slave refuse a value: what cannot be set is logged as an error and left as it was, "
        "while the call returns OK. It does not compare the guid, and offers no directional derivatives. The "
        "native kind of this FMU has none of these limits.",
    ),
    "native": (
        "Nothing: the FMU holds compiled code for each of its platforms and the C sources it was made of.",
        "For another platform build the sources with CMake and any C99 compiler: in the unpacked FMU "
        "<code>cmake -S sources -B build</code>, then <code>cmake --build build</code>. The library in "
        "<code>build</code> goes into <code>binaries</code>, to the folder of the platform. The FMI headers are "
        "included; <code>-D FMI_HEADERS=folder</code> takes others.",
    ),
}
"""Requirements of each kind on its host, paragraph by paragraph."""

_LICENSES = {"python": ("license", "pythonfmu"), "native": ("license", "zig", "mingw-w64")}

Section = tuple[str, Sequence[str]]
"""A heading and its paragraphs, as HTML; what begins with a tag of a block stands as it is."""


def documentation_files(fmu: FmuDescription, sections: Sequence[Section], kind: str) -> dict[str, bytes]:
    """Return content by name inside ``documentation/``: the page, dependencies and licences."""
    package = resources.files("fmus")
    files = {"index.html": index_html(fmu, sections, kind).encode()}
    if kind == "python":
        files["externalDependencies.txt"] = package.joinpath("python", "externalDependencies.txt").read_bytes()
    for name in _LICENSES[kind]:
        files[f"licenses/{name}.txt"] = package.joinpath("licenses", f"{name}.txt").read_bytes()
    return files


def index_html(fmu: FmuDescription, sections: Sequence[Section], kind: str) -> str:
    """Return the page: ``sections``, then the variables with units, then what the host must offer."""
    parts = [f"<h1>{escape(fmu.model_name)}</h1>", f"<p>{escape(fmu.description)}.</p>"]
    for heading, paragraphs in (
        *sections,
        ("Variables", [_variable_table(fmu.interface)]),
        *_enumerations(fmu),
        ("What the host must offer", HOSTS[kind]),
    ):
        parts.append(f"<h2>{escape(heading)}</h2>")
        parts.extend(
            text if text.startswith(("<table", "<details", "<svg", "<pre")) else f"<p>{text}</p>"
            for text in paragraphs
        )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{escape(fmu.model_name)}</title>"
        f"<style>{_STYLE}\n{STYLE}</style></head>\n<body>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def _variable_table(interface: Sequence[Variable]) -> str:
    """Return the table of variables."""
    rows = [
        (
            variable.name if variable.dimension is None else f"{variable.name}[{variable.dimension}]",
            variable.causality,
            variable.unit or variable.declared_type or variable.fmi_type,
            variable.display_unit or "",
            _start_text(variable),
            variable.description,
        )
        for variable in interface
    ]
    return table_html(
        ("Name", "Causality", "Unit", "Shown in", "Start", "Description"),
        rows,
        caption="Variables and their units",
    )


def _start_text(variable: Variable) -> str:
    """Return the start value for people; arrays start with one value throughout."""
    start = variable.start[0] if isinstance(variable.start, tuple) else variable.start
    if start is None:
        return ""
    return str(start).lower() if isinstance(start, bool) else f"{start:g}"


_ENUMERATIONS = {
    HEALTH_TYPE: ("Health", "States of health"),
    TARE_TYPE: ("Tare", "States of the tare"),
    Q_SOURCE_TYPE: ("Source of the dynamic pressure", "Values of q_source"),
}
"""Heading and caption of each enumeration."""


def _enumerations(fmu: FmuDescription) -> list[Section]:
    """Return tables of the enumerations in use."""
    used = used_enumerations({variable.declared_type for variable in fmu.interface})
    return [
        (_ENUMERATIONS[name][0], [_states_table(items, _ENUMERATIONS[name][1])])
        for name, (_, items) in used.items()
    ]


def _states_table(items: Items, caption: str) -> str:
    rows = [(str(int(state)), state.name, text) for state, text in items]
    return table_html(("Value", "State", "Meaning"), rows, caption=caption)
