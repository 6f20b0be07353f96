"""The commands of CodeBotler and their options; longer commands have modules of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from codebotler.cli import options
from codebotler.cli.ending import obey
from codebotler.core.terminal import note, noting_all, print_text

app = options.command_line(
    "codebotler", "Turn instructions into robot programs, check them, and run them on robots."
)


@app.command()
def generate(
    instruction: Annotated[str, typer.Argument(help="What the robot should do, in plain words.")],
    model: options.ModelOption = None,
    world: options.WorldOption = None,
    retries: Annotated[
        int | None, typer.Option(min=0, help="How many times to ask again if the check finds problems.")
    ] = None,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair",
            help="When asking again, show the rejected program and its problems; once by default.",
        ),
    ] = False,
    record: Annotated[
        Path | None, typer.Option(help="Add a line of JSON for every attempt to this file.")
    ] = None,
    show_prompt: Annotated[
        bool, typer.Option("--show-prompt", help="Print the prompt without asking a model.")
    ] = False,
    temperature: options.TemperatureOption = 0.2,
    top_p: options.TopPOption = 0.95,
    max_tokens: options.MaxTokensOption = 512,
    seed: options.SeedOption = None,
    timeout: options.TimeoutOption = 60.0,
    base_url: options.BaseUrlOption = None,
    rules: options.RulesOption = None,
    skills: options.SkillsOption = None,
) -> None:
    """Have a model write a program, and print it.

    The exit status is 1 if the check finds problems.
    """
    from codebotler.cli.generate import show, write
    from codebotler.cli.rules import rules_for
    from codebotler.core.skills.files import skills_from
    from codebotler.core.world import World
    from codebotler.models.base import SamplingSettings
    from codebotler.models.chosen import chosen_model
    from codebotler.prompts import prompt_for

    chosen = chosen_model(model, base_url)
    table = skills_from(*(skills or ()))
    known = None if world is None else World.read(world, table)
    house_rules = rules_for(known, rules, table)
    prompt = prompt_for(
        instruction,
        skills=table,
        rooms=() if known is None else [room.name for room in known.rooms],
        rules=[rule.says for rule in house_rules],
    )
    if show_prompt:
        show(prompt, chosen.name)
        return
    settings = SamplingSettings(temperature, top_p, max_tokens, seed, timeout, chosen.base_url)
    tries = int(repair) if retries is None else retries
    accepted = write(
        prompt,
        chosen.name,
        settings,
        world=known,
        house_rules=house_rules,
        skills=table,
        retries=tries,
        repair=repair,
        record=record,
    )
    raise typer.Exit(0 if accepted else 1)


@app.command()
def check(
    program: Annotated[str, typer.Argument(help="A file, or - for a program or a reply on standard input.")],
    world: options.WorldOption = None,
    samples: Annotated[
        int, typer.Option(min=1, max=10_000, help="How many imagined worlds to run it in.")
    ] = 5,
    seed: Annotated[int, typer.Option(help="The random seed of the imagined worlds.")] = 0,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Do not assume that people and objects are there unless the program has looked for them.",
        ),
    ] = False,
    shows_all: options.AllOption = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
    workers: Annotated[int, typer.Option(min=1, help="How many programs to run at the same time.")] = 1,
    rules: options.RulesOption = None,
    skills: options.SkillsOption = None,
) -> None:
    """Look for problems in a program before a robot runs it.

    It reads the program and runs it in imagined worlds. The exit status is 1 if there are problems.
    """
    from codebotler.checking import check
    from codebotler.cli.check import check_view, read_program
    from codebotler.cli.rules import rules_for
    from codebotler.core.skills.files import skills_from
    from codebotler.core.terminal import busy, print_json, print_rich
    from codebotler.core.world import World

    table = skills_from(*(skills or ()))
    known = None if world is None else World.read(world, table)
    house_rules = rules_for(known, rules, table)
    source = read_program(program)
    with busy("checking"):
        found = check.check(
            source,
            rooms=None if known is None else [room.name for room in known.rooms],
            start=None if known is None else known.robot,
            samples=samples,
            seed=seed,
            strict=strict,
            workers=workers,
            skills=table,
            house_rules=house_rules,
        )
    if json:
        print_json(found.data(table))
    else:
        name = "the program" if program == "-" else program
        print_rich(check_view(found, source, name, shows_all=shows_all))
    raise typer.Exit(1 if found.problems else 0)


@app.command()
def rules(
    file: Annotated[Path, typer.Argument(help="A file of house rules.")],
    world: options.WorldOption = None,
    skills: options.SkillsOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """Show house rules with examples, and what is odd about them.

    For each rule, it finds a shortest example that keeps it and one that breaks it.
    """
    from codebotler.checking.rule_review import reviewed
    from codebotler.checking.rules import read_rules
    from codebotler.cli.rules import review_data, review_view
    from codebotler.core.skills.files import skills_from
    from codebotler.core.terminal import busy, print_json, print_rich
    from codebotler.core.world import World

    table = skills_from(*(skills or ()))
    house_rules = read_rules(file, table)
    known = None if world is None else World.read(world, table)
    with busy("looking for examples"):
        found = reviewed(house_rules, known)
    if json:
        print_json(review_data(found))
    else:
        print_rich(review_view(found))


@app.command()
def skills(
    file: Annotated[
        Path | None, typer.Argument(help="A Python file of your own skills, which is run.")
    ] = None,
    new: Annotated[
        Path | None, typer.Option("--new", help="Write a commented start of such a file.", metavar="FILE")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """Show skills as models see them, and try them.

    Each example is called in 40 imagined worlds.
    """
    from codebotler.cli.skills import data, view, write_new
    from codebotler.core.skills.files import skills_from
    from codebotler.core.terminal import print_json, print_rich

    if new is not None:
        write_new(new)
        note(f"{new} is written; `codebotler skills {new}` shows what is in it")
        return
    table = skills_from(*([] if file is None else [file]))
    if json:
        print_json(data(table))
    else:
        print_rich(view(table))


@app.command()
def run(
    program: Annotated[
        str,
        typer.Argument(
            metavar="PROGRAM|INSTRUCTION", help="A program file, - for standard input, or an instruction."
        ),
    ],
    robot: options.RobotOption = "sim",
    world: Annotated[
        Path | None,
        typer.Option(help="The world file of a simulated robot; by default an office for --robot sim."),
    ] = None,
    model: options.ModelOption = None,
    base_url: options.BaseUrlOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Run the program without asking.")] = False,
    despite_problems: Annotated[
        bool, typer.Option("--despite-problems", help="Run it even if the check finds problems.")
    ] = False,
    shows_all: options.AllOption = False,
    speed: options.SpeedOption = 1.0,
    address: options.AddressOption = "",
    ros_python: options.RosPythonOption = options.ROS_PYTHON,
    rules: options.RulesOption = None,
    skills: options.SkillsOption = None,
) -> None:
    """Check a program, ask for approval, and run it on a robot.

    Ctrl-C stops the robot; the exit status is then 130.
    """
    from codebotler.checking.rules import read_rules
    from codebotler.cli import run
    from codebotler.cli.run import Request
    from codebotler.core.files import home
    from codebotler.core.skills.files import skills_from
    from codebotler.core.world import World
    from codebotler.models.base import SamplingSettings
    from codebotler.models.chosen import chosen_model
    from codebotler.models.open import open_model
    from codebotler.robots.base import Options
    from codebotler.robots.open import open_robot

    chosen = chosen_model(model, base_url)
    table = skills_from(*(skills or ()))
    house_rules = () if rules is None else read_rules(rules, table)
    request = Request(program, chosen.name, yes, despite_problems, shows_all, house_rules)
    asked = SamplingSettings(base_url=chosen.base_url)
    world = options.world_or_office(robot, world)
    settings = Options(
        world=None if world is None else World.read(world, table),
        speed=speed or None,
        address=address,
        ros_python=ros_python,
        skills=table,
    )
    body = open_robot(robot, settings)
    raise typer.Exit(run.run(body, request, home(), lambda name: open_model(name, asked)))


@app.command()
def missions(
    mission: Annotated[
        str | None, typer.Argument(metavar="ID", help="Show this one; `last` is the last one.")
    ] = None,
    mcap: Annotated[
        Path | None, typer.Option(help="Write the mission and its program to this MCAP file, for Foxglove.")
    ] = None,
    clock: Annotated[str, typer.Option(help="With --mcap: wall, or robot for simulated time.")] = "wall",
    skills: options.SkillsOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List past missions, or show what happened in one."""
    from codebotler.cli.missions import show_mission, show_missions, write_mission
    from codebotler.core.errors import UserError
    from codebotler.core.files import home
    from codebotler.core.skills.files import skills_from

    if mcap is not None and mission is None:
        raise UserError("--mcap writes one mission; name it, or `last`")
    if mcap is not None and json:
        raise UserError("--mcap and --json exclude each other; give one of them")
    if clock not in {"wall", "robot"}:
        raise UserError(f'unknown clock "{clock}"; use wall or robot')
    table = skills_from(*(skills or ()))
    if mission is None:
        show_missions(home(), json=json)
    elif mcap is None:
        show_mission(home(), mission, json=json)
    else:
        write_mission(home(), mission, mcap, clock="robot" if clock == "robot" else "wall", skills=table)


@app.command()
def models(
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List the models that you can use here.

    It looks for keys in the environment, and for model servers on this machine.
    """
    from dataclasses import asdict

    from codebotler.cli.views import models_view
    from codebotler.core.terminal import print_json, print_rich
    from codebotler.models.chosen import chosen_model
    from codebotler.models.usable import usable_models

    found = usable_models()
    if json:
        print_json([asdict(model) for model in found])
    else:
        print_rich(models_view(found, chosen_model()))


@app.command()
def robots(
    ros_python: options.RosPythonOption = options.ROS_PYTHON,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List the kinds of robots, and which of them work here.

    For the others, it shows what is missing and how to install it.
    """
    from dataclasses import asdict

    from codebotler.cli.views import robots_view
    from codebotler.core.terminal import print_json, print_rich
    from codebotler.robots.open import all_readiness

    found = all_readiness(ros_python)
    if json:
        print_json([asdict(kind) for kind in found])
    else:
        print_rich(robots_view(found))


@app.command("serve")
def serve_page(
    host: options.HostOption = "127.0.0.1",
    port: options.PortOption = None,
    name: options.NameOption = None,
    token: options.TokenOption = None,
    no_token: options.NoTokenOption = False,
    robot: options.RobotOption = "sim",
    world: Annotated[
        Path | None,
        typer.Option(
            help="The world file, for the robot and for the map; by default an office for --robot sim."
        ),
    ] = None,
    model: Annotated[
        list[str] | None, typer.Option(help="A model that may write programs; may be given several times.")
    ] = None,
    base_url: options.BaseUrlOption = None,
    speed: options.SpeedOption = 1.0,
    address: options.AddressOption = "",
    ros_python: options.RosPythonOption = options.ROS_PYTHON,
    face: Annotated[
        bool, typer.Option("--face", help="Have the robot speak and ask on a page of its own, /face.")
    ] = False,
    face_timeout: Annotated[
        float, typer.Option(min=1, help="Seconds that people have to answer there.")
    ] = 60.0,
    face_token: Annotated[
        str | None, typer.Option(help="The token that opens the face; a new one by default.")
    ] = None,
    stop_when_alone: Annotated[
        float | None,
        typer.Option(min=1, help="Stop the robot this many seconds after the last page is closed."),
    ] = None,
    runs: Annotated[Path, typer.Option(help="The folder of runs of the benchmark.")] = Path("runs"),
    rules: options.RulesOption = None,
    skills: options.SkillsOption = None,
) -> None:
    """Serve the web page for operating a robot.

    Ctrl-C ends it, which also stops the robot.
    """
    from codebotler.checking.rules import read_rules
    from codebotler.cli.serve import opener, serve
    from codebotler.core.skills.files import skills_from
    from codebotler.core.world import World
    from codebotler.models.chosen import chosen_model
    from codebotler.robots.base import Options
    from codebotler.robots.face import Face
    from codebotler.web.access import Access, Place

    table = skills_from(*(skills or ()))
    house_rules = () if rules is None else read_rules(rules, table)
    place = Place(host, port, tuple(name or ()))
    access = Access.asked_for(token, face_token, open_to_all=no_token, is_loopback=place.is_loopback)
    world = options.world_or_office(robot, world)
    known = None if world is None else World.read(world, table)
    models = tuple(model or dict.fromkeys((chosen_model().name, "recorded:careful", "recorded:hasty")))
    settings = Options(known, speed or None, address, ros_python, table)
    shown = Face(face_timeout) if face else None
    named = robot, settings, models, opener(models, base_url)
    serve(*named, place, access, runs, face=shown, rules=house_rules, alone_for=stop_when_alone)


@app.command("virtual-robot")
def virtual_robot(
    world: Annotated[Path, typer.Option(help="The world file in which the robot lives.")],
    port: Annotated[
        int | None,
        typer.Option(
            min=1, max=65535, help="The port of the ROS master; by default from ROS_MASTER_URI, or 11311."
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(help="The speed of the robot's clock as a multiple of real time, such as 20.")
    ] = 1.0,
    ros_python: Annotated[
        Path, typer.Option(help="The Python that has rospy, actionlib and rosmaster.")
    ] = options.ROS_PYTHON,
    skills: options.SkillsOption = None,
) -> None:
    """Offer a simulated robot's skills on ROS 1.

    It starts a ROS master if none answers; Ctrl-C ends it.
    """
    from contextlib import suppress

    from codebotler.core.skills.files import skills_from
    from codebotler.core.world import World
    from codebotler.robots.ros.virtual import VirtualRobot

    def show(line: str) -> None:
        with suppress(OSError):  # the robot goes on where nobody reads any more
            print_text(line)

    table = skills_from(*(skills or ()))
    known = World.read(world, table)
    robot = VirtualRobot(known, speed=speed, port=port, python=ros_python, show=show, skills=table)
    try:
        started = robot.start()
        what = "a ROS master was started" if started else "joined the ROS master"
        note(f"{what} at {robot.address}; the robot is ready, Ctrl-C ends it")
        robot.wait()
    finally:
        robot.stop()


def main() -> None:
    """Run the command line."""
    with noting_all():
        obey(app, "codebotler")


if __name__ == "__main__":
    main()
