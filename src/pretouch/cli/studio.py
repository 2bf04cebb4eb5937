"""Implement the command `pretouch studio` for the interactive web page."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from .terminal import conclude, option, print_text
from .verbs import refuse_existing


def studio(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="Scenario file (TOML) to open.")] = None,
    *,
    port: Annotated[int, option("NUMBER", "Port on 127.0.0.1; by default a free one.", min=0, max=65535)] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the address, and open no browser.")] = False,
    output: Annotated[
        Path | None,
        option("PATH", "Write the page to this HTML file instead, which works without a server and without pretouch."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only a JSON object.")] = False,
) -> None:
    """Choose a gain in the browser, by dragging the gain or any input with the mouse.

    Serves a page on 127.0.0.1 that computes the motion while you drag, and asks this program for fits, simulations with
    noise, verification and exports. Ends with Ctrl+C. This command needs more libraries: pip install
    'pretouch[studio]'. With --output, writes the page with the scenario of FILE to an HTML file, without these parts.

    Exit status: 0 ended, or the page is written, 2 a mistake in the request.
    """
    conclude(
        partial(_studio, file, port, browser=not no_browser, output=output, force=force, json=json), json_wanted=json
    )


def _studio(file: Path | None, port: int, *, browser: bool, output: Path | None, force: bool, json: bool) -> None:
    """Serve the studio's web page, or write it to a file."""
    from pretouch._core.files import as_json, refuse_input, write_text  # noqa: PLC0415 - keeps `pretouch --help` quick

    if output is not None:
        from pretouch.studio.page_file import page_text  # noqa: PLC0415
        from pretouch.studio.page_scenario import scenario_of_page  # noqa: PLC0415

        refuse_existing(output, force=force)
        if file is not None:
            refuse_input(output, [file])
        scenario = None if file is None else scenario_of_page(file)
        write_text(output, page_text(scenario=scenario), overwrite=force)
        print_text(as_json({"status": "written", "page": str(output)}) if json else f"Page: {output}")
        return
    from pretouch.studio.serve import serve_studio  # noqa: PLC0415

    def announce(address: str) -> None:
        shown = as_json({"status": "serving", "address": address})
        print_text(shown if json else f"Studio: {address}\nStop it with Ctrl+C.")

    serve_studio(file, port=port, open_browser=browser, announce=announce)
