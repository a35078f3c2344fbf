"""The viewer of the program, from Python."""

from __future__ import annotations

import base64
import html
import os
import sys
import weakref
import webbrowser
from collections.abc import Callable

from . import _lumbre


class Viewer:
    """A page in the browser that shows a scene while it is rendered, until it is closed, forgotten, or Python ends.

    It listens on this machine alone, and lets in who has its address, which works once: what opens it goes on to work there. Use it in a
    `with`, or call `close`. A notebook shows a small picture with the address next to it. The page is not put into the notebook, for no page
    of another server may frame it or lead to it, so that none can steer what it shows: type or copy the address.

    >>> import lumbre
    >>> with lumbre.Scene([lumbre.Sphere()]).view(open=False) as viewer:
    ...     viewer.is_open, viewer.url.startswith("http://127.0.0.1:")
    (True, True)
    >>> viewer.is_open
    False
    """

    def __init__(self, native: _lumbre.Viewer, picture: Callable[[], bytes]) -> None:
        self._native = native
        self._picture = picture
        # Also at exit.
        self._close = weakref.finalize(self, native.close)

    @property
    def url(self) -> str:
        """The address, which works once."""
        return self._native.url()

    @property
    def is_open(self) -> bool:
        """Whether it has not been closed."""
        return self._native.is_open()

    def close(self) -> None:
        """Ends it, and returns when it has ended. A second time does nothing."""
        self._close()

    def open(self) -> bool:
        """Opens the address in the browser of this machine; False where it seems to have none, as over SSH."""
        has_screen = sys.platform in ("darwin", "win32") or any(name in os.environ for name in ("DISPLAY", "WAYLAND_DISPLAY"))
        return has_screen and "SSH_CONNECTION" not in os.environ and webbrowser.open(self.url)

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<lumbre.Viewer at {self.url}>" if self.is_open else "<lumbre.Viewer, closed>"

    def _repr_html_(self) -> str:
        if not self.is_open:
            return "<p>The viewer is closed.</p>"
        picture = base64.b64encode(self._picture()).decode()
        where = f"Open <code>{html.escape(self.url)}</code> in a browser, once."
        return f'<img src="data:image/png;base64,{picture}" alt=""><p>{where}</p>'
