"""A picture that is red on the left and blue on the right, and a model that sees a mug on the blue."""

from __future__ import annotations

import base64
import io
import json

from PIL import Image

from codebotler.perception import decode_image
from server import Request

RED, BLUE = (254, 0, 0), (0, 0, 254)
BOX = [0.5, 0.0, 1.0, 1.0]


def halves() -> Image.Image:
    image = Image.new("RGB", (64, 32), RED)
    image.paste(BLUE, (32, 0, 64, 32))
    return image


def encoded(kind: str) -> bytes:
    file = io.BytesIO()
    halves().save(file, kind, quality=95)
    return file.getvalue()


def rows(order: str, padding: int = 0) -> bytes:
    """The bytes of a raw message."""
    whole, width = halves().tobytes("raw", order), 64 * 3
    return b"".join(whole[at : at + width] + bytes(padding) for at in range(0, len(whole), width))


def sees(request: Request) -> str:
    """What the model replies: the picture must have arrived with its colours in their places."""
    text, picture = request.body["messages"][1]["content"]
    image = decode_image(base64.b64decode(picture["image_url"]["url"].partition(",")[2]))
    left, right = image.getpixel((8, 16)), image.getpixel((56, 16))
    assert isinstance(left, tuple)
    assert isinstance(right, tuple)
    is_there = json.loads(text["text"]) == "mug" and right[2] > 200 > left[2] and left[0] > 200 > right[0]
    return json.dumps({"found": is_there, "score": 0.9, "box": BOX if is_there else None})


def has_frame(picture: bytes) -> bool:
    """Whether a picture has a frame around its blue half: yellow at its edge, and blue within."""
    shown = decode_image(picture)
    edge, inside = shown.getpixel((33, 16)), shown.getpixel((48, 16))
    assert isinstance(edge, tuple)
    assert isinstance(inside, tuple)
    return shown.size == (64, 32) and edge[1] > 90 and inside[1] < 40
