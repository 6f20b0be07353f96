"""What a run requests of a model: which completions, with which settings, and which are under way."""

from __future__ import annotations

import contextlib
import platform
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.files import Appender, read_rows, to_line, write_whole
from codebotler.core.words import brief
from codebotler.models.base import Model
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for, template_hash
from roboeval.evaluation.runs.completions import Completion, CompletionKey, name_of, read_completions
from roboeval.evaluation.runs.folder import RunFolder, load_json_object
from roboeval.suites.load import Suite

if TYPE_CHECKING:
    from codebotler.models.batch import BatchModel  # which imports large libraries

WITHOUT_EFFECT = ("timeout", "base_url")  # settings that do not change what a model replies
OPTIONAL_SETTINGS = ("reasoning_effort", "extra_body")  # settings that runs of earlier versions do not name


@dataclass(frozen=True)
class GenerationPlan:
    """Which completions a run should have: so many for each prompt of some tasks, by default of all."""

    suite: Suite
    tasks: frozenset[str] | None = None
    num_completions: int = 50

    def keys(self) -> list[CompletionKey]:
        """The completions: the first of each prompt, then the second, so that a part covers all tasks."""
        tasks = [task for name, task in self.suite.tasks.items() if self.tasks is None or name in self.tasks]
        prompts = [(task.name, prompt) for task in tasks for prompt in range(len(task.prompts))]
        return [(*prompt, index) for index in range(self.num_completions) for prompt in prompts]

    def instruction(self, key: CompletionKey) -> str:
        """The instruction that a completion is for."""
        return self.suite.tasks[key[0]].prompts[key[1]]

    def prompt(self, key: CompletionKey) -> Prompt:
        """The request for a completion."""
        rules, skills = self.suite.house_sentences, self.suite.skills
        return prompt_for(self.instruction(key), rules=rules, skills=skills)

    def sample(self, key: CompletionKey) -> int:
        """The number of the sample, from which its seed comes."""
        return key[2]

    def given(self) -> Iterable[Completion]:
        """Completions that are taken over from elsewhere."""
        return ()

    def mark(self) -> Mapping[str, int]:
        """What rows of completions.jsonl say besides the reply."""
        return {}

    def completed(self, run: RunFolder) -> Iterator[Completion]:
        """The completions that a run has; raises UserError if one's instruction is no longer the suite's."""
        if not run.completions.is_file() or not run.completions.stat().st_size:
            return
        for completion in read_completions(run.completions, self.suite):
            if completion.instruction != self.instruction(completion.key):
                which = f"{name_of(completion.key)} was generated from another instruction"
                raise UserError(f"{which} than the suite has now; name another folder", file=run.completions)
            yield completion


def no_usage() -> Counter[str]:
    """The token counts of no completions."""
    return Counter(input_tokens=0, output_tokens=0)


def add_usage(total: Counter[str], usage: Mapping[str, int | None] | None) -> None:
    """Add the token counts of a row of completions.jsonl, null where the model does not count."""
    for name in total:
        total[name] += (usage or {}).get(name) or 0


# --- run.json


def run_metadata(run: RunFolder, plan: GenerationPlan, model: Model | BatchModel) -> dict[str, Any]:
    """The content of run.json; raises UserError where completions are there that were generated otherwise."""
    fixed = {
        "model": model.name,
        "settings": _recorded(model.settings),
        "template": template_hash(plan.suite.skills),
        "suite": plan.suite.name,
    }
    earlier: dict[str, Any] = {}
    if run.about.exists():
        earlier = load_json_object(run.about)
        if not isinstance(earlier.get("settings"), dict):
            raise UserError("holds imported completions; name another folder", file=run.path)
        _expect_same(earlier, fixed, run.about)
    elif run.completions.exists() and run.completions.stat().st_size:
        why = "is missing, so that the settings of the completions are unknown"
        raise UserError(f"{why}; name another folder", file=run.about)
    return {
        **fixed,
        **_families(plan.suite),
        "batches": batches(earlier),
        "usage": no_usage(),
        "possibly_paid_twice": earlier.get("possibly_paid_twice", 0),
    }


def _recorded(settings: SamplingSettings) -> dict[str, Any]:
    """The settings that change what a model replies; those that came later are left out where unset."""
    return {
        name: value
        for name, value in asdict(settings).items()
        if name not in WITHOUT_EFFECT and (value is not None or name not in OPTIONAL_SETTINGS)
    }


def with_batch(
    earlier: list[dict[str, Any]], plan: GenerationPlan, settings: SamplingSettings
) -> list[dict[str, Any]]:
    """Request batches of a run with that of a plan, which is the last one if that was interrupted."""
    batch = {
        "tasks": None if plan.tasks is None else sorted(plan.tasks),
        "num_completions": plan.num_completions,
        **plan.mark(),
        "settings": asdict(settings),
        "codebotler": __version__,
        "python": platform.python_version(),
        "ended": None,
    }
    if earlier and earlier[-1].items() >= batch.items():
        return earlier
    return [*earlier, {**batch, "started": timestamp()}]


BATCH = ("tasks", "num_completions", "settings", "codebotler", "python", "started", "ended")


def batches(metadata: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The request batches of a run.json, in order; one of an earlier version says what it has of its one."""
    found = metadata.get("batches")
    if isinstance(found, list):
        return [dict(one) for one in found if isinstance(one, dict)]
    return (
        [{name: metadata[name] for name in BATCH if name in metadata}]
        if "num_completions" in metadata
        else []
    )


def _families(suite: Suite) -> dict[str, Any]:
    """From which families the tasks were made, and what a later version must make of them."""
    if suite.families is None:
        return {}
    return {"families": {**suite.families, "version": suite.version, "digest": suite.digest}}


def requested_tasks(metadata: Mapping[str, Any]) -> frozenset[str] | None:
    """The tasks of which a run.json says that completions were requested; None for all."""
    requested: set[str] = set()
    for batch in batches(metadata):
        if not isinstance(batch.get("tasks"), list):
            return None
        requested |= {*batch["tasks"]}
    return frozenset(requested)


def _expect_same(earlier: dict[str, Any], fixed: dict[str, Any], file: Path) -> None:
    before, now = ({**values, **values["settings"], "settings": None} for values in (earlier, fixed))
    for name, value in now.items():
        if before.get(name) != value:
            what = "prompt template" if name == "template" else name.replace("_", "-")
            which = f"another {what} ({_brief(before.get(name))}, now {_brief(value)})"
            sentence = f"the completions were generated with {which}; name another folder to start over"
            raise UserError(sentence, file=file)


def _brief(value: object) -> str:
    return brief("none" if value is None else str(value), 24)


def timestamp() -> str:
    """The time now, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


# --- requests under way


class RequestLog:
    """The file that notes each request before it is sent, and each that fails.

    A request that is noted, and has neither failed nor left a completion, was under way when the run was
    interrupted, and may be paid twice. The first line counts those of earlier interruptions, so that an
    interruption at any moment has none counted twice. The file goes when a run ends in order.
    """

    def __init__(self, path: Path, done: set[CompletionKey], lost: int) -> None:  # `lost` as run.json has it
        self.path = path
        earlier, noted = self._read()
        self.interrupted = len(noted - done)  # at the last interruption
        self.lost = max(lost, earlier + self.interrupted)
        self.under_way: set[CompletionKey] = set()

    def __enter__(self) -> Self:
        """Start the file anew, now that run.json knows of `lost`."""
        write_whole(self.path, to_line({"lost": self.lost}))
        self._file = Appender(self.path)
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        with contextlib.suppress(OSError):  # a full disk has been reported already
            self._file.close()
        if kind is None and not self.under_way:
            self.path.unlink()

    def sent(self, key: CompletionKey) -> None:
        """Note a request before it is sent; if the disk is full, the OSError keeps it from being sent."""
        self._file.append(to_line({"sent": key}))
        self.under_way.add(key)

    def failed(self, key: CompletionKey) -> None:
        """Note that a request ended without a reply."""
        if key in self.under_way:
            self.kept(key)
            self._file.append(to_line({"failed": key}))

    def kept(self, key: CompletionKey) -> None:
        """Forget a request; its completion, which is in its file now, shows that it has ended."""
        self.under_way.remove(key)

    def _read(self) -> tuple[int, set[CompletionKey]]:
        """How many requests were lost before the file was started, and which ones it leaves open."""
        lost = 0
        noted: set[CompletionKey] = set()
        for number, row in read_rows(self.path, growing=True) if self.path.exists() else ():
            match row:
                case {"lost": int(lost)}:
                    pass
                case {"sent": [str(task), int(prompt), int(index)]}:
                    noted.add((task, prompt, index))
                case {"failed": [str(task), int(prompt), int(index)]}:
                    noted.discard((task, prompt, index))
                case _:
                    raise UserError(
                        "this line is not a request; delete the file", file=self.path, line=number
                    )
        return lost, noted
