"""The base of directives whose content is made from the code: Markdown in, parsed in place."""

from __future__ import annotations

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective


class GeneratedText(SphinxDirective):
    """A directive that writes Markdown, headings included."""

    source = ""
    """The module that the text is made from, for messages."""

    def text(self) -> str:
        """Return the Markdown."""
        raise NotImplementedError

    def run(self) -> list[nodes.Node]:
        """Parse the text where the directive stands."""
        container = nodes.Element()
        container.document = self.state.document
        lines = StringList(self.text().splitlines(), source=self.source)
        self.state.nested_parse(lines, self.content_offset, container, match_titles=True)
        return container.children
