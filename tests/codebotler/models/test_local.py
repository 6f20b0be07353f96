"""Real transformers models, made on the spot: one with random weights, others that know one text by heart."""

import asyncio
import math
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, TypeVar

import pytest

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError, Reply, SamplingSettings
from codebotler.models.open import open_model
from codebotler.prompts import prompt_for
from codebotler.prompts.rendering import OPENING

REASON = "torch and transformers are not installed; `make test-transformers` has them"
torch = pytest.importorskip("torch", reason=REASON)
transformers = pytest.importorskip("transformers", reason=REASON)
tokenizers = pytest.importorskip("tokenizers", reason=REASON)

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


def saved(folder: Path, tokenizer: Any, hidden: int, change: Callable[[Any], None]) -> str:  # noqa: ANN401 - transformers is untyped here
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
    return saved(tmp_path_factory.mktemp("babbler"), tokenizer, 32, lambda _model: None)


@pytest.fixture
def by_heart(tmp_path: Path, tokenizer: Any) -> Callable[..., str]:  # noqa: ANN401 - transformers is untyped here
    """Models in which each word of a list is followed by the next, and the last by itself."""

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
            return saved(tmp_path, tokenizer, size, change)
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


def test_reply_ends_where_the_function_ends(by_heart: Callable[..., str]) -> None:
    (reply,) = replies(by_heart(OPENING, GO, SAY, OTHER), SamplingSettings(), 0)
    assert reply.text == (GO + SAY).rstrip("\n")
    assert reply.program == OPENING + GO + SAY
    assert reply.finish_reason == "stop"
    assert reply.usage.output_tokens == 3  # the last one showed that the function was over
    assert reply.usage.input_tokens is not None
    assert reply.usage.input_tokens > 500
    assert reply.latency_s > 0


def test_reply_ends_where_the_model_ends_it(by_heart: Callable[..., str]) -> None:
    (reply,) = replies(by_heart(OPENING, GO, SAY, END), SamplingSettings(), 0)
    assert (reply.text, reply.finish_reason) == (GO + SAY, "stop")
    assert reply.program == OPENING + GO + SAY


def test_reply_ends_at_the_limit(by_heart: Callable[..., str]) -> None:
    (reply,) = replies(by_heart(OPENING, GO), SamplingSettings(max_tokens=5), 0)
    assert (reply.text, reply.finish_reason) == (GO * 5, "length")
    assert reply.usage.output_tokens == 5


@pytest.mark.parametrize("template", [TEMPLATE, NO_SYSTEM])
def test_model_with_a_chat_template_is_given_messages(by_heart: Callable[..., str], template: str) -> None:
    name = by_heart("[assistant]", f"{FENCE}python\n", OPENING, GO, FENCE, END, template=template)
    (reply,) = replies(name, SamplingSettings(), 0)
    assert reply.text == f"{FENCE}python\n{OPENING}{GO}{FENCE}"
    assert reply.program == OPENING + GO
    assert reply.finish_reason == "stop"


def test_pieces_are_heard_in_order_and_are_the_reply(by_heart: Callable[..., str], babbler: str) -> None:
    for name in (by_heart(OPENING, GO, SAY, OTHER), babbler):
        heard: list[str] = []

        async def ask(name: str, heard: list[str]) -> Reply:
            model = open_model(name, SamplingSettings(max_tokens=60, temperature=1.0, seed=1))
            return await model.reply(PROMPT, number=0, heard=heard.append)

        reply = run(ask(name, heard))
        assert "".join(heard) == reply.text
        assert len(heard) > 1


def test_with_a_seed_each_number_has_its_own_reply_whatever_it_is_asked_with(babbler: str) -> None:
    settings = SamplingSettings(temperature=1.0, top_p=1.0, max_tokens=12, seed=5)
    together = replies(babbler, settings, 0, 1, 2, 3)
    assert len({reply.text for reply in together}) == 4
    assert [replies(babbler, settings, number)[0].text for number in (3, 1)] == [
        together[3].text,
        together[1].text,
    ]
    (later,) = replies(babbler, SamplingSettings(temperature=1.0, top_p=1.0, max_tokens=12, seed=7), 1)
    assert later.text == together[3].text


def test_without_a_seed_no_two_replies_are_alike_and_without_temperature_all_are(babbler: str) -> None:
    drawn = replies(babbler, SamplingSettings(temperature=1.0, max_tokens=12), 0, 0, 0)
    assert len({reply.text for reply in drawn}) == 3
    likeliest = replies(babbler, SamplingSettings(temperature=0.0, max_tokens=12), 0, 1, 2)
    assert len({reply.text for reply in likeliest}) == 1


def test_draws_follow_the_temperature_and_the_share() -> None:
    from codebotler.models.local import _Draw, _generator  # noqa: PLC0415 - it imports torch

    scores = torch.tensor([[0.5, 0.3, 0.15, 0.05]]).log().repeat(4000, 1)
    dice = [_generator(number, "cpu") for number in range(4000)]
    cases: list[tuple[float, float, list[float]]] = [
        (1.0, 1.0, [0.5, 0.3, 0.15, 0.05]),
        (1.0, 0.7, [0.625, 0.375, 0, 0]),
        (1.0, 0.4, [1, 0, 0, 0]),
        (0.5, 1.0, [0.25 / 0.365, 0.09 / 0.365, 0.0225 / 0.365, 0.0025 / 0.365]),
        (0.0, 1.0, [1, 0, 0, 0]),
    ]
    for temperature, top_p, expected in cases:
        drawn: Any = _Draw(temperature, top_p, dice)(None, scores.clone())
        assert bool(((drawn == 0).sum(dim=-1) == 1).all())
        assert bool((drawn.isinf().sum(dim=-1) == 3).all())
        shares = (drawn == 0).float().mean(dim=0).tolist()
        assert shares == pytest.approx(expected, abs=0.035)
        assert [share == 0 for share in shares] == [share == 0 for share in expected]


def test_requests_that_wait_together_are_one_batch_and_fewer_where_memory_is_small(babbler: str) -> None:
    async def ask(most: int) -> tuple[list[int], list[Reply]]:
        model: Any = open_model(babbler, SamplingSettings(max_tokens=3, seed=1))
        generate = model.model.generate
        sizes: list[int] = []

        def watched(**options: Any) -> object:  # noqa: ANN401 - transformers is untyped here
            sizes.append(len(options["input_ids"]))
            if sizes[-1] > most:
                raise torch.cuda.OutOfMemoryError("too small")
            return generate(**options)

        model.model.generate = watched
        asked = (model.reply(PROMPT, number=number) for number in range(6))
        return sizes, await asyncio.gather(*asked)

    sizes, together = run(ask(6))
    assert sizes == [6]
    sizes, apart = run(ask(2))
    assert sizes == [6, 3, 1, 2, 3, 1, 2]
    assert [reply.text for reply in apart] == [reply.text for reply in together]
    with pytest.raises(ModelError, match="memory is too small") as caught:
        run(ask(0))
    assert not caught.value.may_pass


def test_error_of_the_model_reaches_who_waits(babbler: str) -> None:
    async def ask() -> None:
        model: Any = open_model(babbler, SamplingSettings())
        model.model.generate = None
        await model.reply(PROMPT, number=0)

    with pytest.raises(ModelError, match="not callable"):
        run(ask())


def test_given_up_requests_end_at_once(babbler: str) -> None:
    async def ask() -> None:
        model = open_model(babbler, SamplingSettings(max_tokens=100_000, temperature=1.0))
        begun = asyncio.Event()
        task = asyncio.create_task(model.reply(PROMPT, number=0, heard=lambda _piece: begun.set()))
        await begun.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        await asyncio.wait_for(model.close(), 5)

    run(ask())


def test_prompt_that_is_too_long_is_told(babbler: str) -> None:
    async def ask() -> None:
        await open_model(babbler, SamplingSettings()).reply(prompt_for("Go. " * 5_000), number=0)

    with pytest.raises(ModelError, match=r"[\d,]+ tokens.* 4,096"):
        run(ask())


@pytest.mark.parametrize(
    ("path", "named"),
    [
        ("./nowhere", ["./nowhere", "no such folder"]),
        ("{empty}", ["hf:{empty}", "loaded"]),
    ],
)
def test_what_is_no_model_is_told_in_a_sentence(tmp_path: Path, path: str, named: list[str]) -> None:
    with pytest.raises(UserError) as caught:
        open_model("hf:" + path.format(empty=tmp_path), SamplingSettings())
    assert all(name.format(empty=tmp_path) in str(caught.value) for name in named), caught.value


def test_base_url_means_nothing_here(babbler: str) -> None:
    with pytest.raises(UserError, match="--base-url"):
        open_model(babbler, SamplingSettings(base_url="http://localhost:1/v1"))


def test_device_and_numbers_are_what_this_machine_has(babbler: str) -> None:
    model: Any = open_model(babbler, SamplingSettings())
    where = next(model.model.parameters())
    assert where.device.type == model.device
    if torch.cuda.is_available():
        assert (model.device, where.dtype) == ("cuda", torch.bfloat16)
    elif not torch.backends.mps.is_available():
        assert (model.device, where.dtype) == ("cpu", torch.float32)
