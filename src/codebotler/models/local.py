"""Models that run in this process with transformers."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import jinja2
import torch
import transformers

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError, Reply, TextListener, Usage, ignore_text, make_reply
from codebotler.models.keys import guard_logs
from codebotler.models.sampling import CHAT_MAX_TOKENS, SamplingSettings
from codebotler.models.servers.server_errors import error_text, model_error
from codebotler.prompts import Prompt, PromptMessage
from codebotler.prompts.rendering import task_end

SEED_BLOCK = 10  # replies to a prompt that share a seed; runs usually have a multiple of ten per prompt
MAX_BATCH = 32  # replies without a seed that are generated together
GATHER_SECONDS = 0.01  # seconds to wait for simultaneous requests to arrive

Ending: TypeAlias = tuple[str, Usage, str] | ModelError  # text, tokens and finish reason


@dataclass(eq=False)
class _Job:
    """A reply to generate, either for a request or to complete a block."""

    prompt: Prompt
    text: str  # the text of the prompt for the model
    number: int
    ending: asyncio.Future[Ending]
    on_text: TextListener | None = None  # None until the reply is requested
    passed: int = 0  # the number of characters passed to `on_text`

    @property
    def is_wanted(self) -> bool:
        return self.on_text is not None and not self.ending.done()

    def pass_on(self, text: str) -> None:
        """Send the listener what is new in `text`, the reply so far. Call this on the model's thread."""
        if self.on_text is not None and self.is_wanted and len(text) > self.passed:
            self.ending.get_loop().call_soon_threadsafe(self.on_text, text[self.passed :])
            self.passed = len(text)


class _CancelledError(Exception):
    pass


def _expect_wanted(batch: Sequence[_Job]) -> None:
    if not any(job.is_wanted for job in batch):
        raise _CancelledError


class LocalModel:
    """A language model from a folder or the Hugging Face hub, run in this process (on a GPU if there is one).

    It is a chat model if its tokenizer has a chat template, otherwise a base model. With a seed, replies are
    generated in blocks that depend only on the numbers of the replies, so a resumed run gives the same
    replies. Without a seed, waiting requests are batched. `settings.timeout` is ignored.
    """

    def __init__(self, path: str, settings: SamplingSettings) -> None:
        self.name, self.settings = f"hf:{path}", settings
        source = find_source(path)
        self.device, dtype = _device()
        transformers.utils.logging.disable_progress_bar()
        try:
            self.tokenizer = transformers.AutoTokenizer.from_pretrained(source, padding_side="left")
            model = transformers.AutoModelForCausalLM.from_pretrained(source, dtype=dtype)
        except Exception as error:  # noqa: BLE001 - a model's own code and files fail in many ways
            raise UserError(f"{self.name} cannot be loaded: {error_text(error)}") from None
        self.model = model.to(self.device).eval()
        if self.tokenizer.pad_token_id is None:
            self.tokenizer.pad_token = self.tokenizer.eos_token or self.tokenizer.convert_ids_to_tokens(0)
        self.is_chat = bool(self.tokenizer.chat_template)
        if settings.reasoning_effort is not None or settings.extra_body is not None:
            raise UserError(f"{self.name} does not support --reasoning-effort or --extra-body; remove them")
        if self.is_chat:
            self.settings = replace(settings, max_tokens=settings.max_tokens or CHAT_MAX_TOKENS)
        else:
            self.settings = settings.for_base_model(self.name)
        ends = model.generation_config.eos_token_id
        ends = ends if isinstance(ends, list) else [ends]
        self.ends = {*ends, self.tokenizer.eos_token_id} - {None}
        self.longest = getattr(model.config, "max_position_embeddings", None) or sys.maxsize
        self.is_seeded = settings.seed is not None and settings.temperature != 0
        self._waiting: list[_Job] = []
        self._unclaimed: dict[tuple[str, int], _Job] = {}  # replies of a block that were not requested yet
        self._worker: asyncio.Task[None] | None = None
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        """Generate reply `number` to a prompt, counted from 0. Raise ModelError if this fails."""
        start = time.monotonic()
        job = self._job(prompt, number)
        job.on_text = on_text
        if self._worker is None or self._worker.done():
            self._worker = asyncio.create_task(self._work())
        ending = await job.ending
        if isinstance(ending, ModelError):
            raise ending
        text, usage, finish_reason = ending
        if rest := text[job.passed :]:
            on_text(rest)
        opening = None if self.is_chat else prompt
        return make_reply(text, usage, time.monotonic() - start, finish_reason, opening=opening)

    async def close(self) -> None:
        """Release the memory of the model."""
        if self._worker is not None:
            await self._worker
        del self.model

    def _job(self, prompt: Prompt, number: int) -> _Job:
        text = self._text(prompt)
        if (text, number) in self._unclaimed:
            return self._unclaimed.pop((text, number))
        length = len(self._tokens(text)["input_ids"])
        if length >= self.longest:
            sentence = f"the prompt has {length:,} tokens; the model takes at most {self.longest:,}"
            raise model_error(self.name, sentence, is_temporary=False)
        first = number - number % SEED_BLOCK
        numbers = range(first, first + SEED_BLOCK) if self.is_seeded else [number]
        loop = asyncio.get_running_loop()
        jobs = {n: _Job(prompt, text, n, loop.create_future()) for n in numbers}
        self._waiting.extend(jobs.values())
        self._unclaimed |= {(text, n): job for n, job in jobs.items() if n != number}
        return jobs[number]

    async def _work(self) -> None:
        await asyncio.sleep(GATHER_SECONDS)
        size = SEED_BLOCK if self.is_seeded else MAX_BATCH
        while self._waiting:
            batch = self._waiting[:size]
            del self._waiting[:size]
            if not self.is_seeded:
                batch = [job for job in batch if job.is_wanted]
            seed = self.settings.seed_of(batch[0].number) if batch and self.is_seeded else None
            try:
                endings = await asyncio.to_thread(self._endings, batch, seed)
            except Exception as error:  # noqa: BLE001 - each request raises it
                endings = [model_error(self.name, error, is_temporary=False)] * len(batch)
            for job, ending in zip(batch, endings, strict=True):
                if isinstance(ending, ModelError):
                    self._unclaimed.pop((job.text, job.number), None)  # so that a later request tries again
                if not job.ending.done():
                    job.ending.set_result(ending)

    def _text(self, prompt: Prompt) -> str:
        if not self.is_chat:
            return prompt.text
        try:
            return self._apply_template(prompt.messages)
        except jinja2.TemplateError:  # some templates support no system message
            system, user, *others = prompt.messages
            return self._apply_template([PromptMessage("user", f"{system.text}\n\n{user.text}"), *others])

    def _apply_template(self, messages: Sequence[PromptMessage]) -> str:
        turns = [{"role": message.role, "content": message.text} for message in messages]
        return str(self.tokenizer.apply_chat_template(turns, tokenize=False, add_generation_prompt=True))

    def _tokens(self, text: str | list[str], **options: Any) -> Any:  # noqa: ANN401 - transformers is untyped here
        # A chat template adds the special tokens itself.
        special = not self.is_chat
        return self.tokenizer(text, add_special_tokens=special, return_token_type_ids=False, **options)

    def _endings(self, batch: Sequence[_Job], seed: int | None) -> list[Ending]:
        """Generate replies, and halve the batch if memory runs out."""
        try:
            return self._generate(batch, seed)
        except _CancelledError:
            return [model_error(self.name, "the request was cancelled", is_temporary=True)] * len(batch)
        except torch.cuda.OutOfMemoryError:
            if len(batch) == 1:
                return [model_error(self.name, "not enough memory; use a shorter prompt", is_temporary=False)]
        torch.cuda.empty_cache()
        half = len(batch) // 2
        later = None if seed is None else seed + half
        return [*self._endings(batch[:half], seed), *self._endings(batch[half:], later)]

    def _generate(self, batch: Sequence[_Job], seed: int | None) -> list[Ending]:
        _expect_wanted(batch)
        tokens = self._tokens([job.text for job in batch], return_tensors="pt", padding=True).to(self.device)
        start = tokens["input_ids"].shape[1]
        counts: dict[int, int] = {}  # the number of tokens of each completed reply

        def stop_ended(sequences: torch.Tensor, _scores: object, **_: object) -> torch.Tensor:
            for row, job in enumerate(batch):
                if row not in counts and self._is_over(job, sequences[row, start:].tolist()):
                    counts[row] = sequences.shape[1] - start
            _expect_wanted(batch)
            return torch.tensor([row in counts for row in range(len(batch))], device=sequences.device)

        if seed is None:
            torch.seed()
        else:
            torch.manual_seed(seed)
        with torch.inference_mode():
            sequences = self.model.generate(
                **tokens,
                **self._sampling(),
                max_new_tokens=min(self.settings.max_tokens or CHAT_MAX_TOKENS, self.longest - start),
                num_beams=1,
                pad_token_id=self.tokenizer.pad_token_id,
                eos_token_id=sorted(self.ends) or None,
                stopping_criteria=transformers.StoppingCriteriaList([stop_ended]),
            )
        endings: list[Ending] = []
        for row, job in enumerate(batch):
            output = sequences[row, start:].tolist()[: counts.get(row)]
            kept = self._before_end(output)
            reason = "stop" if row in counts or len(kept) < len(output) else "length"
            usage = Usage(int(tokens["attention_mask"][row].sum()), len(kept))
            text = self._decode(kept)
            endings.append((text[: self._end(job, text)], usage, reason))
        return endings

    def _sampling(self) -> dict[str, Any]:
        if self.settings.temperature == 0:
            return {"do_sample": False, "temperature": None, "top_p": None, "top_k": None}
        given = {"temperature": self.settings.temperature, "top_p": self.settings.top_p, "top_k": 0}
        return {"do_sample": True, **{name: value for name, value in given.items() if value is not None}}

    def _is_over(self, job: _Job, tokens: list[int]) -> bool:
        """Pass on complete lines, and return whether a base model has completed the function."""
        text = self._decode(self._before_end(tokens))
        end = self._end(job, text)
        # Hold back the last line and the line break before it, because they may lie after the end.
        job.pass_on(text[: max(0, text.rfind("\n", 0, end))])
        return end < len(text)

    def _before_end(self, tokens: list[int]) -> list[int]:
        return tokens[: next((at for at, token in enumerate(tokens) if token in self.ends), len(tokens))]

    def _decode(self, tokens: list[int]) -> str:
        text = self.tokenizer.decode(tokens, skip_special_tokens=True, clean_up_tokenization_spaces=False)
        return str(text)

    def _end(self, job: _Job, text: str) -> int:
        return len(text) if self.is_chat else task_end(job.prompt.opening, text, job.prompt.stop)


def find_source(path: str) -> str:
    """Return a model's folder with `~` expanded, or its hub name. Raise UserError for a missing folder."""
    folder = Path(path).expanduser()
    if path.startswith((".", "/", "~")) and not folder.is_dir():
        raise UserError("there is no such model folder; correct the path", file=path)
    return str(folder)


def _device() -> tuple[str, torch.dtype]:
    if torch.cuda.is_available():
        return "cuda", torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float16
    if torch.backends.mps.is_available():
        return "mps", torch.float16
    return "cpu", torch.float32
