"""Explanations: every number between a pixel, or a ray, and its colour."""

from __future__ import annotations

import html
import json
from collections.abc import Callable
from typing import Any


class Explanation(dict[str, Any]):
    """An explanation as data, in the words of `lumbre explain --format json`: a title, and sections of quantities, tables and sections.

    It is a dict of dicts, lists, numbers and strings; infinite numbers are the strings "inf" and "-inf". In a notebook it shows itself as a
    page with its formulas and a sketch.

    >>> import lumbre
    >>> scene = lumbre.Scene([lumbre.Sphere(radius=2)])
    >>> told = scene.explain(ray=((0, 0, 5), (0, 0, -1)))
    >>> [section["key"] for section in told["sections"]]
    ['ray', 'surfaces', 'light']
    """

    def __init__(self, write: Callable[[str], str]) -> None:
        super().__init__(json.loads(write("json")))
        self._write = write

    def text(self) -> str:
        """As plain text."""
        return self._write("text")

    def markdown(self) -> str:
        """As Markdown, with formulas in LaTeX."""
        return self._write("markdown")

    def html(self) -> str:
        """As a page of its own, which needs nothing from a network."""
        return self._write("html")

    def __repr__(self) -> str:
        return f"<lumbre.Explanation {self['title']!r}>"

    def __reduce__(self) -> tuple[type[dict[str, Any]], tuple[dict[str, Any]]]:
        # The scene stays where it is.
        return dict, (dict(self),)

    def _repr_html_(self) -> str:
        # In a frame, so that neither page changes how the other looks.
        page = html.escape(self.html(), quote=True)
        return f'<iframe srcdoc="{page}" sandbox="" title="{html.escape(self["title"])}" style="width:100%;height:40rem;border:0"></iframe>'
