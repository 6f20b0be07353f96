"""From the name of a model to what looks for things by it."""

from __future__ import annotations

from codebotler.core.errors import UserError
from codebotler.models.base import SamplingSettings
from codebotler.models.open import EXTRA, kind_of
from codebotler.perception.base import Detector

LOOKING = SamplingSettings(temperature=0.0, top_p=None, max_tokens=2000, timeout=30.0)
"""How a chat model is asked by default; one that reasons thinks within the tokens, too."""

LEAST_SCORE = 0.1
"""From which score on a zero-shot detector has found something, by default."""

BLIND = ("recorded", "completions")


def open_detector(
    name: str, settings: SamplingSettings = LOOKING, *, least_score: float = LEAST_SCORE
) -> Detector:
    """What looks for things in pictures by the model of a name.

    Args:
        name: `provider:name` of a chat model that sees, as pydantic-ai spells it, or `hf:PATH` for a
            zero-shot object detector of transformers: a folder, or a name on the Hugging Face hub.
        settings: how a chat model is to be asked.
        least_score: from which score on, above 0 and up to 1, a zero-shot detector has found something.

    Raises:
        UserError: there is no such model, it sees nothing, a key is not in the environment, or something is
            not installed.
    """
    kind = kind_of(name)
    if kind in BLIND:
        raise UserError(f"{name} sees no pictures; name a chat model that does, or hf:PATH")
    # Each of these imports a large library, which only who uses it should wait for.
    if kind != "hf":
        from codebotler.models.chat import Chat  # noqa: PLC0415 - see above
        from codebotler.perception.chat import ChatDetector  # noqa: PLC0415 - see above

        return ChatDetector(Chat(name, settings))
    try:
        from codebotler.perception.zeroshot import ZeroShot  # noqa: PLC0415 - see above
    except ImportError:
        raise UserError(f"{name} needs torch and transformers; install them with: {EXTRA}") from None
    return ZeroShot(name.partition(":")[2], least_score=least_score)
