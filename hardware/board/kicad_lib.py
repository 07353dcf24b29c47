# SPDX-License-Identifier: BSD-3-Clause
"""The project's own libraries, so that a part can be changed in KiCad, too: its symbols, footprints,
and the tables that name them."""
from __future__ import annotations

from typing import Any

from footprints import ALL
from kicad_pcb import FRONT, line, rectangle, silk_box
from kicad_sch import FLAG, GROUND, library_symbol, symbol_name
from model import Board, Footprint, Pad, stamp
from sexpr import q, write

Sexpr = list[Any]


def symbols(board: Board) -> str:
    used = {symbol_name(part.component): part.component for part in board.parts.values()}
    found = [library_symbol(used[name]) for name in sorted(used)] + [GROUND, FLAG]
    named = [["symbol", q(str(each[1]).removeprefix("versavis:")), *each[2:]] for each in found]
    return write(["kicad_symbol_lib", ["version", "20211014"], ["generator", "versavis"],
                  *named]) + "\n"


def pad(footprint: Footprint, index: int, each: Pad) -> Sexpr:
    kind = "smd" if not each.drill else "thru_hole" if each.plated else "np_thru_hole"
    layers = ["*.Cu", "*.Mask"] if each.drill else FRONT if each.paste else ["F.Cu", "F.Mask"]
    row: Sexpr = ["pad", q(each.number), kind, each.shape, ["at", each.x, each.y],
                  ["size", each.width, each.height]]
    if each.drill:
        drill: Sexpr = ["drill", each.drill]
        row.append([*drill, ["offset", *each.shift]] if any(each.shift) else drill)
    row.append(["layers", *(q(layer) for layer in layers)])
    if each.shape == "roundrect":
        row.append(["roundrect_rratio", 0.2])
    return [*row, ["tstamp", stamp(footprint.name, "library pad", index)]]


def text(kind: str, words: str, y: float, layer: str) -> Sexpr:
    return ["fp_text", kind, q(words), ["at", 0, y], ["layer", q(layer)],
            ["effects", ["font", ["size", 0.7, 0.7], ["thickness", 0.1]]],
            ["tstamp", stamp(words, kind, y, "library")]]


def footprint(shape: Footprint) -> str:
    attribute = {"smd": "smd", "thru": "through_hole"}.get(shape.kind, "exclude_from_pos_files")
    rows: list[Sexpr] = [text("reference", "REF**", shape.courtyard[1] - 0.6, "F.SilkS"),
                         text("value", shape.name, shape.courtyard[3] + 0.6, "F.Fab")]
    for box in silk_box(shape) if shape.kind in ("smd", "thru") else []:
        rows.append(line("fp_line", "F.SilkS", 0.12, box, shape.name, "library"))
    rows += rectangle("fp_line", "F.Fab", 0.1, shape.body, shape.name, "library")
    rows += rectangle("fp_line", "F.CrtYd", 0.05, shape.courtyard, shape.name, "library")
    return write(["footprint", q(shape.name), ["version", "20211014"], ["generator", "versavis"],
                  ["layer", q("F.Cu")], ["tedit", "0"], ["attr", attribute], *rows,
                  *(pad(shape, i, each) for i, each in enumerate(shape.pads))]) + "\n"


def table(kind: str, path: str) -> str:
    return write([kind, ["lib", ["name", q("versavis")], ["type", q("KiCad")],
                         ["uri", q("${KIPRJMOD}/" + path)], ["options", q("")],
                         ["descr", q("")]]]) + "\n"


def files(board: Board) -> dict[str, str]:
    names = sorted({part.component.footprint for part in board.parts.values()})
    return {"sym-lib-table": table("sym_lib_table", "versavis.kicad_sym"),
            "fp-lib-table": table("fp_lib_table", "versavis.pretty"),
            "versavis.kicad_sym": symbols(board),
            **{f"versavis.pretty/{name}.kicad_mod": footprint(ALL[name]) for name in names}}
