# SPDX-License-Identifier: BSD-3-Clause
"""A document with the pins of each connector, from the description."""
from __future__ import annotations

from model import Board, Part
from production import number

WORDS = {"GND": "ground", "5V_OUT": "5 V out", "+3V3": "3.3 V out", "VLIGHT": "supply out",
         "VIN": "7 to 24 V in"}


def word(net: str) -> str:
    if net.startswith("VCAM"):
        return f"supply of camera {net[4:]}"
    if net.startswith("24V"):
        return "18 to 30 V in"
    if net.startswith("GND_ISO"):
        return "isolated ground"
    return WORDS.get(net, net.removesuffix("_X").lower())


def plug(part: Part) -> str:
    if not part.component.mates:
        return ""
    housing, contact = part.component.mates
    return f"; plug {housing}, contacts {contact}"


def row(part: Part) -> str:
    words = {number: word(net) for number, net in part.nets.items()} | part.words
    pins = [f"{pin.number} {words.get(pin.number, 'open')}" for pin in part.component.pins
            if pin.number != "MP"]
    head = f"{part.ref}, {part.component.mpn}{plug(part)}"
    lines, line = [], f"- **{part.label or part.ref}** ({head}):"
    for i, text in enumerate(pins):
        piece = f" {text}{',' if i + 1 < len(pins) else ''}"
        if len(line) + len(piece) > 99:
            lines.append(line)
            line = " "
        line += piece
    return "\n".join([*lines, line])


def document(board: Board) -> str:
    parts = sorted((part for part in board.parts.values()
                    if part.component.family == "connector" and part.component.mpn),
                   key=lambda part: number(part.ref))
    return "\n".join([
        f"# Connectors: {board.title}", "",
        "Made from the description in `hardware/board`: change that, not this file. On JST GH, pin",
        "1 is the one with the dot, on Molex Micro-Fit the one with the square pad. Words are",
        "signals of the firmware where there is one.", "",
        *(row(part) for part in parts), ""])
