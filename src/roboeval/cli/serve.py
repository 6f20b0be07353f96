"""The command that shows runs in a browser: serve."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from codebotler.options import HostOption, NameOption, NoTokenOption, PortOption, TokenOption
from roboeval.cli.options import load


def serve(
    runs: Annotated[Path, typer.Argument(help="A folder of runs, or one run.")] = Path("runs"),
    host: HostOption = "127.0.0.1",
    port: PortOption = 8080,
    name: NameOption = None,
    token: TokenOption = None,
    no_token: NoTokenOption = False,
    suite: Annotated[
        list[str] | None,
        typer.Option(help="The folder of a suite by which runs were judged; more than one may be named."),
    ] = None,
) -> None:
    """Show runs in a browser.

    They are shown side by side, and each completion by itself, until Ctrl-C. It needs no robot.
    """
    from codebotler.badinput import BadInput
    from codebotler.web.place import entrance
    from codebotler.web.serving import serve as serve_page
    from roboeval.cli.output import note
    from roboeval.web.pages import pages
    from roboeval.web.run_store import RunStore

    place, access = entrance(host, port, name or (), token, no_token=no_token)
    if not runs.is_dir():
        raise BadInput("there is no such folder; `roboeval run` makes the first run in runs/", file=runs)
    suites = [load(each) for each in suite or ()]
    if not RunStore(runs).names():
        note(f"{runs} holds no run yet; those that come are shown, too")
    serve_page(None, place, access, (pages(suites),), runs)
