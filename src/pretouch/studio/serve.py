"""Start the server of the studio on this machine, and open its page."""

from __future__ import annotations

import contextlib
import secrets
import signal
import socket
import sys
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pretouch._core.errors import InvalidInputError, require

from .application import Application
from .opened_files import OpenedFiles
from .page_file import page_text


def serve_studio(
    file: Path | None = None,
    *,
    port: int = 0,
    open_browser: bool = True,
    announce: Callable[[str], object] = print,
) -> None:
    """Serve the studio on 127.0.0.1 until the process ends.

    Args:
        file: a scenario file (TOML); None to start with the example of the letter.
        port: the port; 0 for a free one.
        open_browser: whether to open the page in the browser.
        announce: function that receives the address, which contains the token.
    """
    uvicorn = require("uvicorn", extra="studio")
    require("starlette", extra="studio")
    require("tomlkit", extra="studio")
    page_text()  # raises an error if the compiled core of the page is missing
    if file is not None:
        from pretouch.config.document import read_document  # noqa: PLC0415 - only with a file

        read_document(file)  # raises an error if the file is missing or not TOML
    listener = _listener(port)
    for name in ("SIGTERM", "SIGHUP"):  # so that a terminated server, or that of a closed terminal, ends its jobs
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: sys.exit(0))
    application = Application(OpenedFiles(file), secrets.token_urlsafe(24), listener.getsockname()[1])
    try:
        address = f"http://127.0.0.1:{listener.getsockname()[1]}/?token={application.token}"
        announce(address)
        if open_browser:
            webbrowser.open(address)
        settings = uvicorn.Config(
            application.asgi(), log_level="error", access_log=False, server_header=False, timeout_graceful_shutdown=1
        )
        with contextlib.suppress(KeyboardInterrupt):
            uvicorn.Server(settings).run(sockets=[listener])
    finally:
        application.close()


def _listener(port: int) -> Any:
    """Return a socket that listens on 127.0.0.1 only."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
        listener.listen()  # so that a browser that connects before the server is ready waits
    except OSError as error:
        listener.close()
        raise InvalidInputError(
            f"port: the server cannot use port {port} ({error.strerror or error}); choose another port, or omit the "
            "option --port"
        ) from None
    return listener
