"""Models that run on this machine, in transformers."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import torch
import transformers

from codebotler.core.errors import UserError
from codebotler.models.base import Heard, ModelError, Reply, SamplingSettings, Usage, program_in, unheard
from codebotler.models.redaction import guard_logs
from codebotler.models.server_errors import brief, fault
from codebotler.prompts import Message, Prompt
from codebotler.prompts.rendering import task_end

BATCH = 32  # requests in one go, if so many wait
GATHER = 0.01  # seconds in which requests that are made together come in
HALF = "\ufffd"  # stands for a character of which only some bytes have come


@dataclass(eq=False)
class _Job:
    """A request that waits for its reply, or gets it.

    Args:
        text: what the model goes on from.
        prompt: what it was made of.
        seed: what fixes its random numbers.
        heard: told each piece of the reply.
        reply: text, usage and the reason why it ended, once it has; done as well when it is given up.
    """

    text: str
    prompt: Prompt
    seed: int | None
    heard: Heard
    reply: asyncio.Future[tuple[str, Usage, str]]
    told: int = field(default=0, init=False)

    def tell(self, text: str) -> None:
        """Pass on what is new of a text, from the thread that makes it."""
        piece, self.told = text[self.told :], max(self.told, len(text))
        if piece and not self.reply.done():
            self.reply.get_loop().call_soon_threadsafe(self.heard, piece)

    def end(self, result: tuple[str, Usage, str] | ModelError) -> None:
        """Pass on the reply, or why there is none, from the thread that makes it."""
        self.reply.get_loop().call_soon_threadsafe(self._end, result)

    def _end(self, result: tuple[str, Usage, str] | ModelError) -> None:
        if self.reply.done():
            return
        if isinstance(result, ModelError):
            self.reply.set_exception(result)
        else:
            self.reply.set_result(result)


class Local:
    """A causal language model in this process, on a GPU where there is one.

    Requests that wait at the same time are one batch. With a seed the same number gets the same reply,
    whichever requests it shares a batch with, up to rounding. A tokenizer with a chat template is given
    messages, any other the text for base models, whose reply ends where the function ends.

    Args:
        path: a folder, or a name on the Hugging Face hub.
        settings: how it is to be asked; a timeout has no meaning here.

    Raises:
        UserError: it cannot be loaded, or a base URL is given.
    """

    def __init__(self, path: str, settings: SamplingSettings) -> None:
        self.name, self.settings = f"hf:{path}", settings
        if settings.base_url is not None:
            raise UserError(f"{self.name} runs on this machine and takes no --base-url")
        if path.startswith((".", "/", "~")) and not Path(path).expanduser().is_dir():
            raise UserError("there is no such folder of a model", file=path)
        self.device, dtype = _place()
        transformers.utils.logging.disable_progress_bar()
        where = str(Path(path).expanduser())
        try:
            self.tokenizer = transformers.AutoTokenizer.from_pretrained(where, padding_side="left")
            model = transformers.AutoModelForCausalLM.from_pretrained(where, dtype=dtype)
        except Exception as error:  # noqa: BLE001 - a model's own code and files, wrong in many ways
            raise UserError(f"{self.name} cannot be loaded: {brief(error)}") from None
        self.model = model.to(self.device).eval()
        if self.tokenizer.pad_token_id is None:
            self.tokenizer.pad_token = self.tokenizer.eos_token or self.tokenizer.convert_ids_to_tokens(0)
        self.is_chat = bool(self.tokenizer.chat_template)
        self.ends = _ends(model.generation_config.eos_token_id, self.tokenizer.eos_token_id)
        self.longest = getattr(model.config, "max_position_embeddings", None) or sys.maxsize
        self._waiting: list[_Job] = []
        self._worker: asyncio.Task[None] | None = None
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Ask for one reply.

        Raises:
            ModelError: the prompt is too long for the model, or the memory too small.
        """
        start = time.monotonic()
        loop = asyncio.get_running_loop()
        text = self._text(prompt)
        length = len(self._tokens(text)["input_ids"])
        if length >= self.longest:
            sentence = f"the prompt has {length:,} tokens, but the model takes only {self.longest:,}"
            raise fault(self.name, sentence, may_pass=False)
        job = _Job(text, prompt, self.settings.seed_of(number), heard, loop.create_future())
        self._waiting.append(job)
        if self._worker is None or self._worker.done():
            self._worker = loop.create_task(self._work())
        text, usage, finish_reason = await job.reply
        program = await program_in(text if self.is_chat else prompt.program_from(text))
        return Reply(text, program, usage, time.monotonic() - start, finish_reason)

    async def close(self) -> None:
        """Give the model back."""
        if self._worker is not None:
            await self._worker
        del self.model

    async def _work(self) -> None:
        await asyncio.sleep(GATHER)
        while self._waiting:
            batch = [job for job in self._waiting[:BATCH] if not job.reply.done()]
            del self._waiting[:BATCH]
            if batch:
                await asyncio.to_thread(self._run, batch)

    def _text(self, prompt: Prompt) -> str:
        if not self.is_chat:
            return prompt.text
        try:
            return self._templated(prompt.messages)
        except jinja2.TemplateError:  # some know no system's turn
            return self._templated(_without_system(prompt.messages))

    def _templated(self, messages: Sequence[Message]) -> str:
        turns = [{"role": message.role, "content": message.text} for message in messages]
        return str(self.tokenizer.apply_chat_template(turns, tokenize=False, add_generation_prompt=True))

    def _run(self, batch: Sequence[_Job]) -> None:
        """Reply to requests, fewer at a time if the memory is too small for all."""
        try:
            self._generate(batch)
        except torch.cuda.OutOfMemoryError:
            if len(batch) == 1:
                batch[0].end(fault(self.name, "the memory is too small for this prompt", may_pass=False))
                return
            torch.cuda.empty_cache()
            self._run(batch[: len(batch) // 2])
            self._run(batch[len(batch) // 2 :])
        except Exception as error:  # noqa: BLE001 - nobody else would tell who waits
            for job in batch:
                job.end(fault(self.name, error, may_pass=False))

    def _generate(self, batch: Sequence[_Job]) -> None:
        tokens = self._tokens([job.text for job in batch], return_tensors="pt", padding=True).to(self.device)
        start = tokens["input_ids"].shape[1]
        most = min(self.settings.max_tokens, self.longest - start)
        watch = _Watch(self, batch, start)
        with torch.inference_mode():
            sequences = self.model.generate(
                **tokens,
                generation_config=transformers.GenerationConfig(
                    max_new_tokens=most,
                    do_sample=False,  # _Draw draws, for each request on its own
                    num_beams=1,
                    pad_token_id=self.tokenizer.pad_token_id,
                    eos_token_id=sorted(self.ends) or None,
                ),
                logits_processor=transformers.LogitsProcessorList([self._draw(batch)]),
                stopping_criteria=transformers.StoppingCriteriaList([watch]),
            )
        for row, job in enumerate(batch):
            written = self.up_to_end(sequences[row, start:].tolist())
            text, is_whole = self.text_of(job, written)
            count = watch.counts.get(row, len(written))
            job.tell(text)
            usage = Usage(int(tokens["attention_mask"][row].sum()), count)
            job.end((text, usage, "stop" if is_whole or count < most else "length"))

    def _tokens(self, text: str | list[str], **options: Any) -> Any:  # noqa: ANN401 - transformers is untyped here
        # A chat template writes special tokens itself.
        special = not self.is_chat
        return self.tokenizer(text, add_special_tokens=special, return_token_type_ids=False, **options)

    def up_to_end(self, tokens: list[int]) -> list[int]:
        """The tokens in front of the one that ends a reply."""
        ends = (at for at, token in enumerate(tokens) if token in self.ends)
        return tokens[: next(ends, len(tokens))]

    def text_of(self, job: _Job, tokens: list[int]) -> tuple[str, bool]:
        """The text of tokens, up to the end of the function, and whether that end has come."""
        text = self.tokenizer.decode(tokens, skip_special_tokens=True, clean_up_tokenization_spaces=False)
        if self.is_chat:
            return text, False
        end = task_end(job.prompt.opening, text, job.prompt.stop)
        return text[:end], end < len(text)

    def _draw(self, batch: Sequence[_Job]) -> _Draw:
        given, own = self.settings, self.model.generation_config
        temperature, top_p = given.temperature, given.top_p
        if temperature is None:
            temperature = (own.temperature or 1.0) if own.do_sample else 0.0
        if top_p is None:
            top_p = own.top_p or 1.0
        return _Draw(temperature, top_p, [_generator(job.seed, self.device) for job in batch])


@dataclass(eq=False)
class _Watch:
    """Ends each reply of a batch where its function ends, or where nobody waits for it any more.

    Args:
        local: the model.
        batch: the requests.
        start: where their replies begin.
    """

    local: Local
    batch: Sequence[_Job]
    start: int
    counts: dict[int, int] = field(default_factory=dict, init=False)
    """How many tokens those have that were ended here."""

    def __call__(self, tokens: torch.Tensor, _scores: object, **_more: object) -> torch.Tensor:
        for row, job in enumerate(self.batch):
            if row not in self.counts and self._is_over(job, tokens[row, self.start :].tolist()):
                self.counts[row] = tokens.shape[1] - self.start
        over = [row in self.counts for row in range(len(self.batch))]
        return torch.tensor(over, dtype=torch.bool, device=tokens.device)

    def _is_over(self, job: _Job, tokens: list[int]) -> bool:
        text, is_over = self.local.text_of(job, self.local.up_to_end(tokens))
        if not text.endswith(HALF):
            job.tell(text if is_over else _certain(text))
        return is_over or job.reply.done()


@dataclass(eq=False)
class _Draw:
    """Draws the next token of each request of a batch with dice of its own, and leaves no other possible.

    Args:
        temperature: 0 for the likeliest token.
        top_p: the share of likely tokens that are drawn from.
        dice: one for each request.
    """

    temperature: float
    top_p: float
    dice: Sequence[torch.Generator]

    def __call__(self, _tokens: torch.Tensor, scores: torch.Tensor) -> torch.Tensor:
        values = scores.float()
        if self.temperature > 0:
            values = self._likely(values / self.temperature)
            # The largest of values to which such noise is added is a draw from what they stand for.
            noise = [torch.empty_like(values[0]).exponential_(generator=die).log() for die in self.dice]
            values = values - torch.stack(noise)
        drawn = values.argmax(dim=-1, keepdim=True)
        return torch.full_like(scores, -torch.inf).scatter(-1, drawn, 0.0)

    def _likely(self, values: torch.Tensor) -> torch.Tensor:
        """The values without those outside of the share of likely ones; the likeliest always stays."""
        if self.top_p >= 1:
            return values
        falling, order = values.sort(dim=-1, descending=True)
        shares = falling.softmax(dim=-1)
        falling = falling.masked_fill(shares.cumsum(dim=-1) - shares >= self.top_p, -torch.inf)
        return torch.empty_like(values).scatter(-1, order, falling)


def _place() -> tuple[str, torch.dtype]:
    """Where models run here, and in which kind of numbers."""
    if torch.cuda.is_available():
        return "cuda", torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float16
    if torch.backends.mps.is_available():
        return "mps", torch.float16
    return "cpu", torch.float32


def _generator(seed: int | None, device: str) -> torch.Generator:
    generator = torch.Generator(device)
    if seed is None:
        generator.seed()
    else:
        generator.manual_seed(seed)
    return generator


def _ends(*told: int | list[int] | None) -> frozenset[int]:
    """The tokens that end a reply, which are told in several places, one or more at a time."""
    listed = [[] if one is None else [one] if isinstance(one, int) else one for one in told]
    return frozenset(token for some in listed for token in some)


def _certain(text: str) -> str:
    """A text without its last line and the break in front of it, which may stand behind the end."""
    return text[: text.rfind("\n")] if "\n" in text else ""


def _without_system(messages: Sequence[Message]) -> list[Message]:
    """The same conversation with the system's turn as the beginning of the user's."""
    system, user, *others = messages
    return [Message("user", f"{system.text}\n\n{user.text}"), *others]
