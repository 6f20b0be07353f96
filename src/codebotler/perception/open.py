"""Opens a detector by the name of its model."""

from __future__ import annotations

from codebotler.core.errors import UserError, installed
from codebotler.models.open import kind_of
from codebotler.models.sampling import SamplingSettings
from codebotler.perception.base import Detector

LOOKING = SamplingSettings(temperature=0.0, top_p=None, timeout=30.0)
"""How a chat model is asked by default; a reasoning model thinks within the tokens, too."""

LEAST_SCORE = 0.1


def open_detector(
    name: str, settings: SamplingSettings = LOOKING, *, least_score: float = LEAST_SCORE
) -> Detector:
    """Open a detector by the name of its model.

    Args:
        name: `provider:name` of a chat model that sees, as in pydantic-ai, or `hf:PATH` for a zero-shot
            object detector of transformers: a folder, or a name on the Hugging Face hub.
        settings: how a chat model is asked.
        least_score: the score, above 0 and up to 1, from which a zero-shot detector has found something.

    Raises:
        UserError: there is no such model, it sees nothing, a key is not in the environment, or something is
            not installed.
    """
    kind = kind_of(name)
    if kind in {"recorded", "completions"}:
        raise UserError(f"{name} does not accept pictures; use a chat model that does, or hf:PATH")
    # Each of the modules imports a large library, and is imported only where it is used.
    if kind != "hf":
        with installed():
            from codebotler.models.chat import ChatModel  # noqa: PLC0415 - see above
        from codebotler.perception.chat import ChatDetector  # noqa: PLC0415 - see above

        return ChatDetector(ChatModel(name, settings))
    with installed():
        from codebotler.perception.zeroshot import ZeroShotDetector  # noqa: PLC0415 - see above
    return ZeroShotDetector(name.partition(":")[2], least_score=least_score)
