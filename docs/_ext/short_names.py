"""Short names of Python objects are looked up once: annotations name the same few types thousands of times."""

from __future__ import annotations

from functools import cache
from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain


class PythonDomainByName(PythonDomain):
    """The domain of Python, whose search of a short name among all objects is kept while no object is added."""

    def find_obj(self, *where: Any) -> list[Any]:
        """Return the objects of a name; Sphinx calls it with the same arguments."""
        return list(self._found(len(self.objects), *where[1:]))

    @cache  # noqa: B019 - the domain lives as long as the build
    def _found(self, n_objects: int, *where: Any) -> tuple[Any, ...]:
        return tuple(super().find_obj(self.env, *where))


def setup(app: Sphinx) -> dict[str, bool]:
    """Take the place of the domain of Python."""
    app.add_domain(PythonDomainByName, override=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
