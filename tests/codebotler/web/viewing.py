"""How tests look at a page."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from playwright.sync_api import Page

DESK, TABLET, PHONE = (1440, 900), (820, 1180), (390, 844)
"""Width and height of screens, in pixels."""

OpenPage: TypeAlias = Callable[..., Page]
