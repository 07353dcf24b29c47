# SPDX-License-Identifier: BSD-3-Clause
"""The boards of this project, by name."""
from __future__ import annotations

from typing import Callable

from carrier import carrier
from model import Board
from small import adis, leds

BOARDS: dict[str, Callable[[], Board]] = {"carrier": carrier, "leds": leds, "adis": adis}
