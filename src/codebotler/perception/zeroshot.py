"""Runs zero-shot object detectors from transformers, such as OWL-ViT."""

from __future__ import annotations

import os
from typing import Any

import torch
import transformers
from PIL.Image import Image

from codebotler.core.errors import UserError
from codebotler.models.keys import guard_logs
from codebotler.models.local import find_source
from codebotler.models.servers.server_errors import error_text
from codebotler.perception.base import PerceptionError, Sighting, clean_label

PIPELINE_TASK = "zero-shot-object-detection"


class ZeroShotDetector:
    """Looks for objects and people with a zero-shot model in this process, on a GPU if there is one."""

    def __init__(self, path: str, *, least_score: float) -> None:
        self.name = f"hf:{path}"
        if not 0 < least_score <= 1:
            raise UserError(f"the least score {least_score:g} is invalid; use one above 0 and at most 1")
        self._least = least_score
        source = find_source(path)
        transformers.utils.logging.disable_progress_bar()
        os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")  # avoids a warning for every label
        try:
            device = 0 if torch.cuda.is_available() else "cpu"
            self._pipeline: Any = transformers.pipeline(PIPELINE_TASK, model=source, device=device)
        except Exception as error:  # noqa: BLE001 - a model's own code and files may raise any error
            raise UserError(
                f"{self.name} cannot be loaded as a zero-shot detector: {error_text(error)}"
            ) from None
        guard_logs()
        if not all(bool(torch.isfinite(weight).all()) for weight in self._pipeline.model.parameters()):
            raise UserError(f"{self.name} has weights that are infinite or not numbers; use another model")

    def look(self, image: Image, label: str) -> Sighting:
        """Look for a label in an image. The best match counts if its score is at least `least_score`."""
        words = clean_label(label)
        self._check_length(words)
        try:
            # Pass a list because the pipeline splits a string at commas.
            places = self._pipeline(image, candidate_labels=[words], threshold=0.0, top_k=1)
        except Exception as error:  # noqa: BLE001 - a model's own code may raise any error
            raise PerceptionError(f"{self.name} failed: {error_text(error)}") from None
        if not places:
            return Sighting(found=False, box=None, score=0.0)
        score, box = float(places[0]["score"]), places[0]["box"]
        if score < self._least:
            return Sighting(found=False, box=None, score=score)
        width, height = image.size
        left, right = _to_shares(box["xmin"], box["xmax"], width)
        top, bottom = _to_shares(box["ymin"], box["ymax"], height)
        return Sighting(found=True, box=(left, top, right, bottom), score=score)

    def close(self) -> None:
        """Release the model's memory. The detector cannot be used afterwards."""
        del self._pipeline

    def _check_length(self, words: str) -> None:
        length = len(self._pipeline.tokenizer(words)["input_ids"])
        text = getattr(self._pipeline.model.config, "text_config", None)
        most = getattr(text, "max_position_embeddings", None) or length
        if length > most:
            raise UserError(f'the label "{words}" has {length} tokens, but {self.name} reads at most {most}')


def _to_shares(first: int, last: int, side: int) -> tuple[float, float]:
    """Convert two edges from pixels to fractions of a side, clipped to the image."""
    start = min(max(first, 0), side - 1)
    end = min(max(last, start + 1), side)
    return start / side, end / side
