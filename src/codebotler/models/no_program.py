"""Find out why a reply contains no program: for example, it was cut off, or the model refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeAlias, get_args

from codebotler.core.text.unicode import compose
from codebotler.prompts.extract import defines_task
from codebotler.simulator.process.isolated_call import IsolatedCallError

NoProgram: TypeAlias = Literal["cut-off", "tool-call", "refusal", "filtered", "empty", "no-code"]
"""Why a reply contains no program."""

NO_PROGRAM_KINDS: tuple[NoProgram, ...] = get_args(NoProgram)
NO_PROGRAM_SENTENCES: Mapping[NoProgram, str] = {
    "cut-off": "The reply was cut off before the program was complete.",
    "tool-call": "The model called a tool instead of writing a program.",
    "refusal": "The model refused.",
    "filtered": "A content filter blocked the request or the reply.",
    "empty": "The reply is empty.",
    "no-code": "The reply holds no code.",
}

_CUT_OFF = {"length", "max_tokens", "max_output_tokens", "max_length", "model_length", "token_limit"}
_CUT_OFF |= {"model_context_window_exceeded"}
_BY_REASON: Mapping[str, NoProgram] = {
    **dict.fromkeys(_CUT_OFF, "cut-off"),
    **dict.fromkeys(("tool_call", "tool_calls", "tool_use", "function_call"), "tool-call"),
    **dict.fromkeys(("malformed_function_call", "unexpected_tool_call"), "tool-call"),
    "refusal": "refusal",
    **dict.fromkeys(("content_filter", "content_filtered", "safety", "recitation", "blocklist"), "filtered"),
    **dict.fromkeys(("prohibited_content", "spii", "language", "guardrail_intervened"), "filtered"),
}
"""The kinds of replies by the server's finish reason, in lower case."""


def is_cut_off(finish_reason: str | None) -> bool:
    """Return whether a server's finish reason, such as `length`, means that the token limit was reached."""
    return (finish_reason or "").lower() in _CUT_OFF


def classify_reply(
    reply: str | None,
    program: str,
    finish_reason: str | None,
    *,
    has_code: bool,
    known_kind: NoProgram | None = None,
) -> NoProgram | None:
    """Return why a reply contains no program, or None if it contains, or may contain, a program.

    If a reply was cut off after a complete program, this program counts. If it was cut off inside a program,
    the reply contains none, even if the part that arrived parses.

    Args:
        reply: the text, or None if it was not recorded.
        program: the extracted program.
        finish_reason: the server's finish reason, or None if it gave none.
        has_code: whether the reply contains any lines of code.
        known_kind: the kind of reply, if the server reported it outside the text, such as in a refusal field.
    """
    by_reason = _BY_REASON.get((finish_reason or "").lower())
    kind = by_reason if by_reason == "cut-off" else known_kind or by_reason
    if kind is not None and not (program.strip() and _is_whole(program)):
        return kind
    if kind == "cut-off" and reply is not None and _ends_in_code(reply, program):
        return kind
    if has_code or kind is not None:
        return None
    return "no-code" if program.strip() else "empty"


def _ends_in_code(reply: str, program: str) -> bool:
    """Whether a reply ends inside its program, or inside a later code fence with a better version."""
    last = program.rstrip().rpartition("\n")[2].strip()
    _, _, rest = compose(reply).rpartition(last)
    fences = sum(line.lstrip().startswith(("```", "~~~")) for line in rest.splitlines())
    return not rest.strip() or (fences > 0 and fences % 2 == 0)


def _is_whole(program: str) -> bool:
    try:
        return defines_task(program)
    except IsolatedCallError:
        return False
