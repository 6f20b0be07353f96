"""Detectors, which look for an object or a person in an image, and functions that read images."""

from codebotler.perception.base import Detector, PerceptionError, Sighting
from codebotler.perception.image import decode_image, encode_jpeg, image_from_ros, read_image, with_box
from codebotler.perception.open import open_detector

__all__ = [
    "Detector",
    "PerceptionError",
    "Sighting",
    "decode_image",
    "encode_jpeg",
    "image_from_ros",
    "open_detector",
    "read_image",
    "with_box",
]
