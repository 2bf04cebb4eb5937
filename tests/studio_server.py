"""Start pretouch studio as a user does, for tests: a process that prints its address."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from page_core import built_core


@dataclass
class RunningStudio:
    """A running server: its process, address, port and token."""

    process: subprocess.Popen
    address: str
    port: int
    token: str

    def ask(
        self, method: str, path: str, body: Any = None, *, host: str | None = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """Send one request with given headers, and return status, headers and content of the response."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        content = body if isinstance(body, bytes | None) else json.dumps(body).encode()
        sent = {"Host": host or f"127.0.0.1:{self.port}", "X-Pretouch-Token": self.token, **headers}
        try:
            connection.request(method, path, content, {k: v for k, v in sent.items() if v})
            response = connection.getresponse()
            return response.status, dict(response.getheaders()), response.read()
        finally:
            connection.close()

    def answer(self, name: str, body: Any = None, method: str = "POST") -> Any:
        """Return the JSON object that answers a request."""
        status, _, content = self.ask(method, f"/api/{name}", body)
        return {"status": status, **json.loads(content)}

    def stop(self) -> None:
        """End the server."""
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(30)


@contextmanager
def running_studio(*arguments: str | Path) -> Iterator[RunningStudio]:
    """Run the server until the end of a `with` block; skip the test without the extra or the core of the page."""
    for name in ("starlette", "uvicorn", "tomlkit"):
        pytest.importorskip(name)
    built_core()
    command = [sys.executable, "-m", "pretouch", "studio", *map(str, arguments), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ.copy())
    try:
        assert process.stdout is not None
        found = re.search(r"(http://127\.0\.0\.1:(\d+)/\?token=(\S+))", process.stdout.readline())
        assert found is not None
        yield RunningStudio(process, found[1], int(found[2]), found[3])
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(30)
        if process.stdout is not None:
            process.stdout.close()
