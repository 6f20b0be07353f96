"""Detectors, which look for an object or a person in an image, and functions that read images."""

from codebotler.perception.base import Detector, PerceptionError, Sighting
from codebotler.perception.image import boxed, image_from_ros, image_of, jpeg_of, read_image
from codebotler.perception.open import open_detector

__all__ = [
    "Detector",
    "PerceptionError",
    "Sighting",
    "boxed",
    "image_from_ros",
    "image_of",
    "jpeg_of",
    "open_detector",
    "read_image",
]
