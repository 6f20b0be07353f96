"""`codebotler replay`: show the effects of house rules on many programs and logs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.text import Text

from codebotler.checking.storyboard import grid
from codebotler.cli.programs.check import read_program
from codebotler.core.errors import UserError
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import shortened, visible
from codebotler.core.text.words import counted
from codebotler.core.world import World
from codebotler.missions.rule_effects import RuleEffect, find_log_effect, find_program_effects
from codebotler.missions.storage.log import EVENTS_FILE
from codebotler.simulator.guard.house_rule import Rule

TIME_STYLES = {"before": "yellow", "late": "red", "at the end": "red"}
NO_EFFECT = "not at all"


def find_replayed_files(paths: Sequence[Path]) -> list[Path]:
    """Find the programs, logs and missions at these paths. Raise UserError if a path has none."""
    found: list[Path] = []
    for path in paths:
        if not path.exists():
            raise UserError("there is no such file or folder; correct the path", file=path)
        parts = sorted(path.iterdir()) if path.is_dir() and not _is_replayed(path) else [path]
        files = list(filter(_is_replayed, parts))
        if not files:
            raise UserError("no program (.py), log (.jsonl) or mission found; name another path", file=path)
        found += files
    return found


def _is_replayed(path: Path) -> bool:
    return (path / EVENTS_FILE).exists() if path.is_dir() else path.suffix in {".py", ".jsonl"}


def replay(
    files: Sequence[Path], rules: Sequence[Rule], world: World | None, skills: SkillTable
) -> dict[Path, RuleEffect]:
    """Return which house rule each file would break, and when. Run the programs, but only read the logs."""
    effects = {file: RuleEffect("unreadable") for file in files}  # in this order
    programs: dict[Path, str] = {}
    for file in effects:
        try:
            if file.suffix == ".py":
                programs[file] = read_program(str(file))
            else:
                log = file / EVENTS_FILE if file.is_dir() else file
                effects[file] = find_log_effect(log, rules, world, skills)
        except UserError as error:
            effects[file] = RuleEffect("unreadable", line=error.line, error=error.sentence)
    if programs:  # logs need no processes
        found = find_program_effects(programs.values(), rules, world, skills)
        effects.update(zip(programs, found, strict=True))
    return effects


def replay_data(effects: Mapping[Path, RuleEffect], rules: Sequence[Rule]) -> dict[str, Any]:
    """Return data for JSON: what the rules do to each file, and how many files break each rule."""
    times = Counter(effect.when or NO_EFFECT for effect in effects.values())
    pairs = Counter((effect.rule, effect.when) for effect in effects.values())
    return {
        "files": [{"file": str(file), **asdict(effect)} for file, effect in effects.items()],
        "summary": {when: times[when] for when in (*TIME_STYLES, NO_EFFECT)},
        "rules": {rule.name: {when: pairs[rule.name, when] for when in TIME_STYLES} for rule in rules},
    }


def replay_view(effects: Mapping[Path, RuleEffect], rules: Sequence[Rule]) -> Group:
    """Return a table of the files and the rules that they break, and another that counts files by rule."""
    files, numbers = grid("left", "left", "left", "left", "left"), grid("left", "right", "right", "right")
    for file, effect in effects.items():
        line = "" if effect.line is None else f"line {effect.line}: "
        words = (visible(str(file)), visible(effect.ended), effect.rule, effect.when)
        what = Text(line + shortened(effect.step or effect.error, 200))
        files.add_row(*map(Text, words), what, style=TIME_STYLES.get(effect.when, ""))
    data = replay_data(effects, rules)
    total = ", ".join(f"{number:,} {when}" for when, number in data["summary"].items())
    failed = sum(effect.ended != "finished" and not effect.when for effect in effects.values())
    total += f" ({failed:,} of these did not finish)" if failed else ""
    numbers.add_row("rule", *TIME_STYLES, style="dim")
    for name, row in data["rules"].items():
        numbers.add_row(Text(name, "bold"), *(f"{number:,}" for number in row.values()))
    return Group(files, Text(f"\n{counted(len(effects), 'file')}: {total}"), numbers)
