"""Models that run on this machine, in transformers."""

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
from codebotler.models.base import Heard, ModelError, Reply, Usage, reply_from, unheard
from codebotler.models.keys import guard_logs
from codebotler.models.sampling import DEMANDED_MAX_TOKENS, SamplingSettings
from codebotler.models.server_errors import error_text, failure
from codebotler.prompts import Prompt, PromptMessage
from codebotler.prompts.rendering import task_end

BLOCK = 10  # replies to a prompt that share a seed; runs usually have a multiple of ten for each prompt
BATCH = 32  # replies without a seed that are written together
GATHER = 0.01  # seconds in which requests that are made together come in

Ending: TypeAlias = tuple[str, Usage, str] | ModelError  # text, tokens and finish reason


@dataclass(eq=False)
class _Job:
    """A reply to be written, for a request or as the rest of a block."""

    prompt: Prompt
    text: str  # what the model continues
    number: int
    ending: asyncio.Future[Ending]
    heard: Heard | None = None  # None while nobody has requested this reply
    told: int = 0  # characters that were passed to `heard`

    @property
    def is_wanted(self) -> bool:
        return self.heard is not None and not self.ending.done()

    def tell(self, text: str) -> None:
        """Pass on the new part of a text, from the thread of the model."""
        if self.heard is not None and self.is_wanted and len(text) > self.told:
            self.ending.get_loop().call_soon_threadsafe(self.heard, text[self.told :])
            self.told = len(text)


class _CancelledError(Exception):
    pass


def _expect_wanted(batch: Sequence[_Job]) -> None:
    if not any(job.is_wanted for job in batch):
        raise _CancelledError


class LocalModel:
    """A causal language model in this process, on a GPU where there is one; a folder, or a name on the hub.

    It is a chat model if its tokenizer has a chat template, otherwise a base model. With a seed, replies are
    written in blocks whose bounds depend on nothing but the numbers of the replies, so that each number gets
    the same reply whether or not a run was interrupted. Without one, requests that wait together are a batch.
    The timeout is ignored.
    """

    def __init__(self, path: str, settings: SamplingSettings) -> None:
        self.name, self.settings = f"hf:{path}", settings
        if settings.base_url is not None:
            raise UserError(f"{self.name} runs on this machine and takes no --base-url")
        source = source_of(path)
        self.device, dtype = _device()
        transformers.utils.logging.disable_progress_bar()
        try:
            self.tokenizer = transformers.AutoTokenizer.from_pretrained(source, padding_side="left")
            model = transformers.AutoModelForCausalLM.from_pretrained(source, dtype=dtype)
        except Exception as error:  # noqa: BLE001 - a model's own code and files, wrong in many ways
            raise UserError(f"{self.name} cannot be loaded: {error_text(error)}") from None
        self.model = model.to(self.device).eval()
        if self.tokenizer.pad_token_id is None:
            self.tokenizer.pad_token = self.tokenizer.eos_token or self.tokenizer.convert_ids_to_tokens(0)
        self.is_chat = bool(self.tokenizer.chat_template)
        if settings.reasoning_effort is not None or settings.extra_body is not None:
            raise UserError(
                f"{self.name} runs on this machine and takes no --reasoning-effort or --extra-body"
            )
        if self.is_chat:
            self.settings = replace(settings, max_tokens=settings.max_tokens or DEMANDED_MAX_TOKENS)
        else:
            self.settings = settings.for_base_model(self.name)
        ends = model.generation_config.eos_token_id
        ends = ends if isinstance(ends, list) else [ends]
        self.ends = {*ends, self.tokenizer.eos_token_id} - {None}
        self.longest = getattr(model.config, "max_position_embeddings", None) or sys.maxsize
        self.is_seeded = settings.seed is not None and settings.temperature != 0
        self._waiting: list[_Job] = []
        self._unclaimed: dict[tuple[str, int], _Job] = {}  # the rest of blocks
        self._worker: asyncio.Task[None] | None = None
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Request one reply."""
        start = time.monotonic()
        job = self._job(prompt, number)
        job.heard = heard
        if self._worker is None or self._worker.done():
            self._worker = asyncio.create_task(self._work())
        ending = await job.ending
        if isinstance(ending, ModelError):
            raise ending
        text, usage, finish_reason = ending
        if rest := text[job.told :]:
            heard(rest)
        opening = None if self.is_chat else prompt
        return reply_from(text, usage, time.monotonic() - start, finish_reason, opening=opening)

    async def close(self) -> None:
        """Release the memory of the model."""
        if self._worker is not None:
            await self._worker
        del self.model

    # --- from requests to batches

    def _job(self, prompt: Prompt, number: int) -> _Job:
        text = self._text(prompt)
        if (text, number) in self._unclaimed:
            return self._unclaimed.pop((text, number))
        length = len(self._tokens(text)["input_ids"])
        if length >= self.longest:
            sentence = f"the prompt has {length:,} tokens, but the model takes only {self.longest:,}"
            raise failure(self.name, sentence, may_pass=False)
        first = number - number % BLOCK
        numbers = range(first, first + BLOCK) if self.is_seeded else [number]
        loop = asyncio.get_running_loop()
        jobs = {n: _Job(prompt, text, n, loop.create_future()) for n in numbers}
        self._waiting.extend(jobs.values())
        self._unclaimed |= {(text, n): job for n, job in jobs.items() if n != number}
        return jobs[number]

    async def _work(self) -> None:
        await asyncio.sleep(GATHER)
        size = BLOCK if self.is_seeded else BATCH
        while self._waiting:
            batch = self._waiting[:size]
            del self._waiting[:size]
            if not self.is_seeded:
                batch = [job for job in batch if job.is_wanted]
            seed = self.settings.seed_of(batch[0].number) if batch and self.is_seeded else None
            try:
                endings = await asyncio.to_thread(self._endings, batch, seed)
            except Exception as error:  # noqa: BLE001 - to be raised by each request instead
                endings = [failure(self.name, error, may_pass=False)] * len(batch)
            for job, ending in zip(batch, endings, strict=True):
                if isinstance(ending, ModelError):
                    self._unclaimed.pop((job.text, job.number), None)  # a later request tries again
                if not job.ending.done():
                    job.ending.set_result(ending)

    def _text(self, prompt: Prompt) -> str:
        if not self.is_chat:
            return prompt.text
        try:
            return self._templated(prompt.messages)
        except jinja2.TemplateError:  # some templates know no system message
            system, user, *others = prompt.messages
            return self._templated([PromptMessage("user", f"{system.text}\n\n{user.text}"), *others])

    def _templated(self, messages: Sequence[PromptMessage]) -> str:
        turns = [{"role": message.role, "content": message.text} for message in messages]
        return str(self.tokenizer.apply_chat_template(turns, tokenize=False, add_generation_prompt=True))

    def _tokens(self, text: str | list[str], **options: Any) -> Any:  # noqa: ANN401 - transformers is untyped here
        # A chat template has written the special tokens itself.
        special = not self.is_chat
        return self.tokenizer(text, add_special_tokens=special, return_token_type_ids=False, **options)

    # --- in the thread of the model

    def _endings(self, batch: Sequence[_Job], seed: int | None) -> list[Ending]:
        """Write replies, fewer at a time where the memory is too small for all."""
        try:
            return self._generated(batch, seed)
        except _CancelledError:
            return [failure(self.name, "the request was cancelled", may_pass=True)] * len(batch)
        except torch.cuda.OutOfMemoryError:
            if len(batch) == 1:
                return [failure(self.name, "there is not enough memory for this prompt", may_pass=False)]
        torch.cuda.empty_cache()
        half = len(batch) // 2
        later = None if seed is None else seed + half
        return [*self._endings(batch[:half], seed), *self._endings(batch[half:], later)]

    def _generated(self, batch: Sequence[_Job], seed: int | None) -> list[Ending]:
        _expect_wanted(batch)
        tokens = self._tokens([job.text for job in batch], return_tensors="pt", padding=True).to(self.device)
        start = tokens["input_ids"].shape[1]
        counts: dict[int, int] = {}  # the tokens of each reply that `watch` has ended

        def watch(sequences: torch.Tensor, _scores: object, **_: object) -> torch.Tensor:
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
                max_new_tokens=min(self.settings.max_tokens or DEMANDED_MAX_TOKENS, self.longest - start),
                num_beams=1,
                pad_token_id=self.tokenizer.pad_token_id,
                eos_token_id=sorted(self.ends) or None,
                stopping_criteria=transformers.StoppingCriteriaList([watch]),
            )
        endings: list[Ending] = []
        for row, job in enumerate(batch):
            written = sequences[row, start:].tolist()[: counts.get(row)]
            kept = self._before_end(written)
            reason = "stop" if row in counts or len(kept) < len(written) else "length"
            usage = Usage(int(tokens["attention_mask"][row].sum()), len(kept))
            text = self._decoded(kept)
            endings.append((text[: self._end(job, text)], usage, reason))
        return endings

    def _sampling(self) -> dict[str, Any]:
        if self.settings.temperature == 0:
            return {"do_sample": False, "temperature": None, "top_p": None, "top_k": None}
        given = {"temperature": self.settings.temperature, "top_p": self.settings.top_p, "top_k": 0}
        return {"do_sample": True, **{name: value for name, value in given.items() if value is not None}}

    def _is_over(self, job: _Job, tokens: list[int]) -> bool:
        """Whether a base model has written the whole function; the whole lines of it are passed on."""
        text = self._decoded(self._before_end(tokens))
        end = self._end(job, text)
        # The last line, and the break in front of it, may come after the end.
        job.tell(text[: max(0, text.rfind("\n", 0, end))])
        return end < len(text)

    def _before_end(self, tokens: list[int]) -> list[int]:
        return tokens[: next((at for at, token in enumerate(tokens) if token in self.ends), len(tokens))]

    def _decoded(self, tokens: list[int]) -> str:
        return str(
            self.tokenizer.decode(tokens, skip_special_tokens=True, clean_up_tokenization_spaces=False)
        )

    def _end(self, job: _Job, text: str) -> int:
        return len(text) if self.is_chat else task_end(job.prompt.opening, text, job.prompt.stop)


def source_of(path: str) -> str:
    """A folder of a model, or the name of one on the hub, as transformers takes it."""
    folder = Path(path).expanduser()
    if path.startswith((".", "/", "~")) and not folder.is_dir():
        raise UserError("there is no such model folder", file=path)
    return str(folder)


def _device() -> tuple[str, torch.dtype]:
    if torch.cuda.is_available():
        return "cuda", torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float16
    if torch.backends.mps.is_available():
        return "mps", torch.float16
    return "cpu", torch.float32
