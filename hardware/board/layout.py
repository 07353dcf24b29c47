# SPDX-License-Identifier: BSD-3-Clause
"""Places and tracks of a board, as they were computed: kept in a file, so that making the board
anew takes a second and gives the same."""
from __future__ import annotations

import dataclasses
import json
import pathlib

from model import Board, Box, Place

Track = tuple[str, str, float, float, float, float, float]  # layer, net, width, from, to
Via = tuple[str, float, float]


@dataclasses.dataclass
class Layout:
    tracks: list[Track]
    vias: list[Via]


def save(path: pathlib.Path, board: Board, layout: Layout) -> None:
    rows = ["{", '"islands": {']
    rows.append(",\n".join(f"{json.dumps(name)}: {json.dumps(box)}"
                           for name, box in sorted(board.islands.items())))
    rows.append('},\n"places": {')
    rows.append(",\n".join(f"{json.dumps(ref)}: {json.dumps([at.x, at.y, at.turn])}"
                           for ref, at in sorted(board.places.items())))
    rows.append('},\n"tracks": [')
    rows.append(",\n".join(json.dumps(track) for track in sorted(layout.tracks)))
    rows.append('],\n"vias": [')
    rows.append(",\n".join(json.dumps(via) for via in sorted(layout.vias)))
    path.write_text("\n".join(rows) + "\n]}\n")


def load(path: pathlib.Path, board: Board) -> Layout:
    table = json.loads(path.read_text())
    board.islands = {name: to_box(box) for name, box in table["islands"].items()}
    board.places = {ref: Place(*at) for ref, at in table["places"].items()}
    return Layout([(str(t[0]), str(t[1]), t[2], t[3], t[4], t[5], t[6]) for t in table["tracks"]],
                  [(str(via[0]), via[1], via[2]) for via in table["vias"]])


def to_box(numbers: list[float]) -> Box:
    return numbers[0], numbers[1], numbers[2], numbers[3]
