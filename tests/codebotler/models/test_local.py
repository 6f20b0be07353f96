"""Real transformers models, made on the spot: one has random weights, the others know one text by heart."""

import asyncio
import math
from collections.abc import Callable, Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import pytest

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError, Reply
from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import prompt_for
from codebotler.prompts.rendering import OPENING

REASON = "torch and transformers are not installed; `make test-transformers` has them"
torch = pytest.importorskip("torch", reason=REASON)
transformers = pytest.importorskip("transformers", reason=REASON)
tokenizers = pytest.importorskip("tokenizers", reason=REASON)
SEED_BLOCK = pytest.importorskip("codebotler.models.local").SEED_BLOCK

T = TypeVar("T")
PROMPT = prompt_for("Go to the lab.")
GO, SAY = '    go_to("lab")\n', '    say("a")\n'
OTHER = "print"
FENCE = "```"
TURNS = "{% for m in messages %}[{{ m.role }}]{{ m.content }}{% endfor %}"
TEMPLATE = TURNS + "[assistant]"
NO_SYSTEM = "{% if messages[0].role == 'system' %}{{ raise_exception('no system') }}{% endif %}" + TEMPLATE
END = "</s>"
WORDS = (OPENING, GO, SAY, OTHER, "[assistant]", f"{FENCE}python\n", FENCE)


def run(work: Coroutine[Any, Any, T]) -> T:
    return asyncio.run(work)


@pytest.fixture(scope="module")
def tokenizer() -> Any:  # noqa: ANN401 - transformers is untyped here
    made = tokenizers.Tokenizer(tokenizers.models.BPE())
    made.pre_tokenizer = tokenizers.pre_tokenizers.ByteLevel(add_prefix_space=False)
    made.decoder = tokenizers.decoders.ByteLevel()
    trainer = tokenizers.trainers.BpeTrainer(
        vocab_size=360,
        special_tokens=["<pad>", END],
        initial_alphabet=tokenizers.pre_tokenizers.ByteLevel.alphabet(),
        show_progress=False,
    )
    made.train_from_iterator([PROMPT.text], trainer)
    made.add_tokens([tokenizers.AddedToken(word, normalized=False) for word in WORDS])
    return transformers.PreTrainedTokenizerFast(tokenizer_object=made, pad_token="<pad>", eos_token=END)


def save_model(folder: Path, tokenizer: Any, hidden: int, change: Callable[[Any], None]) -> str:  # noqa: ANN401 - transformers is untyped here
    torch.manual_seed(0)
    config = transformers.LlamaConfig(
        vocab_size=len(tokenizer),
        hidden_size=hidden,
        intermediate_size=64,
        num_hidden_layers=1,
        num_attention_heads=4,
        num_key_value_heads=4,
        max_position_embeddings=4096,
        bos_token_id=None,
        eos_token_id=tokenizer.eos_token_id,
        pad_token_id=tokenizer.pad_token_id,
    )
    model = transformers.LlamaForCausalLM(config)
    change(model)
    model.save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    return f"hf:{folder}"


@pytest.fixture(scope="module")
def babbler(tmp_path_factory: pytest.TempPathFactory, tokenizer: Any) -> str:  # noqa: ANN401 - transformers is untyped here
    """A model with random weights."""
    return save_model(tmp_path_factory.mktemp("babbler"), tokenizer, 32, lambda _model: None)


@pytest.fixture
def reciter(tmp_path: Path, tokenizer: Any) -> Callable[..., str]:  # noqa: ANN401 - transformers is untyped here
    """Make models that write a list of words in order, and then repeat the last one."""

    def make(*words: str, template: str | None = None) -> str:
        ids = [tokenizer.convert_tokens_to_ids(word) for word in words]
        size = math.ceil(len(tokenizer) / 8) * 8

        def change(model: Any) -> None:  # noqa: ANN401 - transformers is untyped here
            with torch.no_grad():
                for layer in model.model.layers:
                    layer.self_attn.o_proj.weight.zero_()
                    layer.mlp.down_proj.weight.zero_()
                model.model.embed_tokens.weight.copy_(torch.eye(len(tokenizer), size))
                model.lm_head.weight.zero_()
                for this, following in zip(ids, [*ids[1:], ids[-1]], strict=True):
                    model.lm_head.weight[following, this] = 1.0

        tokenizer.chat_template = template
        try:
            return save_model(tmp_path, tokenizer, size, change)
        finally:
            tokenizer.chat_template = None

    return make


def replies(name: str, settings: SamplingSettings, *numbers: int) -> list[Reply]:
    async def ask() -> list[Reply]:
        model = open_model(name, settings)
        try:
            return await asyncio.gather(*(model.reply(PROMPT, number=number) for number in numbers))
        finally:
            await model.close()

    return run(ask())


def test_reply_ends_where_the_function_ends(reciter: Callable[..., str]) -> None:
    (reply,) = replies(reciter(OPENING, GO, SAY, OTHER), SamplingSettings(), 0)
    assert reply.text == (GO + SAY).rstrip("\n")
    assert reply.program == OPENING + GO + SAY
    assert reply.finish_reason == "stop"
    assert reply.usage.output_tokens == 3  # The last token showed that the function was over.
    assert reply.usage.input_tokens is not None
    assert reply.usage.input_tokens > 500
    assert (reply.latency_s or 0) > 0


def test_reply_ends_where_the_model_ends_it(reciter: Callable[..., str]) -> None:
    (reply,) = replies(reciter(OPENING, GO, SAY, END), SamplingSettings(), 0)
    assert (reply.text, reply.finish_reason) == (GO + SAY, "stop")
    assert reply.program == OPENING + GO + SAY


def test_reply_ends_at_the_limit(reciter: Callable[..., str]) -> None:
    (reply,) = replies(reciter(OPENING, GO), SamplingSettings(max_tokens=5), 0)
    assert (reply.text, reply.finish_reason) == (GO * 5, "length")
    assert reply.usage.output_tokens == 5


@pytest.mark.parametrize("template", [TEMPLATE, NO_SYSTEM])
def test_model_with_a_chat_template_is_given_messages(reciter: Callable[..., str], template: str) -> None:
    name = reciter("[assistant]", f"{FENCE}python\n", OPENING, GO, FENCE, END, template=template)
    (reply,) = replies(name, SamplingSettings(), 0)
    assert reply.text == f"{FENCE}python\n{OPENING}{GO}{FENCE}"
    assert reply.program == OPENING + GO
    assert reply.finish_reason == "stop"


def test_pieces_are_heard_in_order_and_are_the_reply(reciter: Callable[..., str], babbler: str) -> None:
    for name in (reciter(OPENING, GO, SAY, OTHER), babbler):
        heard: list[str] = []

        async def ask(name: str, heard: list[str]) -> Reply:
            model = open_model(name, SamplingSettings(max_tokens=60, temperature=1.0, seed=1))
            return await model.reply(PROMPT, number=0, on_text=heard.append)

        reply = run(ask(name, heard))
        assert "".join(heard) == reply.text
        assert len(heard) > 1


SEEDED = SamplingSettings(temperature=1.0, top_p=1.0, max_tokens=12, seed=5)


def test_with_a_seed_each_number_has_its_own_reply_wherever_a_run_was_resumed(babbler: str) -> None:
    numbers = range(SEED_BLOCK + 3)
    texts = [reply.text for reply in replies(babbler, SEEDED, *numbers)]
    assert len({*texts}) == len(numbers)
    for resumed in (numbers[4:], numbers[-1:], (3, 1)):
        assert [reply.text for reply in replies(babbler, SEEDED, *resumed)] == [texts[n] for n in resumed]


def test_replies_of_a_block_are_written_once(babbler: str) -> None:
    async def ask() -> list[int]:
        model: Any = open_model(babbler, SEEDED)
        generate, sizes = model.model.generate, []

        def watch(**options: Any) -> object:  # noqa: ANN401 - transformers is untyped here
            sizes.append(len(options["input_ids"]))
            return generate(**options)

        model.model.generate = watch
        for number in range(SEED_BLOCK + 1):
            await model.reply(PROMPT, number=number)
        return sizes

    assert run(ask()) == [SEED_BLOCK, SEED_BLOCK]


def test_without_a_seed_no_two_replies_are_alike_and_without_temperature_all_are(babbler: str) -> None:
    drawn = replies(babbler, SamplingSettings(temperature=1.0, max_tokens=12), 0, 0, 0)
    assert len({reply.text for reply in drawn}) == 3
    likeliest = replies(babbler, SamplingSettings(temperature=0.0, max_tokens=12), 0, 1, 2)
    assert len({reply.text for reply in likeliest}) == 1


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (SamplingSettings(), {"do_sample": True, "temperature": 0.2, "top_p": 0.95, "top_k": 0}),
        (SamplingSettings(temperature=None, top_p=None), {"do_sample": True, "top_k": 0}),
        (SamplingSettings(temperature=0.0), {"do_sample": False}),
    ],
)
def test_model_is_given_the_settings(
    babbler: str, settings: SamplingSettings, expected: dict[str, object]
) -> None:
    async def ask() -> dict[str, Any]:
        model: Any = open_model(babbler, settings)
        generate, given = model.model.generate, {}

        def watch(**options: Any) -> object:  # noqa: ANN401 - transformers is untyped here
            given.update(options)
            return generate(**{**options, "max_new_tokens": 1})

        model.model.generate = watch
        await model.reply(PROMPT, number=0)
        return given

    given = run(ask())
    names = ("do_sample", "temperature", "top_p", "top_k")
    assert {name: given[name] for name in names if given.get(name) is not None} == expected
    assert given["max_new_tokens"] == 512  # This is the limit of a base model.


def test_requests_that_wait_together_are_one_batch_and_fewer_where_memory_is_small(babbler: str) -> None:
    async def ask(most: int) -> tuple[list[int], list[Reply]]:
        model: Any = open_model(babbler, SamplingSettings(max_tokens=3, temperature=0.0))
        generate = model.model.generate
        sizes: list[int] = []

        def watch(**options: Any) -> object:  # noqa: ANN401 - transformers is untyped here
            sizes.append(len(options["input_ids"]))
            if sizes[-1] > most:
                raise torch.cuda.OutOfMemoryError("too small")
            return generate(**options)

        model.model.generate = watch
        asked = (model.reply(PROMPT, number=number) for number in range(6))
        return sizes, await asyncio.gather(*asked)

    sizes, together = run(ask(6))
    assert sizes == [6]
    sizes, apart = run(ask(2))
    assert sizes == [6, 3, 1, 2, 3, 1, 2]
    assert [reply.text for reply in apart] == [reply.text for reply in together]
    with pytest.raises(ModelError, match="not enough memory") as caught:
        run(ask(0))
    assert not caught.value.is_temporary


def test_error_of_the_model_reaches_the_caller(babbler: str) -> None:
    async def ask() -> None:
        model: Any = open_model(babbler, SamplingSettings())
        model.model.generate = None
        await model.reply(PROMPT, number=0)

    with pytest.raises(ModelError, match="not callable"):
        run(ask())


async def begin_and_cancel(model: Any) -> None:  # noqa: ANN401 - a private part of it is needed
    begun = asyncio.Event()
    task = asyncio.create_task(model.reply(PROMPT, number=0, on_text=lambda _piece: begun.set()))
    await begun.wait()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    await asyncio.wait_for(model._worker, 5)


def test_cancelled_requests_end_at_once(reciter: Callable[..., str]) -> None:
    run(begin_and_cancel(open_model(reciter(OPENING, GO), SamplingSettings(max_tokens=100_000))))


def test_cancelled_block_leaves_no_partial_replies(babbler: str) -> None:
    settings = replace(SEEDED, max_tokens=300)

    async def ask() -> str:
        model = open_model(babbler, settings)
        await begin_and_cancel(model)
        return (await model.reply(PROMPT, number=1)).text

    assert run(ask()) == replies(babbler, settings, 1)[0].text


def test_too_long_prompt_is_refused(babbler: str) -> None:
    async def ask() -> None:
        await open_model(babbler, SamplingSettings()).reply(prompt_for("Go. " * 5_000), number=0)

    with pytest.raises(ModelError, match=r"[\d,]+ tokens.* 4,096"):
        run(ask())


@pytest.mark.parametrize(
    ("path", "named"),
    [
        ("./nowhere", ["./nowhere", "no such model folder"]),
        ("{empty}", ["hf:{empty}", "loaded"]),
    ],
)
def test_folder_without_a_model_is_refused(tmp_path: Path, path: str, named: list[str]) -> None:
    with pytest.raises(UserError) as caught:
        open_model("hf:" + path.format(empty=tmp_path), SamplingSettings())
    assert all(name.format(empty=tmp_path) in str(caught.value) for name in named), caught.value


def test_local_model_refuses_a_base_url(babbler: str) -> None:
    with pytest.raises(UserError, match="base URL"):
        open_model(babbler, SamplingSettings(base_url="http://localhost:1/v1"))


def test_device_and_number_type_suit_this_machine(babbler: str) -> None:
    model: Any = open_model(babbler, SamplingSettings())
    where = next(model.model.parameters())
    assert where.device.type == model.device
    if torch.cuda.is_available():
        assert (model.device, where.dtype) == ("cuda", torch.bfloat16)
    elif not torch.backends.mps.is_available():
        assert (model.device, where.dtype) == ("cpu", torch.float32)
