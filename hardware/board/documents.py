# SPDX-License-Identifier: BSD-3-Clause
"""Numbers in hardware/README.md against the description."""
from __future__ import annotations

import cables
import production
import timing
from boards import BOARDS
from kept import HARDWARE

JUMPERS = {"JP200": "`LVL` of each camera", "JP201": "`UP`/`DN` of each camera",
           "JP600": "`3.3`/`5V` of each LiDAR", "JP601": "`INVERT`, `P` and `S` of each LiDAR",
           "JP700": "`50 OHM`", "JP701": "`NMEA INV`", "JP820": "`RX`", "JP800": "`I2C PULL`"}
CHEAP = 40.0  # USD in tens, without the board and the Pico


def cable_rows() -> list[str]:
    """Level, jumper and pins of each camera that is known, as the README's table has them."""
    rows = []
    for row in cables.tables()[0]["cameras"]:
        pins = {what: number for number, what in reversed(row["camera_pins"].items())}
        if row["known"]:
            pull = {"up": "UP", "down": "DN"}.get(row["pull"], "none")
            rows.append(f"| {row['level']} | {pull} | {pins['trigger']}, {pins['exposure']}, "
                        f"{pins['ground']}")
    return rows


def short_rows() -> list[str]:
    """What is missing in the worst corner, of each output that the table excepts."""
    return [f"| {volts:g} V | {short:g} V |" for volts, short in cables.exceptions()]


def faults(text: str | None = None) -> list[str]:
    text = text or (HARDWARE / "README.md").read_text()
    carrier = BOARDS["carrier"]()
    delay = timing.table(carrier)["board_delay_ns"]
    parts = len(production.bought(carrier, "standard"))
    price = production.price(carrier, "standard")
    inputs, outputs = delay["inputs"], delay["outputs"]
    wanted = [f"board_delay_ns = {{ inputs = {inputs}, outputs = {outputs} }}",
              f"{carrier.width:g} x {carrier.height:g} mm", f"{parts} parts",
              f"{price:.0f} USD", *cable_rows(), *short_rows(),
              *(f"| {name} | {carrier.parts[ref].delivered or 'open'} |"
                for ref, name in JUMPERS.items())]
    found = [f"README.md does not say '{each}'" for each in wanted if each not in text]
    if price > CHEAP:
        found.append(f"the parts of the carrier are {price:.0f} USD, {CHEAP:g} are allowed")
    for name, board in ((name, make()) for name, make in BOARDS.items()):
        if f"({name}/connectors.md)" not in text or f"({name}/images/front.png)" not in text:
            found.append(f"README.md does not show the board '{name}' and its connectors")
        if f"{board.width:g} x {board.height:g} mm" not in text:
            found.append(f"README.md does not say how large '{name}' is")
    return found
