# SPDX-License-Identifier: BSD-3-Clause
"""Numbers in hardware/README.md against the description."""
from __future__ import annotations

import production
import timing
from boards import BOARDS
from kept import HARDWARE

CHEAP = 40.0  # USD in tens, without the board and the Pico


def faults(text: str | None = None) -> list[str]:
    text = text or (HARDWARE / "README.md").read_text()
    carrier = BOARDS["carrier"]()
    delay = timing.table(carrier)["board_delay_ns"]
    parts = len(production.bought(carrier, "standard"))
    price = production.price(carrier, "standard")
    wanted = [f"board_delay_ns = {{ inputs = {delay['inputs']}, outputs = {delay['outputs']} }}",
              f"{carrier.width:g} x {carrier.height:g} mm", f"{parts} parts", f"{price:.0f} USD"]
    found = [f"README.md does not say '{each}'" for each in wanted if each not in text]
    if price > CHEAP:
        found.append(f"the parts of the carrier are {price:.0f} USD, {CHEAP:g} are allowed")
    for name, board in ((name, make()) for name, make in BOARDS.items()):
        if f"({name}/connectors.md)" not in text or f"({name}/images/front.png)" not in text:
            found.append(f"README.md does not show the board '{name}' and its connectors")
        if f"{board.width:g} x {board.height:g} mm" not in text:
            found.append(f"README.md does not say how large '{name}' is")
    return found
