# SPDX-License-Identifier: BSD-3-Clause
"""The files that are made from the description: which they are, and whether those that are kept are
still the same."""
from __future__ import annotations

import pathlib

import assembly
import kicad_lib
import kicad_pcb
import kicad_sch
import pinout
import production
import sheet_svg
import timing
from boards import BOARDS
from layout import Layout, load
from model import Board

HARDWARE = pathlib.Path(__file__).resolve().parents[1]


def folder(board: Board) -> pathlib.Path:
    return HARDWARE / board.name


def open_board(name: str) -> tuple[Board, Layout]:
    board = BOARDS[name]()
    return board, load(folder(board) / "layout.json", board)


def files(board: Board, layout: Layout) -> dict[str, str]:
    """Text by path below the board's folder."""
    found = {f"{board.name}.kicad_pro": kicad_pcb.project(board),
             f"{board.name}.kicad_pcb": kicad_pcb.pcb(board, layout), **kicad_sch.schematic(board),
             **kicad_lib.files(board)}
    for name, text in list(found.items()):
        if name.endswith(".kicad_sch") and name != f"{board.name}.kicad_sch":
            found[f"sheets/{name.removesuffix('.kicad_sch')}.svg"] = sheet_svg.picture(text)
    for variant in board.variants:
        found[f"production/bom-{variant}.csv"] = production.bom(board, variant)
        found[f"production/placement-{variant}.csv"] = production.placement(board, variant)
    if board.name == "carrier":
        found["timing.json"] = timing.text(board)
    found["production/board.wrl"] = production.vrml(board)
    found["connectors.md"] = pinout.document(board)
    found["assembly.html"] = assembly.page(board, layout)
    return found


def write(board: Board, layout: Layout) -> None:
    for name, text in files(board, layout).items():
        path = folder(board) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def differences(board: Board, layout: Layout) -> list[str]:
    faults = []
    for name, text in files(board, layout).items():
        path = folder(board) / name
        if not path.is_file():
            faults.append(f"{path.relative_to(HARDWARE.parent)} is missing")
        elif path.read_text() != text:
            faults.append(f"{path.relative_to(HARDWARE.parent)} is not what the description "
                          "gives: hardware/make files writes it anew")
    return faults
