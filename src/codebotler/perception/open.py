"""Opens the detector for a model's name."""

from __future__ import annotations

from codebotler.core.errors import UserError, installed
from codebotler.models.open import kind_of
from codebotler.models.sampling import SamplingSettings
from codebotler.perception.base import Detector

DETECTOR_SETTINGS = SamplingSettings(temperature=0.0, top_p=None, timeout=30.0)
"""The default sampling settings of a chat model that is used as a detector."""
MIN_SCORE = 0.1


def open_detector(
    name: str, settings: SamplingSettings = DETECTOR_SETTINGS, *, least_score: float = MIN_SCORE
) -> Detector:
    """Open the detector for a model's name.

    Args:
        name: `provider:name` of a chat model that accepts images, as in pydantic-ai, or `hf:PATH` of a
            zero-shot object detector: a folder, or a name on the Hugging Face hub.
        settings: sampling settings, used by chat models only.
        least_score: the lowest score, above 0 and at most 1, at which a zero-shot detector says "found".

    Raises:
        UserError: the model does not exist or does not accept images, or a key or package is missing.
    """
    kind = kind_of(name)
    if kind in {"recorded", "completions"}:
        raise UserError(f"{name} does not accept pictures; use a chat model that accepts them, or hf:PATH")
    # Each of these modules imports a large library, so import only the one needed.
    if kind != "hf":
        with installed():
            from codebotler.models.servers.chat import ChatModel  # noqa: PLC0415 - see above
        from codebotler.perception.chat import ChatDetector  # noqa: PLC0415 - see above

        return ChatDetector(ChatModel(name, settings))
    with installed():
        from codebotler.perception.zeroshot import ZeroShotDetector  # noqa: PLC0415 - see above
    return ZeroShotDetector(name.partition(":")[2], least_score=least_score)
