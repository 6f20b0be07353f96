"""The detector runs a real OWL-ViT, made on the spot with random weights."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from codebotler.core.errors import UserError
from codebotler.perception import Detector, PerceptionError, open_detector

REASON = "torch and transformers are not installed; `make test-transformers` has them"
torch = pytest.importorskip("torch", reason=REASON)
transformers = pytest.importorskip("transformers", reason=REASON)
tokenizers = pytest.importorskip("tokenizers", reason=REASON)

SIDE, TOKENS = 32, 16
PICTURE = Image.radial_gradient("L").resize((64, 40)).convert("RGB")
SMALL = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Save a model the way its makers would."""
    torch.manual_seed(8)  # With this seed, no score is near 0 or 1.
    letters = sorted(tokenizers.pre_tokenizers.ByteLevel.alphabet())
    words = [*letters, *(f"{letter}</w>" for letter in letters), "<|startoftext|>", "<|endoftext|>"]
    vocabulary = {word: number for number, word in enumerate(words)}
    ends = {"bos_token_id": len(words) - 2, "eos_token_id": len(words) - 1, "pad_token_id": 0}
    config = transformers.OwlViTConfig(
        text_config={**SMALL, **ends, "vocab_size": len(words), "max_position_embeddings": TOKENS},
        vision_config={**SMALL, "image_size": SIDE, "patch_size": 8},
        projection_dim=16,
    )
    folder = tmp_path_factory.mktemp("owl")
    model = transformers.OwlViTForObjectDetection(config)
    model.box_head.dense2.weight.data *= 0.01  # Otherwise each box is a line at an edge.
    model.save_pretrained(folder)
    transformers.CLIPTokenizer(vocab=vocabulary, merges=[]).save_pretrained(folder)
    transformers.OwlViTImageProcessorPil(size={"height": SIDE, "width": SIDE}).save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def detector(folder: Path) -> Detector:
    return open_detector(f"hf:{folder}", least_score=1e-6)


def detect_directly(folder: Path, label: str) -> tuple[float, list[float]]:
    """Return the best score and its box, from the model without the pipeline."""
    model = transformers.OwlViTForObjectDetection.from_pretrained(folder).eval()
    processor = transformers.OwlViTImageProcessorPil.from_pretrained(folder)
    tokens = transformers.CLIPTokenizer.from_pretrained(folder)(label, return_tensors="pt")
    with torch.inference_mode():
        out = model(**tokens, **processor(PICTURE, return_tensors="pt"))
    scores = out.logits[0, :, 0].sigmoid()
    best = int(scores.argmax())
    across, down, width, height = out.pred_boxes[0, best].tolist()
    edges = (across - width / 2, down - height / 2, across + width / 2, down + height / 2)
    return float(scores[best]), [min(max(edge, 0), 1) for edge in edges]


@pytest.mark.parametrize("label", ["mug", "red mug", "a, b, c", "ü 漢", "ignore all, true"])
def test_detector_gives_the_model_the_whole_label(folder: Path, detector: Detector, label: str) -> None:
    score, edges = detect_directly(folder, label)
    sighting = detector.look(PICTURE, f" {label}\n")
    assert sighting.found
    assert sighting.score == pytest.approx(score, abs=1e-5)
    assert sighting.box is not None
    left, top, right, bottom = sighting.box
    assert min(right - left, bottom - top) > 0.1
    # Pipelines round boxes to whole pixels.
    assert sighting.box == pytest.approx(edges, abs=1 / 40)


def test_score_below_the_threshold_is_not_found(folder: Path, detector: Detector) -> None:
    score = detector.look(PICTURE, "mug").score
    assert 0.1 < score < 0.9
    unsure = open_detector(f"hf:{folder}", least_score=(score + 1) / 2).look(PICTURE, "mug")
    assert (unsure.found, unsure.box) == (False, None)
    assert unsure.score == pytest.approx(score)


def test_label_of_too_many_words_is_refused(detector: Detector) -> None:
    detector.look(PICTURE, "x" * (TOKENS - 2))
    with pytest.raises(UserError, match=rf"{TOKENS + 1} tokens, but hf:.* {TOKENS}$"):
        detector.look(PICTURE, "x" * (TOKENS - 1))
    with pytest.raises(UserError, match="printable characters"):
        detector.look(PICTURE, " ")


def test_error_of_the_model_becomes_one_sentence(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    detector: Any = open_detector(f"hf:{folder}")
    monkeypatch.setattr(detector._pipeline.model, "forward", lambda **_: 1 / 0)
    with pytest.raises(PerceptionError, match="division by zero") as error:
        detector.look(PICTURE, "mug")
    assert error.value.sentence.startswith(f"hf:{folder} failed: ")
    detector.close()


def test_folder_without_a_detector_is_refused(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(UserError, match="no such model folder"):
        open_detector(f"hf:{tmp_path / 'none'}")
    with pytest.raises(UserError, match="detector"):
        open_detector(f"hf:{tmp_path}")
    for score in (0.0, 1.5, math.nan):
        with pytest.raises(UserError, match="above 0 and at most 1"):
            open_detector(f"hf:{folder}", least_score=score)
    config = transformers.LlamaConfig(vocab_size=8, **SMALL)
    transformers.LlamaForCausalLM(config).save_pretrained(tmp_path)
    with pytest.raises(UserError, match="detector"):
        open_detector(f"hf:{tmp_path}")


def test_box_is_clipped_to_the_picture() -> None:
    from codebotler.perception.zeroshot import _to_shares  # noqa: PLC0415 - it imports torch

    assert _to_shares(-7, 20, 40) == (0, 0.5)
    assert _to_shares(30, 55, 40) == (0.75, 1)
    assert _to_shares(40, 40, 40) == (39 / 40, 1)
    assert _to_shares(10, 10, 40) == (0.25, 11 / 40)


def test_broken_weights_are_refused(tmp_path: Path, folder: Path) -> None:
    broken = shutil.copytree(folder, tmp_path / "broken")
    model = transformers.OwlViTForObjectDetection.from_pretrained(folder)
    model.class_head.dense0.weight.data[0, 0] = math.nan
    model.save_pretrained(broken)
    with pytest.raises(UserError, match="weights"):
        open_detector(f"hf:{broken}")
