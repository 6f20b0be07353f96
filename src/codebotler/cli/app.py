"""The commands that work with programs, and the list of all commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from codebotler.cli import options
from codebotler.cli.ending import run_command_line
from codebotler.cli.model_options import inherit_options, model_settings
from codebotler.cli.operating.commands import (
    connect,
    continue_mission,
    missions,
    robots,
    run,
    serve_page,
    virtual_robot,
)
from codebotler.cli.operating.mcp import serve_agents
from codebotler.core.terminal import is_interactive, note, read_line, report_problems


@inherit_options(model_settings)
def generate(
    instruction: Annotated[str, typer.Argument(help="The robot's task, in plain words.")],
    model: options.ModelOption = None,
    world: options.WorldOption = None,
    retries: options.RetriesOption = None,
    repair: options.RepairOption = False,
    candidates: options.CandidatesOption = 1,
    show_prompt: options.ShowPromptOption = False,
    base_url: options.BaseUrlOption = None,
    rules: options.RulesOption = None,
    skills: options.SkillsOption = None,
    **sampling: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Have a model write a program, check it, and print it.

    The exit status is 1 if the check finds problems.
    """
    from functools import partial

    from codebotler.checking.sampled import CheckSettings
    from codebotler.cli.programs import generate as programs
    from codebotler.cli.programs.rules import rules_for
    from codebotler.core.errors import UserError
    from codebotler.core.skills.files import skills_from
    from codebotler.core.world_file import read_world
    from codebotler.missions.preflight import suggesting_here
    from codebotler.models.open import choose_model, open_model
    from codebotler.prompts import prompt_for
    from codebotler.simulator.worlds.room_map import RoomMap

    chosen = choose_model(model, base_url)
    settings = chosen.add_server(model_settings(**sampling))
    table = skills_from(*(skills or ()))
    known = None if world is None else read_world(world, table)
    house_rules = rules_for(known, rules, table)
    room_map = None if known is None else RoomMap.of(known)
    sentences, rooms = [rule.says for rule in house_rules], () if room_map is None else room_map.described
    make_prompt = partial(prompt_for, rooms=rooms, rules=sentences, skills=table)
    if show_prompt:
        programs.print_prompt(make_prompt(instruction), chosen.name)
        return
    if candidates > 1 and (repair or retries is not None):
        raise UserError("--candidates cannot be combined with --retries or --repair; leave out one")
    how = CheckSettings(skills=table, house_rules=house_rules)
    with suggesting_here(room_map):
        if candidates > 1:
            given = (lambda: open_model(chosen.name, settings)), make_prompt, instruction, how, room_map
            ask = read_line if is_interactive() else None
            program = programs.choose_candidate(*given, count=candidates, ask=ask)
            accepted = program is not None and programs.print_checked(program, how, room_map)
        else:
            tries, prompt = int(repair) if retries is None else retries, make_prompt(instruction)
            accepted = programs.write(
                prompt, chosen.name, settings, how, room_map, retries=tries, repair=repair
            )
    raise typer.Exit(0 if accepted else 1)


def check(
    program: Annotated[
        str, typer.Argument(help="A program file, or - for standard input, which may be a model's reply.")
    ],
    world: options.WorldOption = None,
    connect: options.ConnectOption = None,
    samples: options.SamplesOption = 5,
    seed: Annotated[int, typer.Option(help="The random seed of the imagined worlds.")] = 0,
    strict: options.StrictOption = False,
    shows_all: options.AllOption = False,
    contract: options.ContractOption = False,
    save_contract: options.SaveContractOption = None,
    within: options.WithinOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
    rules: options.RulesOption = None,
    skills: options.SkillsOption = None,
) -> None:
    """Look for problems in a program before a robot runs it.

    The check runs the program in imagined worlds. The exit status is 1 if there are problems.
    """
    from codebotler.checking import check
    from codebotler.checking.check import with_contract_problems
    from codebotler.cli.programs.check import check_view, contract_view, read_program, write_contract
    from codebotler.cli.programs.rules import rules_for
    from codebotler.core.skills.files import skills_from
    from codebotler.core.terminal import busy, print_found, print_rich
    from codebotler.simulator.pool import WorkerPool
    from codebotler.simulator.worlds.room_map import RoomMap

    table = skills_from(*(skills or ()))
    _, connection = options.read_connect_option(connect, None, table)
    table = table if connection is None else connection.skills(table)
    known = options.read_world("", world, table, connection)
    house_rules = rules_for(known, rules, table)
    source, allowed = read_program(program), options.read_within(within, table)
    room_map = None if known is None else (RoomMap.of_places if world is None else RoomMap.of)(known)
    with busy("checking"), WorkerPool(1) as pool:
        found = check.check(
            source,
            room_map=room_map,
            samples=samples,
            seed=seed,
            strict=strict,
            skills=table,
            pool=pool,
            house_rules=house_rules,
            explores=contract or bool(house_rules) or save_contract is not None or within is not None,
        )
    found = found if allowed is None else with_contract_problems(found, allowed, table)
    write_contract(save_contract, found.contract)
    name = "the program" if program == "-" else program
    print_found(
        lambda: check_view(found, source, name, shows_all=shows_all),
        lambda: found.data(table),
        as_json=json,
    )
    if contract and found.contract is not None and not json:
        print_rich(contract_view(found.contract, table))
    raise typer.Exit(1 if found.problems else 0)


def rules(
    file: Annotated[Path, typer.Argument(help="A file of house rules.")],
    world: options.WorldOption = None,
    skills: options.SkillsOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """Show house rules with examples and likely mistakes.

    For each rule, it shows a short example that keeps the rule and one that breaks it.
    """
    from codebotler.checking.house_rules.file import read_rules
    from codebotler.checking.house_rules.review import review_rules
    from codebotler.checking.house_rules.rooms import find_evasions
    from codebotler.cli.programs.rules import review_data, review_view, rooms_of
    from codebotler.core.skills.files import skills_from
    from codebotler.core.terminal import busy, print_found
    from codebotler.core.world_file import read_world

    table = skills_from(*(skills or ()))
    house_rules = read_rules(file, table)
    known = None if world is None else read_world(world, table)
    for sentence in find_evasions(house_rules, rooms_of(known), table):
        note(sentence)
    if any(rule.names_destination for rule in house_rules) and not any(rule.inside for rule in house_rules):
        note("goto covers destinations only; to keep the robot from driving through a room, use inside")
    with busy("looking for examples"):
        found = review_rules(house_rules, known)
    print_found(lambda: review_view(found), lambda: review_data(found), as_json=json)


def replay(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE", help="Programs (.py), logs (.jsonl), missions, or folders of these."),
    ],
    rules: options.RulesOption,
    world: options.WorldOption = None,
    skills: options.SkillsOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """Show which programs and logs house rules would stop.

    Each program runs once, in the world of --world or in an imagined world. Logs are only read.
    """
    from codebotler.cli.programs.replay import find_replayed_files, replay, replay_data, replay_view
    from codebotler.cli.programs.rules import rules_for
    from codebotler.core.skills.files import skills_from
    from codebotler.core.terminal import busy, print_found
    from codebotler.core.text.words import counted
    from codebotler.core.world_file import read_world

    table = skills_from(*(skills or ()))
    known = None if world is None else read_world(world, table)
    house_rules = rules_for(known, rules, table)
    found = find_replayed_files(files)
    with busy(f"replaying {counted(len(found), 'file')}"):
        effects = replay(found, house_rules, known, table)
    print_found(
        lambda: replay_view(effects, house_rules), lambda: replay_data(effects, house_rules), as_json=json
    )


def skills(
    file: Annotated[
        Path | None, typer.Argument(help="A Python file with your own skills; it is executed.")
    ] = None,
    new: Annotated[
        Path | None, typer.Option("--new", help="Write a template for a skills file.", metavar="FILE")
    ] = None,
    ros_package: Annotated[
        Path | None,
        typer.Option(
            "--ros-package",
            help="Write the skills' actions as ROS 2 packages into this folder.",
            metavar="FOLDER",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """Show skills as models see them, and try them out.

    The example of each skill is called in 40 imagined worlds.
    """
    from codebotler.cli.programs.skills import SKILLS_TEMPLATE, skills_data, skills_view, write_new
    from codebotler.core.skills.files import skills_from
    from codebotler.core.skills.ros_package import write_ros_packages
    from codebotler.core.terminal import print_found

    if new is not None:
        write_new(new, SKILLS_TEMPLATE.replace("NAME", str(new)))
        note(f"wrote {new}; `codebotler skills {new}` shows its skills")
        return
    table = skills_from(*([] if file is None else [file]))
    if ros_package is not None:
        written = write_ros_packages(table, ros_package)
        note(f"wrote {', '.join(map(str, written))}; build them with colcon")
    else:
        print_found(lambda: skills_view(table), lambda: skills_data(table), as_json=json)


def models(
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List the models that you can use now.

    The list depends on API keys in the environment and on model servers on this machine.
    """
    from dataclasses import asdict

    from codebotler.cli.views import models_view
    from codebotler.core.terminal import print_found
    from codebotler.models.open import choose_model
    from codebotler.models.usable import find_usable_models

    found = find_usable_models()
    print_found(lambda: models_view(found, choose_model()), lambda: list(map(asdict, found)), as_json=json)


app = options.command_line(
    "codebotler", "Turn instructions into robot programs, check them, and run them on robots."
)
for command in (generate, check, rules, replay, skills, run, missions, models, robots, connect):
    app.command()(command)
app.command("continue")(continue_mission)
app.command("serve")(serve_page)
app.command("virtual-robot")(virtual_robot)
app.command("mcp")(serve_agents)


def main() -> None:
    """Run the command line of CodeBotler."""
    with report_problems():
        run_command_line(app, "codebotler")


if __name__ == "__main__":
    main()
