"""How missions of agents end, and what this means for the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from codebotler.core.trace import Outcome, RunError, Status
from codebotler.models.no_program import NO_PROGRAM_SENTENCES

FINAL_ANSWER, ERROR, TIMEOUT = "answer", "error", "TimeoutError"
"""Endings that programs have, too: a normal end, an error of the robot or a house rule, and a limit."""

NO_CALL, GAVE_UP, OUTSIDE_CONTRACT = "NoCall", "GaveUp", "OutsideContract"
UNKNOWN_TOOL, WRONG_ARGUMENTS, SEVERAL_CALLS = "UnknownTool", "WrongArguments", "SeveralCalls"
REPEATED_CALLS, TURN_LIMIT, TOKEN_LIMIT = "RepeatedCalls", "TurnLimit", "TokenLimit"
SERVER_REJECTED = "Rejected"

AGENT_SENTENCES: Mapping[str, str] = {
    NO_CALL: "The agent answered in text and never called a skill.",
    UNKNOWN_TOOL: "The agent kept calling tools that do not exist.",
    WRONG_ARGUMENTS: "The agent kept calling tools with wrong arguments.",
    SEVERAL_CALLS: "The agent kept making several calls at once.",
    REPEATED_CALLS: "The agent kept repeating the same call, with the same result.",
    TURN_LIMIT: "The agent reached the limit of turns.",
    TOKEN_LIMIT: "The agent reached the limit of tokens.",
    GAVE_UP: "The agent gave up.",
    SERVER_REJECTED: "The server rejected the conversation, which may have become too long.",
    OUTSIDE_CONTRACT: "The agent wanted to do what the contract does not allow.",
}
"""A sentence that explains each ending that only missions of agents have."""

ENDINGS = (FINAL_ANSWER, ERROR, TIMEOUT, *AGENT_SENTENCES, *NO_PROGRAM_SENTENCES)
_SENTENCES = {**AGENT_SENTENCES, **{str(kind): text for kind, text in NO_PROGRAM_SENTENCES.items()}}
_LIMITS = {TIMEOUT, REPEATED_CALLS, TURN_LIMIT, TOKEN_LIMIT}
_NORMAL = {FINAL_ANSWER, ERROR, NO_CALL}


def apply_ending(outcome: Outcome, ending: str) -> Outcome:
    """Return the outcome of an agent's mission. `outcome` is that of a program with the same calls.

    If the program finished, an ending such as `TurnLimit` changes the status to a timeout, and one such as
    `GaveUp` to an agent error. Otherwise, `outcome` is returned unchanged.
    """
    if ending in _NORMAL or outcome.status is not Status.FINISHED:
        return outcome
    sentence = _SENTENCES.get(ending, "The simulation reached a limit.")
    status = Status.TIMEOUT if ending in _LIMITS else Status.AGENT_ERROR
    return replace(outcome, status=status, error=RunError(ending, sentence))
