"""Logs the replies to agents, so that an interrupted mission goes on without paying for them twice."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path

import msgspec

from codebotler.core.errors import UserError
from codebotler.core.files import Appender, read_rows, to_line
from codebotler.models.base import Reply
from roboeval.evaluation.runs.completions import KEY, CompletionKey
from roboeval.evaluation.runs.rows import key_of


class TurnLog:
    """Saves an agent's replies as they arrive, so that an interrupted mission can resume."""

    def __init__(self, path: Path, done: Collection[CompletionKey]) -> None:
        self._replies: dict[CompletionKey, list[Reply]] = {}
        for number, row in read_rows(path) if path.exists() else ():
            try:
                if (key := key_of(row)) not in done:
                    self._replies.setdefault(key, []).append(msgspec.convert(row["reply"], Reply))
            except (KeyError, TypeError, msgspec.ValidationError):
                sentence = "this line is not a reply to an agent; name another folder"
                raise UserError(sentence, file=path, line=number) from None
        self._file = Appender(path)

    def replies(self, key: CompletionKey) -> list[Reply]:
        """Return the saved replies of a mission, or an empty list if its completion has been saved."""
        return list(self._replies.get(key, ()))

    def forget(self, key: CompletionKey) -> None:
        """Forget the replies to a mission whose completion has been saved. The file keeps them."""
        self._replies.pop(key, None)

    async def keep(self, key: CompletionKey, reply: Reply) -> None:
        """Append a reply to the file, and wait until the reply is on disk."""
        self._replies.setdefault(key, []).append(reply)
        self._file.append(to_line({**dict(zip(KEY, key, strict=True)), "reply": asdict(reply)}))
        await asyncio.to_thread(self._file.sync)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
