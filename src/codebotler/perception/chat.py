"""Uses chat models as detectors: they receive an image and reply with a small JSON object."""

from __future__ import annotations

import asyncio
import json
import re
from pathlib import Path

from PIL.Image import Image
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from codebotler.models.base import Model, ModelError
from codebotler.models.rate_limit import RateLimited
from codebotler.models.servers.server_errors import error_text
from codebotler.perception.base import PerceptionError, Sighting, clean_label
from codebotler.perception.image import encode_jpeg
from codebotler.prompts import PictureMessage, Prompt, PromptMessage

DETECTOR_PROMPT = Path(__file__).with_name("detector.txt").read_text()
RETRY_PROMPT = "That cannot be used: {fault}. Answer again, with only the JSON object."
MAX_REPLIES = 3  # attempts to get a valid reply
REQUEST_RETRIES = 2  # retries of each request while the server is down or busy
MAX_REPLY_CHARACTERS = 20_000
FENCED_JSON = re.compile(r"```(?:json)?[^\S\n]*\n(.*)\n[^\S\n]*```", re.DOTALL)


class ChatDetector:
    """Looks for objects and people by asking a chat model. Only one thread at a time may use it."""

    def __init__(self, model: Model) -> None:
        self.name = model.name
        self._runner = asyncio.Runner()
        self._model = RateLimited(model, retries=REQUEST_RETRIES)

    def look(self, image: Image, label: str) -> Sighting:
        """Look for a label in an image. Raise PerceptionError if the model fails or 3 replies are invalid."""
        question = PictureMessage("user", json.dumps(clean_label(label)), encode_jpeg(image))
        messages: tuple[PromptMessage, ...] = (PromptMessage("system", DETECTOR_PROMPT), question)
        fault = text = ""
        for number in range(MAX_REPLIES):
            prompt = Prompt(label, messages, text="", stop=(), opening="")
            try:
                reply = self._runner.run(self._model.reply(prompt, number=number))
            except ModelError as error:
                raise PerceptionError(error.sentence) from None
            try:
                return parse_sighting(reply.text)
            except ValueError as error:
                fault, text = str(error), reply.text.strip()[:MAX_REPLY_CHARACTERS]
            answer = [PromptMessage("assistant", text)] if text else []
            messages = (*messages[:2], *answer, PromptMessage("user", RETRY_PROMPT.format(fault=fault)))
        last = f"; the last reply was: {error_text(text)}" if text else ""
        raise PerceptionError(f"{self.name} gave no valid reply in {MAX_REPLIES} attempts: {fault}{last}")

    def close(self) -> None:
        """Close the connections to the model's server."""
        self._runner.run(self._model.close())
        self._runner.close()


class _DetectorAnswer(BaseModel):
    model_config = ConfigDict(strict=True)

    found: bool
    score: FiniteFloat
    box: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] | None = None


def parse_sighting(text: str) -> Sighting:
    """Parse a model's JSON reply, which may be in a code fence. Raise ValueError if the reply is invalid."""
    if len(text) > MAX_REPLY_CHARACTERS:
        raise ValueError(f"the reply has {len(text):,} characters; use at most {MAX_REPLY_CHARACTERS:,}")
    fenced = FENCED_JSON.fullmatch(text.strip())
    try:
        answer = _DetectorAnswer.model_validate_json(fenced[1] if fenced else text)
    except ValidationError as error:
        first = error.errors()[0]
        fault = f'"{first["loc"][0]}": {first["msg"]}' if first["loc"] else "the reply is not a JSON object"
        raise ValueError(fault) from None
    if not answer.found:
        return Sighting(found=False, box=None, score=answer.score)
    if answer.box is None:
        raise ValueError('"found" is true, but "box" is missing')
    return Sighting(found=True, box=answer.box, score=answer.score)
