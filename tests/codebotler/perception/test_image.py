"""Each picture becomes an upright image in colour, or raises an error of one sentence."""

from __future__ import annotations

import base64
import io
import struct
import zlib
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from codebotler.core.errors import UserError
from codebotler.perception import Sighting, decode_image, encode_jpeg, image_from_ros, read_image, with_box
from codebotler.perception.image import MAX_IMAGE_BYTES

RED, BLUE = (255, 0, 0), (0, 0, 255)


def make_halves(mode: str = "RGB", left: Any = RED, right: Any = BLUE) -> Image.Image:  # noqa: ANN401 - Pillow takes any
    """Make a picture of 40 x 20 pixels whose halves differ."""
    image = Image.new(mode, (40, 20), left)
    image.paste(right, (20, 0, 40, 20))
    return image


def encode(image: Image.Image, kind: str = "PNG", **options: Any) -> bytes:  # noqa: ANN401 - Pillow takes any
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


def png_of_size(width: int, height: int) -> bytes:
    """Make a PNG of a few bytes whose header claims this size."""
    parts = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0), b"IDAT" + zlib.compress(b"")
    chunks = (struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def is_near(image: Image.Image, at: tuple[int, int], colour: tuple[int, int, int]) -> bool:
    found = image.getpixel(at)
    assert isinstance(found, tuple)
    return all(abs(a - b) < 12 for a, b in zip(found, colour, strict=True))


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_files_become_pictures(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "picture"
    path.write_bytes(encode(make_halves(), kind))
    image = read_image(path)
    assert (image.mode, image.size) == ("RGB", (40, 20))
    assert is_near(image, (5, 10), RED)
    assert is_near(image, (35, 10), BLUE)


def test_picture_of_a_rotated_camera_is_upright() -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # This value means a quarter turn.
    image = decode_image(encode(make_halves(), "JPEG", exif=exif))
    assert image.size == (20, 40)
    assert is_near(image, (10, 5), RED)
    assert is_near(image, (10, 35), BLUE)
    assert not Image.open(io.BytesIO(encode_jpeg(image))).getexif()


def test_transparent_pixels_become_white() -> None:
    image = decode_image(encode(make_halves("RGBA", (255, 0, 0, 255), (0, 0, 0, 0))))
    assert (image.mode, image.getpixel((5, 5)), image.getpixel((35, 5))) == ("RGB", RED, (255, 255, 255))
    grey = decode_image(encode(make_halves("LA", (0, 255), (0, 0))))
    assert (grey.getpixel((5, 5)), grey.getpixel((35, 5))) == ((0, 0, 0), (255, 255, 255))


def test_sixteen_bits_of_grey_become_eight() -> None:
    row = struct.pack("<40H", *[2_000] * 20, *[4_000] * 20)
    image = decode_image(encode(Image.frombytes("I;16", (40, 20), row * 20)))
    assert (image.mode, image.getpixel((5, 5)), image.getpixel((35, 5))) == ("RGB", (128,) * 3, (255,) * 3)
    dark = decode_image(encode(Image.new("I;16", (40, 20), 0)))
    assert dark.getpixel((5, 5)) == (0, 0, 0)


@pytest.mark.parametrize("mode", ["1", "L", "P", "CMYK"])
def test_other_modes_become_colour(mode: str) -> None:
    kind = "JPEG" if mode == "CMYK" else "PNG"
    assert decode_image(encode(Image.new(mode, (40, 20)), kind)).mode == "RGB"


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "empty"),
        (b"no picture at all", "not a JPEG, PNG or WebP file"),
        (encode(make_halves(), "GIF"), "not a JPEG, PNG or WebP file"),
        (encode(make_halves(), "JPEG")[:300], "damaged or incomplete"),
        (encode(Image.effect_noise((200, 200), 50), "PNG")[:5_000], "damaged or incomplete"),
        (encode(Image.new("RGB", (1, 1))), "1 x 1 pixels; use at least 16"),
        (png_of_size(10_000, 5_000), "10,000 x 5,000 pixels; use at"),
        (png_of_size(11_000, 11_000), "11,000 x 11,000 pixels; use at"),
        (png_of_size(60_000, 60_000), "3600000000 pixels"),
        (b"\xff" * (MAX_IMAGE_BYTES + 1), "50,000,000 bytes"),
    ],
)
def test_bad_picture_raises_one_sentence(data: bytes, sentence: str) -> None:
    with pytest.raises(UserError) as error:
        decode_image(data)
    assert sentence in str(error.value)


def test_every_truncated_picture_is_refused_or_read() -> None:
    whole = encode(make_halves(), "PNG")
    for end in range(0, len(whole), 3):
        try:
            decode_image(whole[:end])
        except UserError:
            continue
        assert end > len(whole) - 20  # Only the end of the file may be missing.


def test_missing_file_and_folder_raise_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="No such file") as error:
        read_image(tmp_path / "none.jpg")
    assert error.value.file == tmp_path / "none.jpg"
    with pytest.raises(UserError, match="Is a directory"):
        read_image(tmp_path)


# --- from a camera


def message(encoding: str, pixel: bytes, *, padding: int = 0, **changes: object) -> dict[str, object]:
    row = pixel * 40 + b"\x07" * padding
    data = base64.b64encode(row * 20).decode()
    return {"encoding": encoding, "width": 40, "height": 20, "step": len(row), "data": data,
            **changes}  # fmt: skip


@pytest.mark.parametrize(
    ("encoding", "pixel", "colour"),
    [
        ("rgb8", b"\xff\x80\x00", (255, 128, 0)),
        ("bgr8", b"\x00\x80\xff", (255, 128, 0)),
        ("rgba8", b"\xff\x80\x00\xff", (255, 128, 0)),
        ("bgra8", b"\x00\x80\xff\xff", (255, 128, 0)),
        ("mono8", b"\x80", (128, 128, 128)),
    ],
)
def test_encodings_of_cameras(encoding: str, pixel: bytes, colour: tuple[int, int, int]) -> None:
    for padding in (0, 6):
        image = image_from_ros(message(encoding, pixel, padding=padding))
        assert (image.mode, image.size, image.getpixel((39, 19))) == ("RGB", (40, 20), colour)


def test_compressed_picture_of_a_camera() -> None:
    data = base64.b64encode(encode(make_halves(), "JPEG")).decode()
    assert image_from_ros({"format": "jpeg", "data": data}).size == (40, 20)


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        (message("16UC1", b"\0\0"), '"16UC1"; use one of rgb8, bgr8,'),
        (message("rgb8", b"\0\0\0", height=21), "2,400 bytes are too few for 40 x 21 pixels"),
        (message("rgb8", b"\0\0\0", step=60), "is cut off"),
        (message("rgb8", b"\0\0\0", width=100_000, height=100_000), "40,000,000"),
        (message("rgb8", b"\0\0\0", width=0), "use at least 16"),
        (message("rgb8", b"\0\0\0", step=2**31), "is cut off"),
        ({"format": "jpeg", "data": ""}, "is empty"),
        ({"format": "jpeg", "data": "AAAA"}, "not a JPEG, PNG or WebP file"),
        *(({"data": data}, "not an image message") for data in ("a", "!!", "é", None, 5)),
        (message("rgb8", b"\0\0\0", data="AAAAA"), "not an image message"),
        ({"ranges": []}, "not an image message"),
    ],
)
def test_bad_message_raises_one_sentence(said: dict[str, object], sentence: str) -> None:
    with pytest.raises(UserError) as error:
        image_from_ros(said, "the picture on /camera")
    assert str(error.value).startswith("the picture on /camera")
    assert sentence in str(error.value)


# --- encoding and boxes


def test_large_picture_is_scaled_down() -> None:
    small = decode_image(encode_jpeg(Image.new("RGB", (3_000, 1_500), RED)))
    assert small.size == (1024, 512)
    assert decode_image(encode_jpeg(Image.new("RGBA", (40, 20), (255, 0, 0, 255)))).size == (40, 20)


def test_box_is_drawn_where_it_was_found() -> None:
    image = Image.new("RGB", (200, 100), RED)
    drawn = with_box(image, Sighting(found=True, box=(0.5, 0.5, 1.0, 1.0), score=0.9))
    assert drawn.getpixel((100, 70)) == (255, 255, 0)
    assert drawn.getpixel((150, 75)) == RED == drawn.getpixel((50, 25)) == image.getpixel((100, 70))
    assert with_box(image, Sighting(found=False, box=None, score=0.1)).getcolors() == [(20_000, RED)]
