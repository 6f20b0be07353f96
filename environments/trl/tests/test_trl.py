"""Train a tiny model with TRL and compare its rewards with those of the library."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest
import tokenizers
import torch
import transformers
import trl
from codebotler_trl import (
    MissionEnvironment,
    load_missions,
    load_prompts,
    parses,
    passed,
    reward,
    without_errors,
)
from trl import chat_template_utils

from codebotler.simulator.worker import EngineError
from roboeval.evaluation import rewards
from roboeval.suites.families.tasks import trained_task
from roboeval.training.missions import TrainingMission, mission_tools
from roboeval.training.prompts import PolicyReply

FAMILY, AGENT_FAMILY = "BringThing", "AnnounceInOrder"  # Solutions of the latter have no branches.
END = "<end>"
IDENTITY = ("family", "seed", "prompt_index", "world")


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
    def raise_error(*_: object) -> object:
        raise EngineError("no process can be started")

    monkeypatch.setattr(rewards, "judge_batch", raise_error)
    rows = load_prompts("train", count=1, seed=77, only=[FAMILY])
    with pytest.raises(EngineError, match="no process"):
        reward(["    say('a')\n"], **columns(rows))


# --- missions of agents


def right_calls(row: dict[str, Any]) -> list[tuple[str, dict[str, str]]]:
    program = trained_task(row["family"], row["seed"]).solution
    rooms, message = re.findall(r"\[.*\]", program)[0], re.findall(r'say\("(.*)"\)', program)[0]
    each = [(("go_to", {"location": room}), ("say", {"message": message})) for room in json.loads(rooms)]
    return [call for calls in each for call in calls]


def act_in_environment(row: dict[str, Any], calls: list[tuple[str, dict[str, Any]]]) -> MissionEnvironment:
    environment = MissionEnvironment()
    environment.reset(**row)
    for name, arguments in calls:
        getattr(environment, name)(**arguments)
    return environment


def test_the_methods_are_the_tools_of_missions() -> None:
    methods = [name for name, _ in inspect.getmembers(MissionEnvironment, inspect.isfunction)]
    public = {name for name in methods if not name.startswith("_")} - {"reset"}
    assert public == {tool["function"]["name"] for tool in mission_tools()}
    for tool in mission_tools():
        function = tool["function"]
        schema = transformers.utils.get_json_schema(getattr(MissionEnvironment(), function["name"]))
        made, properties = schema["function"]["parameters"], function["parameters"]["properties"]
        assert schema["function"]["description"] == function["description"]
        assert made.get("required", []) == function["parameters"]["required"]
        assert made["properties"].keys() == properties.keys()
        assert all(one.items() <= made["properties"][name].items() for name, one in properties.items())


def test_a_mission_is_judged_by_its_calls_and_by_how_the_conversation_ends() -> None:
    row = load_missions("train", count=1, only=[AGENT_FAMILY])[0]
    calls = right_calls(row)
    answer = [{"role": "tool", "content": "done"}, {"role": "assistant", "content": "Done."}]
    cut = [{"role": "assistant", "content": "", "tool_calls": [{"function": {"name": "say"}}]}]
    some: list[tuple[list[Any], PolicyReply]] = [
        (calls, answer), (calls[:2], answer), ([], answer), (calls, cut), (calls, answer[:1])
    ]  # fmt: skip
    environments = [act_in_environment(row, made) for made, _ in some]
    completions = [completion for _, completion in some]
    rewards = reward(completions, environments=environments, **columns(load_prompts("train", count=5)))
    part = TrainingMission.begin(row)
    for call in calls[:2]:
        part.call(*call)
    assert rewards == [1, part.components.reward, 0, 0.5, 0.5]
    assert passed(completions, environments=environments) == [1, 0, 0, 0, 0]
    assert without_errors(completions, environments=environments) == [1, 1, 1, 0, 0]


# --- real training runs


def make_model_and_tokenizer(lines: list[str], end: str = END, text: str = "") -> tuple[Any, Any]:
    """Make a small model with a token for each line, one for each byte, and those of a text."""
    torch.set_num_threads(1)  # Several threads are far slower on a small model.
    made = tokenizers.Tokenizer(tokenizers.models.BPE())
    made.pre_tokenizer = tokenizers.pre_tokenizers.ByteLevel(add_prefix_space=False)
    made.decoder = tokenizers.decoders.ByteLevel()
    alphabet = tokenizers.pre_tokenizers.ByteLevel.alphabet()
    made.train_from_iterator(
        [text], tokenizers.trainers.BpeTrainer(special_tokens=["<pad>", end], initial_alphabet=alphabet)
    )
    made.add_tokens([tokenizers.AddedToken(line, normalized=False) for line in lines])
    tokenizer = transformers.PreTrainedTokenizerFast(tokenizer_object=made, pad_token="<pad>", eos_token=end)
    torch.manual_seed(0)
    config = transformers.LlamaConfig(
        vocab_size=len(tokenizer), hidden_size=64, intermediate_size=128, num_hidden_layers=2,
        num_attention_heads=2, max_position_embeddings=8192, bos_token_id=None,
        eos_token_id=tokenizer.eos_token_id, pad_token_id=tokenizer.pad_token_id,
    )  # fmt: skip
    model = transformers.LlamaForCausalLM(config)
    with torch.no_grad():  # The bias makes it write lines instead of bytes.
        head = torch.full((len(tokenizer), 1), -1.0)
        head[[tokenizer.eos_token_id, *tokenizer.convert_tokens_to_ids(lines)]] = 0.0
        model.lm_head = torch.nn.Linear(64, len(tokenizer), bias=True)
        model.lm_head.bias.copy_(20 * head[:, 0])
    return model, tokenizer


@pytest.mark.filterwarnings("ignore")  # The warnings are the libraries' own.
def test_the_reward_of_a_tiny_model_rises(tmp_path: Path) -> None:
    rows = load_prompts("train", count=1, only=["AnnounceInOrder"], form="text")
    opening, solution = rows[0]["opening"], trained_task("AnnounceInOrder", rows[0]["seed"]).solution
    message, *rooms = sorted(re.findall(r'"(.*?)"', solution), key=len, reverse=True)
    model, tokenizer = make_model_and_tokenizer(
        [*(f'    go_to("{room}")\n' for room in rooms), f'    say("{message}")\n']
    )
    asked = rows.map(lambda _: {"prompt": opening})  # Longer prompts do not fit a small model.
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
    means = [log["rewards/reward/mean"] for log in trainer.state.log_history if "rewards/reward/mean" in log]
    assert fmean(means[:5]) < 0.4
    assert fmean(means[-5:]) > 0.8


def replayed(completions: list[list[dict[str, Any]]], **columns: list[Any]) -> list[float]:
    """Compute the rewards of missions that repeat the calls of conversations."""
    rewards = []
    for number, completion in enumerate(completions):
        mission = TrainingMission.begin({name: columns[name][number] for name in IDENTITY})
        for call in [call for message in completion for call in message.get("tool_calls") or []]:
            mission.call(call["function"]["name"], call["function"]["arguments"])
        if not completion[-1].get("tool_calls"):
            mission.answer("")
        mission.stop()
        rewards.append(mission.components.reward)
    return rewards


@pytest.mark.filterwarnings("ignore")  # The warnings are the libraries' own.
def test_a_tiny_model_calls_tools_in_training(tmp_path: Path) -> None:
    rows = load_missions("train", count=1, only=[AGENT_FAMILY])
    calls = [json.dumps({"name": name, "arguments": given}) for name, given in right_calls(rows[0])]
    texts = [f"<tool_call>\n{call}\n</tool_call>" for call in dict.fromkeys(calls)]
    text = json.dumps([rows[0]["prompt"], mission_tools()], indent=1)
    model, tokenizer = make_model_and_tokenizer(texts, "<|im_end|>", text)
    tokenizer.chat_template = chat_template_utils.qwen3_chat_template
    config = trl.GRPOConfig(
        output_dir=str(tmp_path), max_steps=2, per_device_train_batch_size=8, num_generations=8,
        max_completion_length=512, max_tool_calling_iterations=6, learning_rate=1e-3, logging_steps=1,
        reward_weights=[1.0, 0.0], report_to=[], save_strategy="no", use_cpu=True, seed=1, beta=0.0,
        remove_unused_columns=False, bf16=False,
    )  # fmt: skip
    trainer = trl.GRPOTrainer(
        model=model, reward_funcs=[reward, replayed], args=config, train_dataset=rows,
        processing_class=tokenizer, environment_factory=MissionEnvironment,
    )  # fmt: skip
    trainer.train()
    logs = [log for log in trainer.state.log_history if "rewards/reward/mean" in log]
    assert len(logs) == 2
    assert all(log["tools/call_frequency"] > 1 for log in logs)
    assert all(log["tools/failure_frequency"] == 0 for log in logs)
    assert all(0 < log["rewards/reward/mean"] < 1 for log in logs)
    assert all(log["rewards/replayed/mean"] == log["rewards/reward/mean"] for log in logs)
