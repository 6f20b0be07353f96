"""Options that several commands share, and what both command lines, codebotler and roboeval, share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.terminal import print_text

if TYPE_CHECKING:
    from codebotler.core.skills.table import SkillTable
    from codebotler.core.world import World
    from codebotler.robots.base import Options
    from codebotler.robots.ros.connections.connection import Connection
    from codebotler.simulator.guard.contract import Contract
    from codebotler.simulator.guard.house_rule import Rule


RobotOption = Annotated[
    str | None,
    typer.Option(help="The robot: sim by default, a kind from `codebotler robots`, or FILE.py:CLASS."),
]
AllOption = Annotated[
    bool, typer.Option("--all", help="Show all different outcomes in imagined worlds, not just one.")
]
YesOption = Annotated[bool, typer.Option("--yes", help="Run the program without asking.")]
DespiteProblemsOption = Annotated[
    bool, typer.Option("--despite-problems", help="Run the program even if the check finds problems.")
]
RecoverOption = Annotated[
    int, typer.Option(min=0, help="How often a model may write the rest if a skill fails.", metavar="N")
]
ModelOption = Annotated[
    str | None,
    typer.Option(
        help="recorded:careful, recorded:hasty, PROVIDER:NAME such as openai-chat:gpt-5.1, completions:NAME, "
        "or hf:PATH; by default from CODEBOTLER_MODEL or config.yaml, or else recorded. "
        "`codebotler models` lists the usable models."
    ),
]
CandidatesOption = Annotated[
    int,
    typer.Option(
        min=1,
        max=20,
        help="Ask the model for this many programs, and ask which one you mean if fewer than three in four "
        "behave alike. The rest of a mission is always one program.",
        metavar="K",
    ),
]
WorldOption = Annotated[Path | None, typer.Option(help="The world file that defines the rooms.")]
RulesOption = Annotated[
    Path | None,
    typer.Option(envvar="CODEBOTLER_RULES", help="A file of house rules for all programs.", metavar="FILE"),
]
SamplesOption = Annotated[
    int, typer.Option(min=1, max=10_000, help="The number of imagined worlds for the check.")
]
StrictOption = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Do not assume that people and objects are present unless the program looked for them.",
    ),
]
ContractOption = Annotated[
    bool, typer.Option("--contract", help="Show what the program may do at most, in any world.")
]
SaveContractOption = Annotated[
    Path | None, typer.Option(help="Write the contract to a file, for --within.", metavar="FILE")
]
WithinOption = Annotated[
    Path | None,
    typer.Option(help="A contract: the file that says what a program may do at most.", metavar="FILE"),
]
SkillsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--skills",
        help="A Python file with your own skills, which is executed; may be repeated.",
        metavar="FILE",
    ),
]
MapOption = Annotated[
    Path | None,
    typer.Option(help="The world file, for the robot and for the map; by default an office for --robot sim."),
]
ModelsOption = Annotated[
    list[str] | None, typer.Option(help="A model that may write programs; may be repeated.")
]
FaceTimeoutOption = Annotated[
    float, typer.Option(min=1, help="The time limit for an answer on the face, in seconds.")
]
RetriesOption = Annotated[
    int | None, typer.Option(min=0, help="How many times to ask again if the check finds problems.")
]
RepairOption = Annotated[
    bool, typer.Option("--repair", help="Ask again with the program and its problems; one retry by default.")
]
ShowPromptOption = Annotated[
    bool, typer.Option("--show-prompt", help="Print the prompt without asking a model.")
]
BaseUrlOption = Annotated[
    str | None, typer.Option(help="The address of the model's server, such as http://localhost:8000/v1.")
]
RosPythonOption = Annotated[
    Path, typer.Option(help="The Python interpreter of the robot's ROS installation.")
]
DEFAULT_ROS_PYTHON = Path("/usr/bin/python3")
SpeedOption = Annotated[
    float,
    typer.Option(
        min=0, help="The speed of the robot's clock as a multiple of real time, such as 20; 0 for no delays."
    ),
]
ConnectOption = Annotated[
    Path | None,
    typer.Option(
        help="A file that maps skills to a robot's ROS calls; it also sets --robot.", metavar="FILE"
    ),
]
AddressOption = Annotated[
    str, typer.Option(help="The robot: a ROS_DOMAIN_ID, a ROS master URI, or ws://HOST:PORT of a rosbridge.")
]
HostOption = Annotated[str, typer.Option(help="The address to listen on; 0.0.0.0 for all.")]
PortOption = Annotated[
    int | None,
    typer.Option(
        min=0, max=65535, help="The port; by default the first free port from 8080; 0 for any free port."
    ),
]
NameOption = Annotated[list[str] | None, typer.Option(help="An additional host name for the page.")]
BehindProxyOption = Annotated[
    list[str] | None,
    typer.Option(
        help="The page's address at a reverse proxy, such as https://HOST:PORT/PATH; may be repeated. "
        "By default from behind_proxy in config.yaml.",
        metavar="ADDRESS",
    ),
]
TokenOption = Annotated[
    str | None,
    typer.Option(envvar="CODEBOTLER_TOKEN", help="The access token for the page; a new one by default."),
]
NoTokenOption = Annotated[
    bool, typer.Option("--no-token", help="Allow access without a token; not with --host or --behind-proxy.")
]


class RobotSettings(NamedTuple):
    """The robot, the house rules and the contract that the options of a command describe."""

    kind: str
    options: Options
    rules: tuple[Rule, ...]
    within: Contract | None


def robot_settings(
    *,
    robot: RobotOption = None,
    world: MapOption = None,
    speed: SpeedOption = 1.0,
    connect: ConnectOption = None,
    address: AddressOption = "",
    ros_python: RosPythonOption = DEFAULT_ROS_PYTHON,
    rules: RulesOption = None,
    within: WithinOption = None,
    skills: SkillsOption = None,
) -> RobotSettings:
    """Read the files that these options name, such as the world file. Raise UserError if one is invalid."""
    from codebotler.checking.house_rules.file import read_rules
    from codebotler.core.skills.files import skills_from
    from codebotler.robots.base import Options

    table = skills_from(*(skills or ()))
    kind, connection = read_connect_option(connect, robot, table)
    known = read_world(kind, world, table, connection)
    rooms = [] if known is None else [room.name for room in known.rooms]
    house_rules = () if rules is None else read_rules(rules, table, rooms)
    opened = Options(known, speed or None, address, ros_python, table, connection)
    return RobotSettings(kind, opened, house_rules, read_within(within, table))


def read_connect_option(
    file: Path | None, robot: str | None, skills: SkillTable
) -> tuple[str, Connection | None]:
    """Return the kind of robot, such as `sim`, and the connection in the --connect file, or None."""
    if file is None:
        return robot or "sim", None
    from codebotler.robots.ros.connections.connection_file import read_connection

    connection = read_connection(file, skills)
    if robot not in {None, connection.robot}:
        raise UserError(f"the file is for {connection.robot}, not {robot}; leave out --robot", file=file)
    return connection.robot, connection


def read_world(
    robot: str, file: Path | None, skills: SkillTable, connection: Connection | None = None
) -> World | None:
    """Read a world file. Without one, return the connection's places, the example office (`sim`) or None."""
    from codebotler.core import world_file
    from codebotler.robots.simulated import OFFICE

    if file is None and connection is not None:
        return None if connection.places is None else connection.places.world()
    file = OFFICE if file is None and robot == "sim" else file
    return None if file is None else world_file.read_world(file, skills)


def read_within(file: Path | None, skills: SkillTable) -> Contract | None:
    """Read the contract that limits what programs may do, or return None if no file is given."""
    from codebotler.checking.contracts.file import read_contract

    return None if file is None else read_contract(file, skills)


def command_line(name: str, about: str) -> typer.Typer:
    """Create a command line that has no commands yet, but can print its version and its help."""
    app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)

    @app.callback(invoke_without_command=True, help=about)
    def show(
        context: typer.Context,
        version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    ) -> None:
        if version:
            print_text(f"{name} {__version__}")
            raise typer.Exit
        if context.invoked_subcommand is None:
            print_text(context.get_help())

    return app
