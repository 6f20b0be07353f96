"""The commands for operating a robot: run, continue, missions, robots, connect, serve and virtual-robot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from codebotler.cli import options
from codebotler.cli.model_options import inherit_options, model_settings
from codebotler.core.terminal import note, print_text

if TYPE_CHECKING:
    from codebotler.cli.operating.run import Request
    from codebotler.web.console import Console


class RunSettings(NamedTuple):
    """The functions with which the commands `run` and `continue` create the request and the console."""

    request: Callable[..., Request]  # takes the other fields of a request
    open_console: Callable[..., Console]


@inherit_options(options.robot_settings)
@inherit_options(model_settings)
def run_settings(
    model: options.ModelOption = None,
    base_url: options.BaseUrlOption = None,
    yes: options.YesOption = False,
    despite_problems: options.DespiteProblemsOption = False,
    shows_all: options.AllOption = False,
    recover: options.RecoverOption = 0,
    **shared: Any,  # noqa: ANN401 - of several kinds
) -> RunSettings:
    """Turn the options shared by `run` and `continue` into functions that create the request and console."""
    from functools import partial

    from codebotler.cli.operating.run import Request
    from codebotler.cli.operating.serving import open_console
    from codebotler.models.open import choose_model

    request = partial(Request, yes=yes, despite_problems=despite_problems, shows_all=shows_all)
    models = [choose_model(model, base_url).name]
    return RunSettings(partial(request, recoveries=recover), partial(open_console, models, base_url, shared))


@inherit_options(run_settings)
def run(
    program: Annotated[
        str,
        typer.Argument(
            metavar="PROGRAM|INSTRUCTION", help="A program file, - for standard input, or an instruction."
        ),
    ],
    candidates: options.CandidatesOption = 1,
    **shared: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Check a program, ask for approval, and run it on a robot.

    Ctrl-C stops the robot, and the exit status is then 130.
    """
    from codebotler.cli.operating.run import end_at_signals, run

    request, open_console = run_settings(**shared)
    wanted = request(program, candidates=candidates)
    end_at_signals()
    with open_console(candidates=candidates) as console:
        raise typer.Exit(run(console, wanted))


@inherit_options(run_settings)
def continue_mission(
    mission: Annotated[
        str, typer.Argument(metavar="[ID]", help="The mission; by default the most recent one.")
    ] = "last",
    program: Annotated[
        str, typer.Argument(metavar="[PROGRAM]", help="A program for the rest; by default a model writes it.")
    ] = "",
    **shared: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Do the rest of a mission that ended early.

    A model is shown what the robot did and saw, and writes a program for the rest.
    """
    from codebotler.cli.operating.run import choose_past, end_at_signals, run

    request, open_console = run_settings(**shared)
    end_at_signals()
    with open_console() as console:
        past = choose_past(console, mission, program)
        raise typer.Exit(run(console, request(program or past.instruction, past=past)))


def missions(
    mission: Annotated[
        str | None, typer.Argument(metavar="ID", help="The mission to show; `last` for the most recent.")
    ] = None,
    mcap: Annotated[
        Path | None, typer.Option(help="Write the mission, or the last one, to an MCAP file for Foxglove.")
    ] = None,
    clock: Annotated[
        str, typer.Option(help="The time for --mcap: wall, or robot for simulated time.")
    ] = "wall",
    skills: options.SkillsOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List past missions, or show what happened in one."""
    from dataclasses import asdict

    from codebotler.cli.views import list_view, mission_view
    from codebotler.core.errors import UserError
    from codebotler.core.files import home
    from codebotler.core.skills.files import skills_from
    from codebotler.core.terminal import print_found
    from codebotler.missions.storage import store
    from codebotler.missions.storage.log import LogLine, MissionSummary, read_events

    if clock not in {"wall", "robot"}:
        raise UserError(f'unknown clock "{clock}"; use wall or robot')

    skills_from(*(skills or ()))  # registers the verbs that describe the skills
    store.recover_missions(home())
    if mission is None and mcap is None:
        known = store.read_missions(home())
        print_found(lambda: list_view(known), lambda: list(map(asdict, known)), as_json=json)
        return

    def read() -> tuple[Path, MissionSummary, list[LogLine]]:
        folder = store.find_mission(home(), mission or "last")
        return folder, MissionSummary.read(folder), read_events(folder)

    if mcap is not None:
        from codebotler.missions.storage.mcap import export_mcap

        folder, summary, events = read()  # only if the extra is there
        export_mcap(mcap, summary, events, "robot" if clock == "robot" else "wall", folder)
        note(f"wrote {len(events):,} events of mission {summary.id} to {mcap}")
        return
    folder, summary, events = read()
    data = {**asdict(summary), "events": events}
    print_found(lambda: mission_view(summary, events, store.find_rest(folder)), lambda: data, as_json=json)


def robots(
    ros_python: options.RosPythonOption = options.DEFAULT_ROS_PYTHON,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List the kinds of robots, and which of them work here.

    For the others, it shows what is missing and how to install it.
    """
    from dataclasses import asdict

    from codebotler.cli.views import robots_view
    from codebotler.core.terminal import print_found
    from codebotler.robots.open import list_readiness

    found = list_readiness(ros_python)
    print_found(lambda: robots_view(found), lambda: list(map(asdict, found)), as_json=json)


def connect(
    discover: Annotated[
        bool, typer.Option("--discover", help="Explore what the robot's nodes offer.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Write the draft to a new file.", metavar="FILE")] = None,
    address: options.AddressOption = "",
    ros_python: options.RosPythonOption = options.DEFAULT_ROS_PYTHON,
) -> None:
    """Draft a file for --connect from a robot's nodes on ROS 2.

    Comments in the draft say what is left to decide, and what else the robot offers.
    """
    from codebotler.cli.programs.skills import write_new
    from codebotler.core.errors import UserError
    from codebotler.core.terminal import busy, print_source
    from codebotler.robots.ros.connections.discovery import discover_offers, draft_connection

    if not discover:
        raise UserError("add --discover to explore the robot and draft a file for --connect")
    with busy("exploring the robot"):
        text = draft_connection(discover_offers(address, ros_python))
    if out is None:
        print_source(text)
    else:
        write_new(out, text)
        note(f"wrote {out}; read it, and complete what its comments say")


@inherit_options(options.robot_settings)
@inherit_options(model_settings)
def serve_page(
    host: options.HostOption = "127.0.0.1",
    port: options.PortOption = None,
    name: options.NameOption = None,
    behind_proxy: options.BehindProxyOption = None,
    token: options.TokenOption = None,
    no_token: options.NoTokenOption = False,
    model: options.ModelsOption = None,
    base_url: options.BaseUrlOption = None,
    candidates: options.CandidatesOption = 1,
    face: Annotated[
        bool, typer.Option("--face", help="Let the robot speak and ask questions on a separate page, /face.")
    ] = False,
    face_timeout: options.FaceTimeoutOption = 60.0,
    face_token: Annotated[
        str | None,
        typer.Option(
            envvar="CODEBOTLER_FACE_TOKEN", help="The access token for the face; a new one by default."
        ),
    ] = None,
    stop_when_alone: Annotated[
        float | None,
        typer.Option(min=1, help="Stop the robot this many seconds after the last page is closed."),
    ] = None,
    runs: Annotated[Path, typer.Option(help="The folder that contains benchmark runs.")] = Path("runs"),
    recover: options.RecoverOption = 0,
    **shared: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Serve the web page for operating a robot.

    Ctrl-C ends the server and stops the robot.
    """
    from dataclasses import replace

    from codebotler.cli.operating.serving import open_console
    from codebotler.robots.face import Face
    from codebotler.web.frame import installed_pages
    from codebotler.web.security.access import Access, PageAddress, read_cookie_secret
    from codebotler.web.security.proxy import proxies_in_front
    from codebotler.web.server import serve

    place = PageAddress(host, port, tuple(name or ()), proxies_in_front(behind_proxy))
    access = Access.from_options(token, face_token, open_to_all=no_token, is_private=place.is_private)
    shown = Face(face_timeout) if face else None
    console = open_console(model, base_url, shared, candidates=candidates, face=shown, recoveries=recover)
    if face:  # its screen on the robot outlives a restart
        access = replace(access, cookie_secret=read_cookie_secret(console.home))
    serve(console, place, access, installed_pages(), runs, alone_for=stop_when_alone)


def virtual_robot(
    world: Annotated[Path, typer.Option(help="The world file for the simulated robot.")],
    ros: Annotated[int, typer.Option(min=1, max=2, help="The version of ROS.")] = 1,
    speed: Annotated[
        float, typer.Option(help="The speed of the robot's clock as a multiple of real time, such as 20.")
    ] = 1.0,
    ros_python: Annotated[
        Path, typer.Option(help="The Python that has rclpy, or rospy, actionlib and rosmaster.")
    ] = options.DEFAULT_ROS_PYTHON,
    skills: options.SkillsOption = None,
) -> None:
    """Offer a simulated robot's skills on ROS 1 or 2.

    On ROS 1, it starts a master if none responds at ROS_MASTER_URI. Ctrl-C ends the command.
    """
    from contextlib import suppress

    from codebotler.core.skills.files import skills_from
    from codebotler.core.world_file import read_world
    from codebotler.robots.ros.virtual import VirtualRobot

    def show(line: str) -> None:
        with suppress(OSError):  # the robot continues even if nobody reads its output any more
            print_text(line)

    table = skills_from(*(skills or ()))
    known = read_world(world, table)
    robot = VirtualRobot(known, speed=speed, ros=ros, python=ros_python, show=show, skills=table)
    try:
        started = robot.start()
        what = "a ROS master was started at" if started else "joined the ROS master at"
        what = what if ros == 1 else "joined the ROS 2 graph with ROS_DOMAIN_ID"
        note(f"{what} {robot.address}; the robot is ready, Ctrl-C ends it")
        robot.wait()
    finally:
        robot.stop()
