"""Pictures from files and cameras, read with limits, turned upright and made RGB."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from PIL import Image, ImageDraw, ImageOps, UnidentifiedImageError

from codebotler.core.errors import UserError
from codebotler.core.files import read_bytes
from codebotler.models.server_errors import error_text
from codebotler.perception.base import Sighting

FORMATS = ("JPEG", "PNG", "WEBP")
MAX_BYTES = 50_000_000
MAX_PIXELS = 40_000_000
MIN_SIDE = 16  # pixels; in less there is nothing to see
LONGEST_SIDE = 1024  # pixels of a picture that is sent or kept
QUALITY = 85  # of a JPEG, in per cent
ENCODINGS: Mapping[str, tuple[str, str, int]] = {
    "rgb8": ("RGB", "RGB", 3),
    "bgr8": ("RGB", "BGR", 3),
    "rgba8": ("RGBA", "RGBA", 4),
    "bgra8": ("RGBA", "BGRA", 4),
    "mono8": ("L", "L", 1),
    "mono16": ("I;16", "I;16", 2),
}
"""For each encoding of sensor_msgs/Image the mode, the order of the bytes, and how many a pixel has."""


def image_of(data: bytes, name: str = "the picture") -> Image.Image:
    """The picture in the bytes of a JPEG, PNG or WebP file, upright and in colour.

    Args:
        data: the bytes.
        name: what error messages call it.

    Raises:
        UserError: it is no such file, is broken or cut off, or is too large.
    """
    if not data:
        raise UserError(f"{name} is empty")
    if len(data) > MAX_BYTES:
        raise UserError(f"{name} is larger than {MAX_BYTES:,} bytes; use a smaller one")
    try:
        # A picture that says it is huge is refused here before anything of it is unpacked.
        with warnings.catch_warnings(action="ignore", category=Image.DecompressionBombWarning):
            opened = Image.open(io.BytesIO(data), formats=FORMATS)
        _check_size(*opened.size, name)  # before anything of a huge picture is unpacked
        opened.load()
        return _plain(ImageOps.exif_transpose(opened))
    except UserError:
        raise
    except UnidentifiedImageError:
        raise UserError(f"{name} is not a JPEG, PNG or WebP file") from None
    except Image.DecompressionBombError:
        raise UserError(f"{name} has more than {MAX_PIXELS:,} pixels; use a smaller one") from None
    except Exception as error:  # noqa: BLE001 - decoders fail in many ways
        raise UserError(f"{name} cannot be read; it is broken or cut off ({error_text(error)})") from None


def read_image(path: Path) -> Image.Image:
    """The picture in a file.

    Raises:
        UserError: the file is missing, cannot be read, or holds no picture.
    """
    return image_of(read_bytes(path, MAX_BYTES + 1), str(path))


def image_from_ros(message: Mapping[str, object], name: str = "the picture") -> Image.Image:
    """The picture in a sensor_msgs/CompressedImage, or in a sensor_msgs/Image of a common encoding.

    Args:
        message: its fields, with `data` in base64.
        name: what error messages call it.

    Raises:
        UserError: it holds none, or is too large.
    """
    match message:
        case {"encoding": str(encoding), "width": int(width), "height": int(height), "step": int(step)}:
            data, is_big = _bytes_in(message, name), bool(message.get("is_bigendian"))
            return _raw(encoding, (width, height), step, data, is_big=is_big, name=name)
        case {"data": _}:
            return image_of(_bytes_in(message, name), name)
    raise UserError(f"{name} is not a message with a picture")


def _bytes_in(message: Mapping[str, object], name: str) -> bytes:
    data = message.get("data")
    with suppress(ValueError):  # it is no base64
        if isinstance(data, str):
            return base64.b64decode(data, validate=True)
    raise UserError(f"{name} is not a message with a picture")


def _raw(
    encoding: str, size: tuple[int, int], step: int, data: bytes, *, is_big: bool, name: str
) -> Image.Image:
    if encoding not in ENCODINGS:
        raise UserError(f'{name} has the encoding "{encoding}", not one of {", ".join(ENCODINGS)}')
    mode, order, width = ENCODINGS[encoding]
    _check_size(*size, name)
    if step < size[0] * width or len(data) < step * size[1]:
        raise UserError(
            f"{name} is cut off: {len(data):,} bytes are too few for {size[0]} x {size[1]} pixels"
        )
    if is_big and order == "I;16":
        order = "I;16B"
    return _plain(Image.frombytes(mode, size, data[: step * size[1]], "raw", order, step))


def jpeg_of(image: Image.Image) -> bytes:
    """The bytes of a JPEG file without metadata, scaled down if it is large."""
    smaller = _plain(image)
    smaller.thumbnail((LONGEST_SIDE, LONGEST_SIDE))
    file = io.BytesIO()
    smaller.save(file, "JPEG", quality=QUALITY)
    return file.getvalue()


def boxed(image: Image.Image, sighting: Sighting) -> Image.Image:
    """A copy of a picture with a frame around what was found, if anything was."""
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
    if width * height > MAX_PIXELS:
        raise UserError(
            f"{name} has {width:,} x {height:,} pixels, more than {MAX_PIXELS:,} in all; use a smaller one"
        )
    if min(width, height) < MIN_SIDE:
        raise UserError(
            f"{name} has {width} x {height} pixels, too few to see anything; take one of at least "
            f"{MIN_SIDE} x {MIN_SIDE}"
        )


def _plain(image: Image.Image) -> Image.Image:
    """The picture as RGB; what is transparent becomes white."""
    if image.mode.startswith("I"):
        # Cameras rarely use all 16 bits, so the brightest grey in the picture counts as white.
        image = image.convert("I")
        brightest = max(1, int(image.getextrema()[1]))  # type: ignore[arg-type]  # one band, so two numbers
        return image.point(lambda grey: grey * (255 / brightest) + 0.5).convert("L").convert("RGB")
    if image.has_transparency_data:
        image = image.convert("RGBA")
        white = Image.new("RGBA", image.size, "white")
        return Image.alpha_composite(white, image).convert("RGB")
    return image.convert("RGB")
