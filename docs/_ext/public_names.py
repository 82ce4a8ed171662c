"""The Python reference, made from the stubs of the packages, group by group: directive ``public-names``."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path

from generated_text import GeneratedText
from sphinx.application import Sphinx

ENTRY = re.compile(r"^# (?P<title>[A-Z].*)$|^from \S+ import (?P<name>\w+)", re.MULTILINE)


def reference_page(package: str) -> str:
    """Return every public name of a package under the title of its group, in MyST Markdown."""
    module = import_module(package)
    blocks = ["```{eval-rst}", f".. automodule:: {package}", "   :no-members:", "```"]
    for entry in ENTRY.finditer(Path(str(module.__file__)).with_suffix(".pyi").read_text("utf-8")):
        if entry["title"]:
            blocks += ["", f"### {package}: {entry['title']}", ""]
            continue
        if entry["name"].startswith("__"):
            continue
        value = getattr(module, entry["name"])
        kind = "class" if inspect.isclass(value) else "function" if callable(value) else "data"
        blocks += ["```{eval-rst}", f".. auto{kind}:: {package}.{entry['name']}", "```"]
    return "\n".join(blocks)


class PublicNames(GeneratedText):
    """Every public name of the package that is the argument."""

    required_arguments = 1

    def text(self) -> str:
        """Return the page."""
        return reference_page(self.arguments[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
