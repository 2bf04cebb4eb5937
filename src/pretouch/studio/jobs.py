"""Run long computations in separate processes, which report their progress and can be canceled."""

from __future__ import annotations

import json
import multiprocessing
import os
import secrets
import threading
import zipfile
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from pretouch._core.errors import InvalidInputError, PretouchError
from pretouch._core.files import as_json, remove_tree
from pretouch._core.messages import not_one_of
from pretouch._core.warning_codes import caution

from .opened_files import OpenedFiles

VERBS: Final = ("verify", "pareto", "sweep", "export")
"""The computations that a job can run."""

_MOST: Final = 3  # largest number of running jobs
_KEPT: Final = 20  # largest number of finished jobs whose results are kept
_GRACE: Final = 2.0  # time until a canceled process that has not ended is killed [s]


@dataclass(slots=True)
class Job:
    """A computation of the studio that runs in a separate process.

    Args:
        verb: the computation, one of VERBS.
        folder: the folder of the files that the computation writes.
        process: the process.
        receiver: the end of the pipe from which the server reads the messages of the process.
        state: running, done, failed or canceled.
        progress: the last message about the progress.
        result: headline, text and JSON object of a computation that is done, or the message of one that failed.
    """

    verb: str
    folder: Path
    process: Any
    receiver: Connection
    state: str = "running"
    progress: str = "starting"
    result: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Return the job's state and result as a JSON object.

        The object includes progress and files.
        """
        files = {name: (self.folder / name).exists() for name in ("report.html", "export.zip")}
        return {"verb": self.verb, "state": self.state, "progress": self.progress, "files": files, **self.result}


class Jobs:
    """All computations that the running studio has started.

    Args:
        files: the opened files, which a scenario may name; their temporary folder contains the folders of the jobs.
    """

    def __init__(self, files: OpenedFiles) -> None:
        self._files = files
        self._jobs: dict[str, Job] = {}
        self._lock = threading.Lock()
        self._context = multiprocessing.get_context("spawn")

    def start(self, verb: str, text: str, gain: float | None) -> str:
        """Start a computation, and return the identifier of its job.

        Args:
            verb: one of VERBS.
            text: the text of the scenario file (TOML).
            gain: the number of the law; None for the number in the file, or the designed number if the file has none.

        Returns:
            The identifier.

        Raises:
            InvalidInputError: there is no such computation, or too many are running.
        """
        if verb not in VERBS:
            raise InvalidInputError(**not_one_of("verb", verb, VERBS))
        with self._lock:
            if sum(job.state == "running" for job in self._jobs.values()) >= _MOST:
                raise InvalidInputError(
                    f"jobs: {_MOST} computations are already running, and no more are allowed; wait until one has "
                    "finished, or cancel one"
                )
            name = secrets.token_hex(8)
            folder = self._files.folder / f"job-{name}"
            folder.mkdir()
            try:
                file = self._files.write_scenario(text, folder / "scenario.toml")
            except BaseException:
                remove_tree(folder)
                raise
            receiver, sender = self._context.Pipe(duplex=False)
            process = self._context.Process(target=_run, args=(verb, str(file), gain, str(folder), sender), daemon=True)
            process.start()
            sender.close()
            job = self._jobs[name] = Job(verb=verb, folder=folder, process=process, receiver=receiver)
            finished = [other for other in self._jobs if self._jobs[other].state != "running"]
            for other in finished[:-_KEPT]:
                remove_tree(self._jobs.pop(other).folder)
        threading.Thread(target=self._listen, args=(job,), daemon=True).start()
        return name

    def _listen(self, job: Job) -> None:
        """Read the messages of a job until its process ends."""
        try:
            while True:
                kind, content = job.receiver.recv()
                if kind == "progress":
                    job.progress = content
                else:
                    job.result, job.state = content, kind
        except (EOFError, OSError):
            job.process.join(_GRACE)
            if job.state == "running":
                job.state, job.result = "failed", {"message": "the computation ended without a result"}

    def get(self, name: str) -> Job:
        """Return a job by its identifier.

        Raises:
            InvalidInputError: there is no such job.
        """
        if name not in self._jobs:
            raise InvalidInputError("job: this studio has no such computation; start the computation again")
        return self._jobs[name]

    def cancel(self, name: str) -> None:
        """End the process of a job."""
        job = self.get(name)
        if job.state == "running":
            job.state, job.progress = "canceled", "canceled"
            _end(job.process)

    def close(self) -> None:
        """End the processes of all jobs."""
        for job in self._jobs.values():
            _end(job.process)


def _end(process: Any) -> None:
    process.terminate()
    process.join(_GRACE)
    if process.is_alive():
        process.kill()


def _run(verb: str, file: str, gain: float | None, folder: str, sender: Connection) -> None:
    """Run a job's computation in its own process. Send progress and result."""
    from pretouch._core.progress import listening  # noqa: PLC0415 - in the new process

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    threading.Thread(target=_end_with_server, daemon=True).start()
    try:
        with listening(lambda text: sender.send(("progress", text))):
            sender.send(("progress", "reading the scenario"))
            result = _compute(verb, Path(file), gain, Path(folder), sender)
        sender.send(("done", result))
    except PretouchError as error:
        sender.send(("failed", {"message": str(error)}))


def _end_with_server() -> None:
    """End this process when the server ends, also if the server was killed."""
    server = multiprocessing.parent_process()
    if server is not None:
        server.join()
        os._exit(1)


def _compute(verb: str, file: Path, gain: float | None, folder: Path, sender: Connection) -> dict[str, Any]:
    """Compute a result, and write its report or exported files."""
    from pretouch.config import load_scenario  # noqa: PLC0415

    task = load_scenario(file)
    if gain is not None:
        task = task.replace(gain=gain)
    sender.send(("progress", f"{verb} is running"))
    if verb == "sweep":
        return _sweep(task, sender)
    if verb == "export":
        return _export(task, folder)
    answer: Any
    if verb == "verify":
        from pretouch.verification import verify  # noqa: PLC0415

        answer = verify(task)
    else:
        from pretouch.designs import pareto  # noqa: PLC0415

        answer = pareto(task)
    sender.send(("progress", "drawing the report"))
    from pretouch.report import write_report  # noqa: PLC0415

    notes: list[str] = []
    try:
        write_report(
            answer,
            folder / "report.html",
            calibration=task.calibration,
            subtracted_offset=task.subtracted_offset,
            source=task.source,
            warn=notes.append,
        )
    except Exception as error:
        notes.append(caution("PT423", f"The report was not written. The reason is: {type(error).__name__}: {error}"))
    text = "\n\n".join([str(answer), *notes])
    return {"headline": answer.headline, "text": text, "json": json.loads(as_json(answer.to_dict()))}


def _sweep(task: Any, sender: Connection) -> dict[str, Any]:
    """Compute contacts or optimal gains for many object velocities.

    Returns:
        The result for velocities of 0.25 to 2 times the velocity in the scenario.
    """
    import numpy as np  # noqa: PLC0415

    from pretouch.sweeps import sweep  # noqa: PLC0415

    speed = float(task.scenario.obstacle.velocity)
    values = speed * np.linspace(2.0, 0.25, 36)
    dataset = sweep(
        task,
        {"obstacle.velocity": values},
        progress=lambda p: sender.send(("progress", f"{p.finished} of {p.total} encounters")),
    )
    names = [str(name) for name in dataset.data_vars]
    columns = {name: np.asarray(dataset[name]).astype(float).tolist() for name in names if dataset[name].ndim == 1}
    lines = [f"{'velocity [m/s]':>16} " + " ".join(f"{name:>18}" for name in columns)]
    lines += [
        f"{v:16.4g} " + " ".join(f"{column[i]:18.6g}" for column in columns.values()) for i, v in enumerate(values)
    ]
    headline = f"Sweep over {len(values)} velocities of the object, from {values[0]:.3g} m/s to {values[-1]:.3g} m/s."
    columns = {"obstacle.velocity": values.tolist(), **columns}
    return {"headline": headline, "text": "\n".join(lines), "json": json.loads(as_json(columns))}


def _export(task: Any, folder: Path) -> dict[str, Any]:
    """Verify a control law, and export its C code as ZIP."""
    from datetime import UTC, datetime  # noqa: PLC0415

    from pretouch.exports import export  # noqa: PLC0415

    result = export(task, folder / "law", "c", verify=True, date=datetime.now(UTC).date().isoformat())
    if result.is_written:
        with zipfile.ZipFile(folder / "export.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            for path in sorted((folder / "law").rglob("*")):
                archive.write(path, path.relative_to(folder))
    headline = result.headline.replace(f"{folder}/", "")
    return {"headline": headline, "text": str(result).replace(f"{folder}/", ""), "json": {"written": result.is_written}}
