"""Trains a tiny model with TRL, made on the spot, and compares rewards with those of the library."""

from __future__ import annotations

import re
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest
import tokenizers
import torch
import transformers
import trl
from codebotler_trl import load_prompts, parses, passed, reward, without_errors

from codebotler.simulator.worker import EngineError
from roboeval.suites.families.tasks import trained_task
from roboeval.training import rollouts

FAMILY = "BringThing"
END = "<end>"


def columns(rows: Any) -> dict[str, list[Any]]:  # noqa: ANN401 - of a data set
    return {name: rows[name] for name in ("family", "seed", "prompt_index", "opening")}


def test_rewards_of_right_and_idle_programs_as_chats_and_as_texts() -> None:
    rows = load_prompts("train", count=3, only=[FAMILY])
    right = [trained_task(row["family"], row["seed"]).solution for row in rows]
    chats = [[{"role": "assistant", "content": f"Here it is:\n```python\n{one}```"}] for one in right]
    assert reward(chats, prompts=rows["prompt"], **columns(rows)) == [1.0] * 3
    assert passed(chats, **columns(rows)) == [1.0] * 3
    texts = load_prompts("train", count=3, only=[FAMILY], form="text")
    continued = [one.removeprefix(texts[0]["opening"]) for one in right]
    assert reward(continued, **columns(texts)) == [1.0] * 3
    idle = ["    pass\n", "    go_to(\n", "    go_to('nowhere')\n"]
    assert reward(idle, **columns(texts)) == [0.0] * 3
    assert parses(idle, **columns(texts)) == [1.0, 0.0, 1.0]
    assert without_errors(idle, **columns(texts)) == [1.0, 0.0, 0.0]


def test_a_failure_of_the_engine_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> object:
        raise EngineError("no process can be started")

    monkeypatch.setattr(rollouts, "_judge_batch", broken)
    rows = load_prompts("train", count=1, seed=77, only=[FAMILY])
    with pytest.raises(EngineError, match="no process"):
        reward(["    say('a')\n"], **columns(rows))


# --- a real training run


def model_and_tokenizer(lines: list[str]) -> tuple[Any, Any]:
    """A model so small that it has a token for each line of a program, and one for each byte of a prompt."""
    made = tokenizers.Tokenizer(tokenizers.models.BPE())
    made.pre_tokenizer = tokenizers.pre_tokenizers.ByteLevel(add_prefix_space=False)
    made.decoder = tokenizers.decoders.ByteLevel()
    alphabet = tokenizers.pre_tokenizers.ByteLevel.alphabet()
    made.train_from_iterator(
        [], tokenizers.trainers.BpeTrainer(special_tokens=["<pad>", END], initial_alphabet=alphabet)
    )
    made.add_tokens([tokenizers.AddedToken(line, normalized=False) for line in lines])
    tokenizer = transformers.PreTrainedTokenizerFast(tokenizer_object=made, pad_token="<pad>", eos_token=END)
    torch.manual_seed(0)
    config = transformers.LlamaConfig(
        vocab_size=len(tokenizer), hidden_size=64, intermediate_size=128, num_hidden_layers=2,
        num_attention_heads=2, max_position_embeddings=8192, bos_token_id=None,
        eos_token_id=tokenizer.eos_token_id, pad_token_id=tokenizer.pad_token_id,
    )  # fmt: skip
    model = transformers.LlamaForCausalLM(config)
    with torch.no_grad():  # it babbles in lines, not in bytes
        head = torch.full((len(tokenizer), 1), -1.0)
        head[[tokenizer.eos_token_id, *tokenizer.convert_tokens_to_ids(lines)]] = 0.0
        model.lm_head = torch.nn.Linear(64, len(tokenizer), bias=True)
        model.lm_head.bias.copy_(20 * head[:, 0])
    return model, tokenizer


@pytest.mark.filterwarnings("ignore")  # libraries' own
def test_the_reward_of_a_tiny_model_rises(tmp_path: Path) -> None:
    rows = load_prompts("train", count=1, only=["AnnounceInOrder"], form="text")
    opening, solution = rows[0]["opening"], trained_task("AnnounceInOrder", rows[0]["seed"]).solution
    message, *rooms = sorted(re.findall(r'"(.*?)"', solution), key=len, reverse=True)
    model, tokenizer = model_and_tokenizer(
        [*(f'    go_to("{room}")\n' for room in rooms), f'    say("{message}")\n']
    )
    asked = rows.map(lambda _: {"prompt": opening})  # all that fits into so small a head
    config = trl.GRPOConfig(
        output_dir=str(tmp_path), max_steps=80, per_device_train_batch_size=32, num_generations=32,
        max_completion_length=8, learning_rate=1e-3, lr_scheduler_type="constant", logging_steps=1,
        reward_weights=[1.0, 0.0], report_to=[], save_strategy="no", use_cpu=True, seed=1, beta=0.0,
        remove_unused_columns=False, bf16=False,
    )  # fmt: skip
    trainer = trl.GRPOTrainer(
        model=model, reward_funcs=[reward, passed], args=config, train_dataset=asked,
        processing_class=tokenizer,
    )  # fmt: skip
    trainer.train()
    told = [log["rewards/reward/mean"] for log in trainer.state.log_history if "rewards/reward/mean" in log]
    assert fmean(told[:5]) < 0.4
    assert fmean(told[-5:]) > 0.8
