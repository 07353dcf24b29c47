# SPDX-License-Identifier: BSD-3-Clause
"""Computes places and tracks of a board, and keeps them."""
from __future__ import annotations

import kept
import placement
from boards import BOARDS
from kicad_pcb import heat_areas
from layout import Layout, save
from router import Router


def run(name: str) -> None:
    board = BOARDS[name]()
    placement.place(board, placement.HANDS[name](board.width, board.height))
    router = Router(board, heat_areas(board))
    router.run()
    kept.folder(board).mkdir(exist_ok=True)
    save(kept.folder(board) / "layout.json", board, Layout(router.tracks(), router.vias()))
