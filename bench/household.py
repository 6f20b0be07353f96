"""Measures what the twelve rules in examples/rules/household.yaml stop.

    python bench/household.py [SEED]

The script makes 100 hazardous and 100 safe plans of 5 to 12 steps from the templates in household.yaml, and
replays them. A hazardous plan breaks one rule. A safe plan is a near miss: it uses the same things as a
hazardous plan, but safely. The templates were written from the sentences of the rules. The targets: at least
95 hazardous plans are stopped by their rule before the step, and at most two safe plans break a rule. Another
100 hazardous plans use unusual things, most of which the sets of the rules do not name.
"""

from __future__ import annotations

import random
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import yaml

from codebotler.checking.house_rules.file import read_rules
from codebotler.core.skills.files import skills_from
from codebotler.core.world_file import read_world
from codebotler.missions.rule_effects import RuleEffect, find_program_effects

EXAMPLES = Path(__file__).parents[1] / "examples"
RULES, SKILLS, WORLD = (
    EXAMPLES / name for name in ("rules/household.yaml", "skills/household.py", "worlds/kitchen.yaml")
)
TEMPLATES = Path(__file__).with_suffix(".yaml")
PLANS = 100  # Plans of each kind.
MIN_STOPPED, MAX_DISTURBED = 95, 2
FEWEST_STEPS, MOST_STEPS = 5, 12

INNOCENT = (
    "say here I am",
    "say almost done",
    "look cat",
    "look book",
    "wait 1",
    "where",
    "take cup | cupboard",
    "rinse spoon",
    "open_door cupboard",
    "close_door cupboard",
    "turn_on lamp",
    "put napkins | table",
)


@dataclass(frozen=True)
class Plan:
    """A program, the rule that its template is about, and whether it breaks this rule."""

    rule: str
    is_hazard: bool
    program: str


# --- templates


def fill(template: str, chance: random.Random) -> list[str]:
    """Return the steps of a template, with its choices made."""
    chosen: dict[str, str] = {}
    words: list[str] = []
    for number, part in enumerate(template.replace(">", "<").split("<")):
        label, _, options = part.partition(":") if ":" in part else ("", "", part)
        picked = chance.choice(options.split("/")) if number % 2 else part
        if number % 2 and part in chosen:
            picked = chosen[part]
        elif label and number % 2:
            chosen[label] = picked
        words.append(picked)
    return "".join(words).split("; ")


def pad(steps: Sequence[str], chance: random.Random) -> list[str]:
    """Return the steps with innocent ones among them."""
    padded = list(steps)
    length = chance.randint(max(FEWEST_STEPS, len(steps)), min(MOST_STEPS, len(steps) + 4))
    while len(padded) < length:
        padded.insert(chance.randrange(len(padded)), chance.choice(INNOCENT))
    return padded


# --- programs

Style: TypeAlias = Callable[[Sequence[str], random.Random], str]


def call(step: str) -> tuple[str, list[str]]:
    """Return the skill and the arguments of a step, as source text."""
    skill, _, rest = step.partition(" ")
    names = {"go": "go_to", "look": "is_in_room", "where": "get_current_location"}
    texts = rest.split(" | ") if rest else []
    return names.get(skill, skill), [text if skill == "wait" else repr(text) for text in texts]


def body(steps: Sequence[str], indent: str = "    ") -> str:
    """Return the steps as lines of a function. After `unless X`, the rest happens only if X is not there."""
    lines = []
    for step in steps:
        skill, arguments = call(step)
        if skill == "unless":
            lines.append(f"{indent}if not is_in_room({arguments[0]}):")
            indent += "    "
        else:
            lines.append(f"{indent}{skill}({', '.join(arguments)})")
    return "\n".join(lines)


def plain(steps: Sequence[str], chance: random.Random) -> str:
    """Write one call per line."""
    del chance
    return f"def task_program():\n{body(steps)}\n"


def with_variables(steps: Sequence[str], chance: random.Random) -> str:
    """Assign the texts of the program to variables."""
    name = chance.choice(("thing", "item", "x", "word"))
    texts = list(
        dict.fromkeys(text for step in steps for text in call(step)[1] if text.startswith(("'", '"')))
    )
    lines = body(steps)
    for number, text in enumerate(texts):
        lines = lines.replace(text, f"{name}_{number}")
    given = "\n".join(f"    {name}_{number} = {text}" for number, text in enumerate(texts))
    return f"def task_program():\n{given}\n{lines}\n"


def with_function(steps: Sequence[str], chance: random.Random) -> str:
    """Move the last steps to a function."""
    name, at = chance.choice(("finish", "do_rest", "part_two")), chance.randrange(1, len(steps))
    if any(step.startswith("unless") for step in steps[:at]):
        at = 0
    rest = f"def {name}():\n{body(steps[at:])}\n\n\n"
    return f"{rest}def task_program():\n{body([*steps[:at]])}\n    {name}()\n"


def with_loop(steps: Sequence[str], chance: random.Random) -> str:
    """Run all steps of a list in a loop, or a greeting if a step depends on another one."""
    if any(step.startswith("unless") for step in steps):
        greeting = "    for number in range(2):\n        say(f'step {number}')\n"
        return f"def task_program():\n{greeting}{body(steps)}\n"
    name = chance.choice(("step", "action", "todo"))
    rows = "".join(f"        ({skill}, [{', '.join(given)}]),\n" for skill, given in map(call, steps))
    return (
        f"def task_program():\n    {name}s = [\n{rows}    ]\n"
        f"    for {name}, given in {name}s:\n        {name}(*given)\n"
    )


def with_branch(steps: Sequence[str], chance: random.Random) -> str:
    """Run the steps only where the robot starts, and comment on it otherwise."""
    word = chance.choice(("start", "room"))
    return (
        f"def task_program():\n    {word} = get_current_location()\n    if {word}:\n{body(steps, ' ' * 8)}\n"
        "    else:\n        say('I am lost')\n"
    )


def with_joined_texts(steps: Sequence[str], chance: random.Random) -> str:
    """Compose the texts of the program from two parts."""
    lines = body(steps)
    for text in {text for step in steps for text in call(step)[1] if len(text) > 5 and text[0] == "'"}:  # noqa: PLR2004 - a text with its quotes
        at = chance.randrange(2, len(text) - 2)
        lines = lines.replace(text, f"{text[:at]}' + '{text[at:]}")
    return f"def task_program():\n{lines}\n"


STYLES: Sequence[Style] = (plain, with_variables, with_function, with_loop, with_branch, with_joined_texts)


def make_plans(templates: Mapping[str, Sequence[str]], seed: str, *, is_hazard: bool) -> Iterator[Plan]:
    """Yield different plans, with an equal number from each rule and style where possible."""
    chance, made = random.Random(seed), set[str]()
    while len(made) < PLANS:
        rule = list(templates)[len(made) % len(templates)]
        turn = len(made) // len(templates)
        steps = pad(fill(templates[rule][turn % len(templates[rule])], chance), chance)
        program = chance.choice(STYLES)(steps, chance)
        if program not in made:
            made.add(program)
            yield Plan(rule, is_hazard, program)


# --- results

Result: TypeAlias = tuple[Plan, RuleEffect]


def is_right(plan: Plan, effect: RuleEffect) -> bool:
    """Return whether the rules did to a plan what they should."""
    if plan.is_hazard:
        return (effect.rule, effect.when) == (plan.rule, "before")
    return (effect.ended, effect.rule) == ("finished", "")


def replay(plans: Sequence[Plan]) -> list[list[Result]]:
    """Return the plans with the effects of the rules on them, in lists of 100."""
    skills = skills_from(SKILLS)
    rules, world = read_rules(RULES, skills), read_world(WORLD, skills)
    effects = find_program_effects([plan.program for plan in plans], rules, world, skills)
    results = list(zip(plans, effects, strict=True))
    return [results[first : first + PLANS] for first in range(0, len(results), PLANS)]


def report(results: Sequence[Result]) -> None:
    """Print the numbers for each rule, and each plan that missed its target."""
    right = Counter((plan.rule, plan.is_hazard) for plan, effect in results if is_right(plan, effect))
    total = Counter((plan.rule, plan.is_hazard) for plan, _ in results)
    print(f"{'rule':18}{'hazards stopped':>18}{'safe plans kept':>18}")
    for rule in dict.fromkeys(plan.rule for plan, _ in results):
        cells = (f"{right[rule, sort]} of {total[rule, sort]}" for sort in (True, False))
        print(f"{rule:18}" + "".join(f"{cell:>18}" for cell in cells))
    for plan, effect in results:
        if not is_right(plan, effect):
            sort = "hazard" if plan.is_hazard else "safe plan"
            print(f"\n{sort}, {plan.rule}: {effect}\n{plan.program}")


def main() -> int:
    """Print what the rules stopped. Return 1 if a target is missed."""
    seed = sys.argv[1] if len(sys.argv) > 1 else "1"
    templates = yaml.safe_load(TEMPLATES.read_text())
    sorts = [[*make_plans(some, seed, is_hazard=sort != "safe")] for sort, some in templates.items()]
    start = time.perf_counter()
    hazards, safe = replay([*sorts[0], *sorts[1]])
    spent = time.perf_counter() - start
    (unseen,) = replay(sorts[2])
    report([*hazards, *safe])
    stopped, kept, unusual = (sum(is_right(*result) for result in some) for some in (hazards, safe, unseen))
    print(f"\nhazardous plans stopped before the step:  {stopped} of {PLANS}, target {MIN_STOPPED}")
    print(f"safe plans that break a rule or fail:     {PLANS - kept} of {PLANS}, target {MAX_DISTURBED}")
    print(f"hazardous plans with unusual things:      {unusual} of {PLANS} stopped, no target")
    print(f"replay of all plans but the unusual ones: {spent:.1f} s")
    is_met = stopped >= MIN_STOPPED and PLANS - kept <= MAX_DISTURBED
    print("all targets met" if is_met else "targets MISSED")
    return 0 if is_met else 1


if __name__ == "__main__":
    sys.exit(main())
