"""`codebotler continue`: do the rest of a mission that failed or was stopped."""

from __future__ import annotations

from rich.console import Group
from rich.text import Text

from codebotler.core.errors import UserError
from codebotler.core.terminal import is_interactive, note, print_rich, read_line, shortened
from codebotler.missions.recovery import ask_evidence
from codebotler.missions.storage.past import MissionPast
from codebotler.missions.storage.store import recover_missions
from codebotler.web.console import Console


def choose_past(console: Console, name: str, *, happened: bool | None, answer: str = "") -> MissionPast:
    """Read the past of a mission, show it, and ask whether an unsure step happened.

    Args:
        console: the console with the robot, which is asked where it is if a step is unsure.
        name: the ID of the mission, or `last`.
        happened: whether the unsure step happened, or None to ask.
        answer: its answer, if it is a question.

    Raises:
        UserError: there is no such mission, it cannot be continued, or nobody can answer.
    """
    recover_missions(console.home)
    past = console.past_of(name)
    print_rich(past_view(past))
    if past.unsure is None:
        return past
    if happened is None:
        if not is_interactive():
            raise UserError(f"{past.question}; add --happened or --not-happened")
        for sentence in (past.question, *ask_evidence(console.robot, console.home, past, note)):
            note(sentence)
        happened = _ask_whether(past)
        if happened and past.answers:
            known = " | ".join(map(shortened, past.answers))
            answer = read_line(f"what was the answer [{known}]? (Enter if you do not know) ").strip()
    return past.resolve(happened=happened, answer=answer)


def _ask_whether(past: MissionPast) -> bool:
    """Ask until a person says whether a step happened. Raise UserError at the end of the input."""
    while answer := read_line("did this happen? [y/n] "):
        word = answer.strip().lower()
        if word in {"y", "yes", "n", "no"}:
            return word.startswith("y")
        note("answer y or n, or press Ctrl-C to end here")
    raise UserError(f"{past.question}; add --happened or --not-happened")


def past_view(past: MissionPast) -> Group:
    """Show what a mission did and saw before it ended."""
    head = Text.assemble((f"mission {past.mission}", "bold"), f" ended early: {shortened(past.why)}")
    steps = [Text(f"  {step}", "dim") for step in past.steps] or [Text("  no step was finished", "dim")]
    return Group(head, Text("done so far:"), *steps)
