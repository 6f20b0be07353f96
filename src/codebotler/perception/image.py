"""Reads images from files and cameras within size limits, turns them upright and converts them to RGB."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Mapping
from pathlib import Path

from PIL import Image, ImageDraw, ImageOps, UnidentifiedImageError

from codebotler.core.errors import UserError
from codebotler.core.files import read_bytes
from codebotler.models.servers.server_errors import error_text
from codebotler.perception.base import Sighting

IMAGE_FORMATS = ("JPEG", "PNG", "WEBP")
MAX_IMAGE_BYTES = 50_000_000
MAX_PIXELS = 40_000_000
MIN_SIDE = 16  # pixels
LONGEST_SIDE = 1024  # pixels after scaling down
QUALITY = 85  # JPEG quality, in per cent
ENCODINGS: Mapping[str, tuple[str, str]] = {
    "rgb8": ("RGB", "RGB"),
    "bgr8": ("RGB", "BGR"),
    "rgba8": ("RGBA", "RGBA"),
    "bgra8": ("RGBA", "BGRA"),
    "mono8": ("L", "L"),
}
"""Maps each supported encoding of sensor_msgs/Image to Pillow's mode and the order of a pixel's bytes."""


def decode_image(data: bytes, name: str = "the picture") -> Image.Image:
    """Decode a JPEG, PNG or WebP file to an upright RGB image. On failure, raise UserError about `name`."""
    if not data:
        raise UserError(f"{name} is empty; use a JPEG, PNG or WebP image")
    if len(data) > MAX_IMAGE_BYTES:
        raise UserError(f"{name} is larger than {MAX_IMAGE_BYTES:,} bytes; use a smaller image")
    try:
        with warnings.catch_warnings(action="ignore", category=Image.DecompressionBombWarning):
            opened = Image.open(io.BytesIO(data), formats=IMAGE_FORMATS)
        _check_size(*opened.size, name)  # needs only the header, so a huge image is never decompressed
        opened.load()
        return _to_rgb(ImageOps.exif_transpose(opened))
    except UserError:
        raise
    except UnidentifiedImageError:
        raise UserError(f"{name} is not a JPEG, PNG or WebP file; convert it to one of these") from None
    except Exception as error:  # noqa: BLE001 - a decoder may raise any error
        raise UserError(f"{name} is damaged or incomplete: {error_text(error)}") from None


def read_image(path: Path) -> Image.Image:
    """Read a JPEG, PNG or WebP file as an upright RGB image. Raise UserError if that fails."""
    return decode_image(read_bytes(path, MAX_IMAGE_BYTES + 1), str(path))


def image_from_ros(message: Mapping[str, object], name: str = "the picture") -> Image.Image:
    """Decode a ROS message: a sensor_msgs/CompressedImage, or a sensor_msgs/Image in one of `ENCODINGS`.

    The message is a dict with `data` in base64. If the image is bad, raise UserError about `name`.
    """
    try:
        data = base64.b64decode(message["data"], validate=True)  # type: ignore[arg-type]  # a text, or an error
    except (LookupError, TypeError, ValueError):
        raise UserError(f"{name} is not an image message; use an Image or CompressedImage") from None
    match message:
        case {"encoding": str(encoding), "width": int(width), "height": int(height), "step": int(step)}:
            return _decode_raw(encoding, (width, height), step, data, name)
    return decode_image(data, name)


def _decode_raw(encoding: str, size: tuple[int, int], step: int, data: bytes, name: str) -> Image.Image:
    if encoding not in ENCODINGS:
        raise UserError(f'{name} has the unknown encoding "{encoding}"; use one of {", ".join(ENCODINGS)}')
    mode, order = ENCODINGS[encoding]
    _check_size(*size, name)
    if step < size[0] * len(order) or len(data) < step * size[1]:
        raise UserError(
            f"{name} is cut off: {len(data):,} bytes are too few for {size[0]} x {size[1]} pixels"
        )
    return _to_rgb(Image.frombytes(mode, size, data[: step * size[1]], "raw", order, step))


def encode_jpeg(image: Image.Image) -> bytes:
    """Encode an image as a JPEG without metadata, scaled down to at most 1,024 pixels on each side."""
    smaller = _to_rgb(image)
    smaller.thumbnail((LONGEST_SIDE, LONGEST_SIDE))
    file = io.BytesIO()
    smaller.save(file, "JPEG", quality=QUALITY)
    return file.getvalue()


def with_box(image: Image.Image, sighting: Sighting) -> Image.Image:
    """Return a copy of an image, with a yellow frame around the sighting's box if there is one."""
    drawn = image.copy()
    if sighting.box is None:
        return drawn
    left, top, right, bottom = (
        share * side for share, side in zip(sighting.box, image.size * 2, strict=True)
    )
    width = max(2, max(image.size) // 200)
    draw = ImageDraw.Draw(drawn)
    draw.rectangle((left, top, right, bottom), outline="black", width=2 * width)
    draw.rectangle((left, top, right, bottom), outline="yellow", width=width)
    return drawn


def _check_size(width: int, height: int, name: str) -> None:
    if min(width, height) < MIN_SIDE or width * height > MAX_PIXELS:
        limits = f"at least {MIN_SIDE} on each side and at most {MAX_PIXELS:,} in total"
        raise UserError(f"{name} has {width:,} x {height:,} pixels; use {limits}")


def _to_rgb(image: Image.Image) -> Image.Image:
    """Convert an image to RGB. Transparent parts become white."""
    if image.mode.startswith("I"):
        # Cameras rarely use all 16 bits, so scale the brightest grey to white.
        image = image.convert("I")
        brightest = max(1, int(image.getextrema()[1]))  # type: ignore[arg-type]  # two numbers, since there is one band
        return image.point(lambda grey: grey * (255 / brightest) + 0.5).convert("L").convert("RGB")
    if image.has_transparency_data:
        image = image.convert("RGBA")
        white = Image.new("RGBA", image.size, "white")
        return Image.alpha_composite(white, image).convert("RGB")
    return image.convert("RGB")
