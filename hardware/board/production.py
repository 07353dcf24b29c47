# SPDX-License-Identifier: BSD-3-Clause
"""What a pool or an assembler needs beside the gerbers: parts, places, and a model of the whole."""
from __future__ import annotations

import csv
import dataclasses
import io
from typing import Iterable

from catalogue import SHUNT
from footprints import ALL
from model import Board, Part, box_at

BOM = ["Comment", "Designator", "Footprint", "JLCPCB Part #", "Quantity", "MPN", "Manufacturer",
       "Second source", "Figures from"]
PLACES = ["Designator", "Mid X", "Mid Y", "Layer", "Rotation"]
COLOURS = {"connector": (0.9, 0.9, 0.85), "jumper": (0.1, 0.1, 0.1), "resistor": (0.15, 0.15, 0.15),
           "capacitor": (0.7, 0.55, 0.4), "led": (0.9, 0.9, 0.9), "pico": (0.1, 0.4, 0.2)}


def table(head: list[str], rows: Iterable[list[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()


def bought(board: Board, variant: str) -> list[Part]:
    return [part for part in board.parts.values() if variant in part.fitted and part.component.mpn]


def number(ref: str) -> tuple[str, int]:
    letters = ref.rstrip("0123456789")
    return letters, int(ref[len(letters):] or 0)


def bom(board: Board, variant: str) -> str:
    """One row for each part that is bought; the part numbers of a pool are the buyer's to fill in,
    by MPN."""
    groups: dict[tuple[str, str, str], list[Part]] = {}
    for part in bought(board, variant):
        key = (part.component.mpn, part.component.name, part.component.footprint)
        groups.setdefault(key, []).append(part)
    if shunted := shunts(board, variant):
        groups[SHUNT.mpn, SHUNT.name, SHUNT.footprint] = shunted
    rows = []
    for (mpn, name, footprint), parts in sorted(
            groups.items(), key=lambda item: number(item[1][0].ref)):
        component = parts[0].component
        refs = sorted((part.ref for part in parts), key=number)
        rows.append([name, ",".join(refs), footprint, "", str(len(refs)), mpn, component.maker,
                     "; ".join(component.alternates), component.source])
    return table(BOM, rows)


def shunts(board: Board, variant: str) -> list[Part]:
    """One for each jumper that is set at delivery; SH200 goes onto JP200."""
    return [dataclasses.replace(part, ref=part.ref.replace("JP", "SH"), component=SHUNT, nets={})
            for part in bought(board, variant) if part.delivered]


def placement(board: Board, variant: str) -> str:
    """Of the parts that a machine places. Origin: the board's lower left corner; degrees
    counter-clockwise, corrected by what the pool's parts are turned in their reels."""
    rows = []
    for part in sorted(bought(board, variant), key=lambda part: number(part.ref)):
        footprint, place = ALL[part.component.footprint], board.places[part.ref]
        if footprint.kind != "smd":
            continue
        turn = (place.turn + footprint.turn) % 360
        rows.append([part.ref, f"{place.x:.3f}mm", f"{board.height - place.y:.3f}mm", "Top",
                     f"{turn:g}"])
    return table(PLACES, rows)


def price(board: Board, variant: str) -> float:
    return sum(part.component.usd
               for part in [*bought(board, variant), *shunts(board, variant)])


def vrml(board: Board) -> str:
    """The board and a box for each part, in units of 0.1 inch as KiCad's own models."""
    rows = ["#VRML V2.0 utf8", f"# {board.title}"]
    rows.append(solid((0, 0, board.width, board.height), -1.6, 0.0, (0.05, 0.35, 0.15)))
    for part in board.parts.values():
        footprint = ALL[part.component.footprint]
        if board.variants[0] not in part.fitted or not footprint.height:
            continue
        x0, y0, x1, y1 = box_at(footprint.body, board.places[part.ref])
        rows.append(solid((x0, board.height - y1, x1, board.height - y0), 0.0, footprint.height,
                          COLOURS.get(part.component.family, (0.2, 0.2, 0.2))))
    return "\n".join(rows) + "\n"


def solid(box: tuple[float, float, float, float], low: float, high: float,
          colour: tuple[float, float, float]) -> str:
    x0, y0, x1, y1 = box
    middle = ((x0 + x1) / 2, (y0 + y1) / 2, (low + high) / 2)
    size = (x1 - x0, y1 - y0, high - low)
    return ("Transform { translation " + " ".join(f"{v / 2.54:.4f}" for v in middle)
            + " children Shape { appearance Appearance { material Material { diffuseColor "
            + " ".join(f"{v:g}" for v in colour) + " } } geometry Box { size "
            + " ".join(f"{v / 2.54:.4f}" for v in size) + " } } }")
