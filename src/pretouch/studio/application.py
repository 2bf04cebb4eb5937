"""Define the web application of the studio.

The application serves the page and answers its requests. The application serves one user on one machine. Every request
must have the token, which is new at each start, and the host 127.0.0.1 or localhost. If a request has an origin, it
must be this server. Therefore no other web page can use the application, not even under a domain name that resolves to
127.0.0.1.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Awaitable, Callable
from typing import Any, Final

from pretouch._core.errors import InvalidInputError, PretouchError, require
from pretouch._core.files import as_json
from pretouch._core.messages import not_one_of

from .answers import (
    change_scenario,
    describe_reservations,
    describe_scenario,
    fit_readings,
    message_of,
    read_readings,
    sample_cloud,
    simulate_run,
)
from .jobs import Jobs
from .opened_files import OpenedFiles
from .page_file import page_text

MOST_BYTES: Final = 10_000_000
"""Largest request: a calibration of a few hundred thousand readings."""

_MOST_TEXT: Final = 1_000_000
_HEADERS: Final = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class _RefusedRequestError(Exception):
    """Error for a request that the server refuses to answer.

    Args:
        status: the HTTP status code.
        message: the reason.
    """

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status, self.message = status, message


class Application:
    """The web application of a running studio.

    Args:
        files: the opened files.
        token: the secret that every request must contain.
        port: the port of the server.
    """

    def __init__(self, files: OpenedFiles, token: str, port: int) -> None:
        self.files, self.token = files, token
        self.jobs = Jobs(files)
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._answers: dict[str, Callable[[_Asked], dict[str, Any]]] = {
            "describe": lambda a: describe_scenario(files, a.text),
            "reservations": lambda a: describe_reservations(files, a.text, a.of("gain", float)),
            "change": lambda a: change_scenario(a.text, a.of("changes", dict)),
            "save": lambda a: files.save(a.text, a.known),
            "reload": lambda _: {"text": files.text},
            "fit": lambda a: fit_readings(files, a.of("name", str), a.window),
            "cloud": lambda a: sample_cloud(files, a.text, a.of("gain", float)),
            "simulate": lambda a: simulate_run(files, a.text, a.gain, a.seed),
            "jobs": lambda a: {"job": self.jobs.start(a.of("verb", str), a.text, a.gain)},
        }

    def asgi(self) -> Any:
        """Return the application for an ASGI server."""
        applications = require("starlette.applications", extra="studio")
        routing = require("starlette.routing", extra="studio")
        gzip = require("starlette.middleware.gzip", extra="studio")
        route = routing.Route
        routes = [
            route("/", self._page),
            route("/api/{name}", self._answer, methods=["POST"]),
            route("/api/jobs/{name}", self._job, methods=["GET", "DELETE"]),
            route("/api/jobs/{name}/{file}", self._job_file),
        ]
        application = applications.Starlette(routes=routes)
        application.add_middleware(gzip.GZipMiddleware, minimum_size=2000)
        return application

    def close(self) -> None:
        """End all jobs, and remove the temporary files."""
        self.jobs.close()
        self.files.close()

    def _check(self, request: Any, token: str) -> None:
        """Refuse requests from foreign hosts or origins, or without the token."""
        host = request.headers.get("host", "")
        if host not in self._hosts:
            raise _RefusedRequestError(421, "host: this server answers only as 127.0.0.1 or localhost")
        origin = request.headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            raise _RefusedRequestError(403, "origin: this server answers only its own page")
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            raise _RefusedRequestError(
                403,
                "token: the request has no valid token; open the address that pretouch studio printed when it started",
            )

    async def _guarded(self, request: Any, token: str, work: Callable[[], Awaitable[Any]]) -> Any:
        """Check a request, and return its response or an error message.

        Returns:
            The response; that of an error has an HTTP status code.
        """
        responses = require("starlette.responses", extra="studio")
        try:
            self._check(request, token)
            response = await work()
        except _RefusedRequestError as refused:
            response = responses.JSONResponse({"message": refused.message}, refused.status)
        except PretouchError as error:
            message = message_of(error, self.files.folder)
            response = responses.JSONResponse({"message": message}, 422)
        response.headers.update(_HEADERS)
        return response

    async def _page(self, request: Any) -> Any:
        responses = require("starlette.responses", extra="studio")

        async def page() -> Any:
            nonce = secrets.token_urlsafe(16)
            opened = self.files.opened
            server = {
                "token": self.token,
                "name": "" if opened is None else str(opened.resolve()),
                "title": "studio" if opened is None else opened.name,
                "text": self.files.text,
                "file": None if opened is None else opened.name,
                "limit": MOST_BYTES,
            }
            policy = (
                f"default-src 'none'; script-src 'nonce-{nonce}' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; "
                "img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
            )
            return responses.HTMLResponse(page_text(server, nonce=nonce), headers={"Content-Security-Policy": policy})

        return await self._guarded(request, request.query_params.get("token", ""), page)

    async def _answer(self, request: Any) -> Any:
        concurrency = require("starlette.concurrency", extra="studio")
        responses = require("starlette.responses", extra="studio")

        async def answer() -> Any:
            name = request.path_params["name"]
            content = await _body(request, MOST_BYTES if name == "calibration" else _MOST_TEXT)
            result = await concurrency.run_in_threadpool(self._compute, name, content, request.headers)
            return responses.Response(as_json(result), media_type="application/json")

        return await self._guarded(request, request.headers.get("x-pretouch-token", ""), answer)

    def _compute(self, name: str, content: bytes, headers: Any) -> dict[str, Any]:
        """Compute the answer to a request of the page."""
        files = self.files
        if name == "calibration":
            from urllib.parse import unquote  # noqa: PLC0415

            return read_readings(files, files.add_file(unquote(headers.get("x-name", "")), content))
        if name not in self._answers:
            raise InvalidInputError(**not_one_of("request", name, self._answers))
        return self._answers[name](_Asked(_json_object(content)))

    async def _job(self, request: Any) -> Any:
        responses = require("starlette.responses", extra="studio")

        async def job() -> Any:
            name = request.path_params["name"]
            if request.method == "DELETE":
                concurrency = require("starlette.concurrency", extra="studio")
                await concurrency.run_in_threadpool(self.jobs.cancel, name)
            return responses.Response(as_json(self.jobs.get(name).as_dict()), media_type="application/json")

        return await self._guarded(request, request.headers.get("x-pretouch-token", ""), job)

    async def _job_file(self, request: Any) -> Any:
        responses = require("starlette.responses", extra="studio")

        async def file() -> Any:
            job, name = self.jobs.get(request.path_params["name"]), request.path_params["file"]
            if name not in {"report.html", "export.zip"} or not (job.folder / name).exists():
                raise InvalidInputError("file: this computation has written no such file")
            return responses.FileResponse(job.folder / name)

        return await self._guarded(request, request.headers.get("x-pretouch-token", ""), file)


def _json_object(content: bytes) -> dict[str, Any]:
    """Return the JSON object of a request; empty if the content is another JSON value."""
    try:
        value = json.loads(content)
        json.dumps(value, ensure_ascii=False).encode()  # fails for half a surrogate pair, which no file can contain
    except (ValueError, RecursionError) as error:
        reason = "is nested too deep" if isinstance(error, RecursionError) else "is not JSON"
        raise InvalidInputError(f"request: the content {reason}, expected a JSON object from the page") from None
    return value if isinstance(value, dict) else {}


def _number(name: str, value: Any) -> float:
    """Return a number of a request as float."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise InvalidInputError(f"{name}: found {type(value).__name__}, expected a number")
    try:
        return float(value)
    except OverflowError:
        digits = len(str(abs(value)))
        raise InvalidInputError(f"{name}: found an integer of {digits} digits, expected at most 308") from None


class _Asked:
    """The arguments of a request, which are checked when they are read.

    Args:
        values: the JSON object of the request.
    """

    def __init__(self, values: dict[str, Any]) -> None:
        self._values = values

    def of(self, name: str, kind: type) -> Any:
        """Return an argument of the request after checking its type.

        Raises:
            InvalidInputError: the type is wrong. An integer counts as float.
        """
        value = self._values.get(name)
        if kind is float:
            return _number(name, value)
        if not isinstance(value, kind):
            raise InvalidInputError(f"{name}: found {type(value).__name__}, expected {kind.__name__}")
        return value

    @property
    def text(self) -> str:
        """The text of the scenario file in the request."""
        return str(self.of("text", str))

    @property
    def known(self) -> str | None:
        """The text of the opened file that the page knows; None to overwrite any text."""
        return None if self._values.get("known") is None else str(self.of("known", str))

    @property
    def gain(self) -> float | None:
        """The gain or drag in the request.

        None stands for the one in the scenario, or else for the designed one.
        """
        return None if self._values.get("gain") is None else float(self.of("gain", float))

    @property
    def seed(self) -> int | None:
        """The seed of the simulated noise.

        None stands for the seed in the scenario.
        """
        return None if self._values.get("seed") is None else int(self.of("seed", int))

    @property
    def window(self) -> tuple[float, float] | None:
        """The two distances [m] between which a curve is fitted.

        None stands for the usable range that pretouch finds.

        Raises:
            InvalidInputError: the argument does not consist of two numbers.
        """
        if self._values.get("window") is None:
            return None
        ends = self.of("window", list)
        if len(ends) != 2:
            raise InvalidInputError(f"window: found {len(ends)} values, expected two distances in meters")
        return _number("window", ends[0]), _number("window", ends[1])


async def _body(request: Any, most: int) -> bytes:
    """Return the body of a request, unless it is too large."""
    message = (
        f"upload: the file exceeds the limit of {most / 1e6:g} MB; reduce the file, for example by averaging "
        "repeated readings"
    )
    declared = request.headers.get("content-length", "0")
    if declared.isdigit() and int(declared) > most:
        raise _RefusedRequestError(413, message)
    parts, size = [], 0
    async for part in request.stream():
        size += len(part)
        if size > most:
            raise _RefusedRequestError(413, message)
        parts.append(part)
    return b"".join(parts)
