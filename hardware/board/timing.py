# SPDX-License-Identifier: BSD-3-Clause
"""How late edges are on their way through the carrier: the table of hardware/carrier/timing.json.

Trigger: from the Pico's pin to the connector. Exposure: from the connector to the Pico's pin. Each
part of the way has its least and its most; thresholds and RC are computed from the description.
"""
from __future__ import annotations

import json
import math
from typing import Any

import checks
from model import Board

# ns, least and most. 74LVC1T45: no table of delays was at hand; 420 Mbit/s to 5 V, 210 to 3.3 V and
# 75 to 1.8 V (its data sheet) bound a bit, and so the delay; the 74LVC1G17 is bounded likewise.
# ISO7721: 6 to 16 ns. Transistors of the isolated option: simulated.
TRANSLATOR = {"5 V": (0.5, 5.0), "3.3 V": (0.5, 6.0), "1.8 V": (1.0, 14.0)}
SCHMITT = {"5 V": (0.5, 5.0), "3.3 V": (0.5, 6.0), "1.8 V": (1.0, 14.0)}
ISOLATOR = (6.0, 16.0)
ISOLATED_SWITCH = {"rise": (50.0, 300.0), "fall": (300.0, 2500.0)}
SUPPLY = {"5 V": 4.7, "3.3 V": 3.3, "1.8 V": 1.8}
STRAY = (7e-12, 14e-12)  # F at the buffer: its input, two diodes, track
CABLE_NS_PER_M = 5.0
USUAL = "3.3 V"


def rc(board: Board, level: str, rising: bool) -> tuple[float, float]:
    """ns from an edge at the connector to the threshold behind its resistor."""
    volts, ohm = SUPPLY[level], board.parts["R203"].component.figure("ohm")
    table = checks.SCHMITT_HIGH if rising else checks.SCHMITT_LOW
    one = checks.between(table, volts)
    other = checks.between(LEAST_HIGH if rising else MOST_LOW, volts)
    shares = sorted(math.log(volts / (volts - v)) if rising else math.log(volts / v)
                    for v in (one, other))
    return ohm * STRAY[0] * shares[0] * 1e9, ohm * STRAY[1] * shares[1] * 1e9


# The other limits of the same table: least of the rising, most of the falling threshold.
LEAST_HIGH = ((1.8, 0.70), (2.3, 1.0), (3.0, 1.3), (4.5, 1.9), (5.5, 2.2))
MOST_LOW = ((1.8, 0.90), (2.3, 1.15), (3.0, 1.5), (4.5, 2.0), (5.5, 2.3))


def add(*parts: tuple[float, float]) -> list[float]:
    return [round(sum(p[0] for p in parts), 1), round(sum(p[1] for p in parts), 1)]


def table(board: Board) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    for level in SUPPLY:
        rows[level] = {
            "trigger": add(TRANSLATOR[level]),
            "exposure_rising": add(rc(board, level, True), SCHMITT[level], TRANSLATOR["3.3 V"]),
            "exposure_falling": add(rc(board, level, False), SCHMITT[level], TRANSLATOR["3.3 V"])}
    rows["isolated 24 V"] = {
        "trigger": add(ISOLATOR, ISOLATED_SWITCH["rise"]),
        "trigger_falling": add(ISOLATOR, ISOLATED_SWITCH["fall"]),
        "exposure_rising": add(ISOLATOR, (20.0, 400.0)),
        "exposure_falling": add(ISOLATOR, (5.0, 200.0))}
    usual = rows[USUAL]
    middle = round(sum(usual["exposure_rising"] + usual["exposure_falling"]) / 4)
    out = round(sum(usual["trigger"]) / 2)
    return {"unit": "ns, least and most", "cable_ns_per_m": CABLE_NS_PER_M, "paths": rows,
            "board_delay_ns": {"inputs": [middle] * 4, "outputs": [out] * 4},
            "skew_between_channels_ns": round(max(
                usual[key][1] - usual[key][0] for key in ("exposure_rising", "exposure_falling")))}


def text(board: Board) -> str:
    return json.dumps(table(board), indent=2) + "\n"
