# SPDX-License-Identifier: BSD-3-Clause
"""Writes a board as KiCad 6's .kicad_pcb and .kicad_pro."""
from __future__ import annotations

import json
from typing import Any

from footprints import ALL, grown
from layout import Layout
from model import Board, Box, Footprint, Pad, Part, Place, box_at, pad_box, stamp, turned
from rules import CLEARANCE, DRILL, FACE, ISOLATION, VIA
from sexpr import q, write

MARGIN = 0.3  # copper from the edge
FRONT = ["F.Cu", "F.Paste", "F.Mask"]
OFFSET = 20.0  # of the board on KiCad's sheet
Sexpr = list[Any]
POLAR = ("diode", "zener", "led")
LAYERS = [(0, "F.Cu", "signal"), (1, "In1.Cu", "signal"), (2, "In2.Cu", "signal"),
          (31, "B.Cu", "signal"), (34, "B.Paste", "user"), (35, "F.Paste", "user"),
          (36, "B.SilkS", "user"), (37, "F.SilkS", "user"), (38, "B.Mask", "user"),
          (39, "F.Mask", "user"), (44, "Edge.Cuts", "user"), (46, "B.CrtYd", "user"),
          (47, "F.CrtYd", "user"), (48, "B.Fab", "user"), (49, "F.Fab", "user")]


def at(x: float, y: float, turn: float = 0) -> Sexpr:
    point = ["at", float(OFFSET + x), float(OFFSET + y)]
    return [*point, turn] if turn else point


def effects(size: float, thick: float, justify: str = "") -> Sexpr:
    font = ["font", ["size", size, size], ["thickness", thick]]
    return ["effects", font, ["justify", justify]] if justify else ["effects", font]


def line(kind: str, layer: str, width: float, ends: Box, *names: object) -> Sexpr:
    shift = OFFSET if kind == "gr_line" else 0.0
    return [kind, ["start", ends[0] + shift, ends[1] + shift],
            ["end", ends[2] + shift, ends[3] + shift], ["layer", q(layer)], ["width", width],
            ["tstamp", stamp(*names, kind, layer, *ends)]]


def rectangle(kind: str, layer: str, width: float, box: Box, *names: object) -> list[Sexpr]:
    x0, y0, x1, y1 = box
    return [line(kind, layer, width, ends, *names) for ends in (
        (x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0))]


def pad_sexpr(part: Part, index: int, pad: Pad, turn: int, numbers: dict[str, int]) -> Sexpr:
    kind = "smd" if not pad.drill else "thru_hole" if pad.plated else "np_thru_hole"
    row: Sexpr = ["pad", q(pad.number), kind, pad.shape,
                  ["at", pad.x, pad.y, turn] if turn else ["at", pad.x, pad.y],
                  ["size", pad.width, pad.height]]
    if pad.drill:
        drill: Sexpr = ["drill", pad.drill]
        row.append([*drill, ["offset", *pad.shift]] if any(pad.shift) else drill)
    layers = ["*.Cu", "*.Mask"] if pad.drill else FRONT if pad.paste else ["F.Cu", "F.Mask"]
    row.append(["layers", *(q(layer) for layer in layers)])
    if pad.shape == "roundrect":
        row.append(["roundrect_rratio", 0.2])
    net = part.nets.get(pad.number, "")
    if net:
        row.append(["net", numbers[net], q(net)])
    elif pad.number and not part.component.family == "hole":
        name = lone_pin(part, pad.number)
        row.append(["net", numbers[name], q(name)])
    return [*row, ["tstamp", stamp(part.ref, "pad", index)]]


def lone_pin(part: Part, number: str) -> str:
    """KiCad's name of the net of a pin that is connected to nothing."""
    pin = next(pin for pin in part.component.pins if pin.number == number)
    return f"unconnected-({part.ref}-Pad{number})" if not pin.name else \
        f"unconnected-({part.ref}-Pad{number})"


def silk_box(footprint: Footprint) -> list[Box]:
    """Lines along the body that keep off the pads."""
    x0, y0, x1, y1 = (value + sign * 0.11 for value, sign in zip(footprint.body, (-1, -1, 1, 1)))
    found = []
    for y in (y0, y1):
        found += [(a, y, b, y) for a, b in clear(x0, x1, [
            (p.x + p.shift[0] - p.width / 2, p.x + p.shift[0] + p.width / 2)
            for p in footprint.pads if abs(p.y + p.shift[1] - y) < p.height / 2 + 0.25])]
    for x in (x0, x1):
        found += [(x, a, x, b) for a, b in clear(y0, y1, [
            (p.y + p.shift[1] - p.height / 2, p.y + p.shift[1] + p.height / 2)
            for p in footprint.pads if abs(p.x + p.shift[0] - x) < p.width / 2 + 0.25])]
    return found


def clear(low: float, high: float, blocked: list[tuple[float, float]]
          ) -> list[tuple[float, float]]:
    """The parts of a stretch that nothing blocks, of 0.3 mm and more."""
    points, spot = [], low
    for a, b in sorted((a - 0.25, b + 0.25) for a, b in blocked):
        if a - spot > 0.3:
            points.append((spot, min(a, high)))
        spot = max(spot, b)
    if high - spot > 0.3:
        points.append((spot, high))
    return points


def pin_one(footprint: Footprint) -> tuple[float, float] | None:
    """A dot beside the first pin, outside of everything."""
    first = next((pad for pad in footprint.pads if pad.number == "1"), None)
    if first is None or len(footprint.pads) < 3 or footprint.kind == "thru":
        return None
    if footprint.name.startswith("JST"):
        return first.x - 0.75, -2.5
    return first.x - first.width / 2 + 0.2, first.y - first.height / 2 - 0.28


def footprint_sexpr(board: Board, part: Part, numbers: dict[str, int],
                    texts: dict[str, tuple[float, float, int]]) -> Sexpr:
    footprint, place = ALL[part.component.footprint], board.places[part.ref]
    attributes = {"smd": ["attr", "smd"], "thru": ["attr", "through_hole"]}.get(
        footprint.kind, ["attr", "exclude_from_pos_files", "exclude_from_bom"])
    head: Sexpr = ["footprint", q(f"versavis:{footprint.name}"), ["layer", q("F.Cu")],
                   ["tedit", "0"], ["tstamp", stamp(board.name, part.ref)],
                   at(place.x, place.y, place.turn),
                   ["property", q("Sheetfile"), q(f"{part.sheet}.kicad_sch")],
                   ["property", q("MPN"), q(part.component.mpn)],
                   ["path", q(f"/{stamp(board.name, 'sheet', part.sheet)}/"
                              f"{stamp(board.name, 'symbol', part.ref)}")], attributes]
    middle = ((footprint.body[0] + footprint.body[2]) / 2,
              (footprint.body[1] + footprint.body[3]) / 2)
    rows: list[Sexpr] = [
        text_row("reference", part.ref, texts.get(part.ref), middle, place, "F.SilkS",
                 part.ref not in texts),
        text_row("value", part.value, None, middle, place, "F.Fab", True),
        text_row("user", part.ref, None, middle, place, "F.Fab", False)]
    for box in silk_box(footprint) if footprint.kind in ("smd", "thru") else []:
        rows.append(line("fp_line", "F.SilkS", 0.12, box, part.ref))
    rows += rectangle("fp_line", "F.Fab", 0.1, footprint.body, part.ref)
    rows += rectangle("fp_line", "F.CrtYd", 0.05, footprint.courtyard, part.ref)
    if part.component.symbol in POLAR:  # a bar at the cathode
        first = footprint.pads[0]
        x, y = first.x - first.width / 2 - 0.15, first.height / 2
        rows.append(line("fp_line", "F.SilkS", 0.12, (x, -y, x, y), part.ref, "cathode"))
    dot = pin_one(footprint)
    if dot:
        rows.append(["fp_circle", ["center", *dot], ["end", dot[0] + 0.1, dot[1]],
                     ["layer", q("F.SilkS")], ["width", 0.1], ["fill", "solid"],
                     ["tstamp", stamp(part.ref, "dot")]])
    pads = [pad_sexpr(part, i, pad, place.turn, numbers) for i, pad in enumerate(footprint.pads)]
    return [*head, *rows, *pads]


def text_row(kind: str, text: str, spot: tuple[float, float, int] | None,
             middle: tuple[float, float], place: Place, layer: str, hidden: bool) -> Sexpr:
    where = (spot[0], spot[1]) if spot else middle
    size = 0.7 if layer == "F.SilkS" else 0.5
    turn = (spot[2] if spot else 0)
    row: Sexpr = ["fp_text", kind, q(text), ["at", *where, turn] if turn else ["at", *where],
                  ["layer", q(layer)]]
    if hidden:
        row.append("hide")
    return [*row, effects(size, 0.1 if size > 0.6 else 0.08),
            ["tstamp", stamp(text, kind, layer, place.x, place.y)]]


def outline(board: Board, home: str) -> list[tuple[float, float]]:
    """Of a plane: an island, or the board without its islands and the gap around them."""
    width, height = board.width, board.height
    if home:
        x0, y0, x1, y1 = board.islands[home]
        return [(x0, y0), (x1 - MARGIN, y0), (x1 - MARGIN, y1), (x0, y1)]
    points = [(MARGIN, MARGIN), (width - MARGIN, MARGIN)]
    g, low = ISOLATION + 0.2, -1.0
    for x0, y0, _, y1 in sorted(board.islands.values(), key=lambda box: box[1]):
        if y0 - g < low + 0.5:  # no copper fits between it and the one above
            del points[-2:]
            points += [(x0 - g, y1 + g), (width - MARGIN, y1 + g)]
        else:
            points += [(width - MARGIN, y0 - g), (x0 - g, y0 - g), (x0 - g, y1 + g),
                       (width - MARGIN, y1 + g)]
        low = y1 + g
    return [*points, (width - MARGIN, height - MARGIN), (MARGIN, height - MARGIN)]


def zone(net: str, number: int, layer: str, points: list[tuple[float, float]], priority: int,
         solid: bool = False) -> Sexpr:
    connect: Sexpr = ["connect_pads", "yes"] if solid else ["connect_pads"]
    row: Sexpr = ["zone", ["net", number], ["net_name", q(net)], ["layer", q(layer)],
                  ["tstamp", stamp("zone", net, layer)], ["hatch", "edge", 0.508]]
    if priority:
        row.append(["priority", priority])
    return [*row, [*connect, ["clearance", 0.2]], ["min_thickness", 0.2],
            ["fill", "yes", ["thermal_gap", 0.25], ["thermal_bridge_width", 0.3]],
            ["polygon", ["pts", *(["xy", x + OFFSET, y + OFFSET] for x, y in points)]]]


def copper_layers(board: Board) -> list[str]:
    return ["F.Cu", "In1.Cu", "In2.Cu", "B.Cu"] if board.layers == 4 else ["F.Cu", "B.Cu"]


def zones(board: Board, numbers: dict[str, int]) -> list[Sexpr]:
    found = []
    for layer in copper_layers(board):
        net = board.planes.get(layer, "GND")
        found.append(zone(net, numbers[net], layer, outline(board, ""), 0))
        for home in board.islands:
            found.append(zone(home, numbers[home], layer, outline(board, home), 0))
    for net, box in heat_areas(board).items():
        for layer in ("F.Cu", "B.Cu"):
            x0, y0, x1, y1 = box
            found.append(zone(net, numbers[net], layer, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)],
                              1, True))
    return found


def heat_areas(board: Board) -> dict[str, Box]:
    """Copper below the eFuse, whose pad is not ground."""
    found = {}
    for part in board.parts.values():
        if part.component.footprint == "HTSSOP-16" and part.ref in board.places:
            place = board.places[part.ref]
            found[part.net("EP")] = (place.x - 2.0, place.y - 2.9, place.x + 2.0, place.y + 2.9)
    return found


def heat_vias(board: Board) -> list[tuple[str, float, float]]:
    return [(net, round((box[0] + box[2]) / 2 + dx, 3), round((box[1] + box[3]) / 2 + dy, 3))
            for net, box in heat_areas(board).items() for dx in (-0.9, 0.9) for dy in (-0.9, 0.9)]


def net_numbers(board: Board) -> dict[str, int]:
    lone = [lone_pin(part, pad.number) for part in board.parts.values()
            for pad in ALL[part.component.footprint].pads
            if pad.number and part.component.family != "hole" and pad.number not in part.nets]
    return {net: i + 1 for i, net in enumerate([*board.nets(), *sorted(set(lone))])}


def label_width(text: str, size: float) -> float:
    return 0.9 * size * len(text) + 0.2


def text_spots(board: Board) -> dict[str, tuple[float, float, int]]:
    """Where a reference fits beside its part; others have it on the drawing only."""
    blocked = [pad_box(pad, board.places[part.ref]) for part in board.parts.values()
               for pad in ALL[part.component.footprint].pads]
    blocked += [grown(box_at(ALL[part.component.footprint].body, board.places[part.ref]), 0.18)
                for part in board.parts.values()]
    blocked += [label_box(label) for label in labels(board)]
    blocked += [(x - 0.25, y - 0.25, x + 0.25, y + 0.25) for x, y in dots(board)]
    found = {}
    for part in board.parts.values():
        footprint, place = ALL[part.component.footprint], board.places[part.ref]
        named = part.component.family == "led" and part.marks
        if footprint.kind not in ("smd", "thru") or part.ref == "U1" or named:
            continue
        spot = free_spot(board, part.ref, box_at(footprint.courtyard, place), blocked)
        if spot:
            x, y, turn, box = spot
            blocked.append(box)
            found[part.ref] = (*back(x - place.x, y - place.y, place.turn), turn)
    return found


def back(x: float, y: float, turn: int) -> tuple[float, float]:
    return turned(x, y, -turn)


def dots(board: Board) -> list[tuple[float, float]]:
    found = []
    for part in board.parts.values():
        dot, place = pin_one(ALL[part.component.footprint]), board.places[part.ref]
        if dot:
            x, y = turned(*dot, place.turn)
            found.append((place.x + x, place.y + y))
    return found


def overlaps(box: Box, others: list[Box], by: float = 0.1) -> bool:
    return any(box[0] < o[2] + by and o[0] < box[2] + by and box[1] < o[3] + by and
               o[1] < box[3] + by for o in others)


def free_spot(board: Board, text: str, around: Box, blocked: list[Box]
              ) -> tuple[float, float, int, Box] | None:
    wide, tall = label_width(text, 0.7), 0.85
    x0, y0, x1, y1 = around
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    for gap in (0.0, 0.3, 0.6):
        for x, y, turn in ((middle[0], y0 - tall / 2 - gap, 0), (middle[0], y1 + tall / 2 + gap, 0),
                           (x0 - wide / 2 - gap, middle[1], 0), (x1 + wide / 2 + gap, middle[1], 0),
                           (x0 - tall / 2 - gap, middle[1], 90),
                           (x1 + tall / 2 + gap, middle[1], 90)):
            w, h = (wide, tall) if turn == 0 else (tall, wide)
            box = (x - w / 2, y - h / 2, x + w / 2, y + h / 2)
            inside = box[0] > 0.4 and box[1] > 0.4 and box[2] < board.width - 0.4 and \
                box[3] < board.height - 0.4
            if inside and not overlaps(box, blocked):
                return round(x, 3), round(y, 3), turn, box
    return None


Label = tuple[float, float, int, float, str]  # x, y, turn, size, text


def label_box(label: Label) -> Box:
    x, y, turn, size, text = label
    w, h = label_width(text, size), size * 1.2
    if turn % 180:
        w, h = h, w
    return x - w / 2, y - h / 2, x + w / 2, y + h / 2


def labels(board: Board) -> list[Label]:
    """What connectors and jumpers are, and other words on the board."""
    blocked = [pad_box(pad, board.places[part.ref]) for part in board.parts.values()
               for pad in ALL[part.component.footprint].pads]
    blocked += [grown(box_at(ALL[part.component.footprint].body, board.places[part.ref]), 0.18)
                for part in board.parts.values()]
    blocked += [(x - 0.25, y - 0.25, x + 0.25, y + 0.25) for x, y in dots(board)]
    found: list[Label] = []
    for x, y, size, text in board.texts:
        found.append((x, y, 0, size, text))
        blocked.append(label_box(found[-1]))
    for part in board.parts.values():
        for text, dx, dy, turn in part.marks:
            place = board.places[part.ref]
            x, y = turned(dx, dy, place.turn)
            found.append((place.x + x, place.y + y, turn, 0.7, text))
            blocked.append(label_box(found[-1]))
    for part in board.parts.values():
        if part.label:
            label = place_label(board, part, blocked)
            found.append(label)
            blocked.append(label_box(label))
    return found


def place_label(board: Board, part: Part, blocked: list[Box]) -> Label:
    footprint, place = ALL[part.component.footprint], board.places[part.ref]
    x0, y0, x1, y1 = box_at(footprint.body, place)
    if footprint.name.startswith("JST"):  # behind its pads
        inner = box_at((footprint.body[0], -4.0, footprint.body[2], -3.0), place)
        return ((inner[0] + inner[2]) / 2, (inner[1] + inner[3]) / 2,
                90 if place.turn % 180 else 0, 0.9, part.label)
    if footprint.name.startswith("MICRO"):
        deep = footprint.courtyard[3]
        inner = box_at((footprint.body[0], deep, footprint.body[2], deep + 1.2), place)
        return (inner[0] + inner[2]) / 2, (inner[1] + inner[3]) / 2, 0, 0.9, part.label
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    for size in (0.9, 0.7):
        w = label_width(part.label, size)
        for gap in (0.3, 0.5, 0.9, 1.3):
            for label in ((middle[0], y0 - gap - size * 0.6, 0, size, part.label),
                          (middle[0], y1 + gap + size * 0.6, 0, size, part.label),
                          (x0 - gap - size * 0.6, middle[1], 90, size, part.label),
                          (x1 + gap + size * 0.6, middle[1], 90, size, part.label),
                          (x0 - gap - w / 2, middle[1], 0, size, part.label),
                          (x1 + gap + w / 2, middle[1], 0, size, part.label)):
                box = label_box(label)
                if not overlaps(box, blocked, 0.05) and box[0] > 0.3 and box[1] > 0.3 and \
                        box[2] < board.width - 0.3 and box[3] < board.height - 0.3:
                    return label
    raise RuntimeError(f"no room for the label of {part.ref}")


def pcb(board: Board, layout: Layout) -> str:
    numbers = net_numbers(board)
    texts = text_spots(board)
    rows: list[Any] = [
        "kicad_pcb", ["version", "20211014"], ["generator", "versavis"],
        ["general", ["thickness", 1.6]], ["paper", q("A4")],
        ["title_block", ["title", q(board.title)], ["company", q("VersaVIS")],
         ["comment", 1, q("CERN-OHL-P-2.0")]],
        ["layers", *([number, q(name), kind] for number, name, kind in LAYERS
                     if not name.startswith("In") or board.layers == 4)],
        setup(board), ["net", 0, q("")],
        *(["net", number, q(net)] for net, number in numbers.items())]
    rows += [footprint_sexpr(board, part, numbers, texts) for part in board.parts.values()]
    rows += rectangle("gr_line", "Edge.Cuts", 0.1, (0.0, 0.0, board.width, board.height), "edge")
    for x, y, turn, size, text in labels(board):
        rows.append(["gr_text", q(text), at(x, y, turn), ["layer", q("F.SilkS")],
                     ["tstamp", stamp("text", text, x, y)], effects(size, 0.15)])
    for i, (layer, net, width, *ends) in enumerate(layout.tracks):
        rows.append(["segment", ["start", ends[0] + OFFSET, ends[1] + OFFSET],
                     ["end", ends[2] + OFFSET, ends[3] + OFFSET], ["width", width],
                     ["layer", q(layer)], ["net", numbers[net]], ["tstamp", stamp("track", i)]])
    for i, (net, x, y) in enumerate([*layout.vias, *heat_vias(board)]):
        rows.append(["via", at(x, y), ["size", VIA], ["drill", DRILL],
                     ["layers", *(q(face) for face in FACE)], ["net", numbers[net]],
                     ["tstamp", stamp("via", i)]])
    return write(rows + zones(board, numbers)) + "\n"


def setup(board: Board) -> Sexpr:
    """The origin of production files is the lower left corner, as in the placement file."""
    return ["setup", ["pad_to_mask_clearance", 0.05],
            ["aux_axis_origin", OFFSET, OFFSET + board.height],
            ["pcbplotparams", ["layerselection", "0x00010fc_ffffffff"],
             ["outputdirectory", q("production/")]]]


def project(board: Board) -> str:
    rules = {"min_clearance": 0.15, "min_track_width": 0.15, "min_via_diameter": 0.5,
             "min_via_annular_width": 0.13, "min_through_hole_diameter": 0.3,
             "min_hole_to_hole": 0.25, "min_copper_edge_clearance": 0.25,
             "min_hole_clearance": 0.2, "min_silk_clearance": 0.0,
             "solder_mask_clearance": 0.05, "solder_mask_min_width": 0.0}
    severities = {"courtyards_overlap": "error", "silk_overlap": "warning",
                  "silk_over_copper": "warning", "npth_inside_courtyard": "ignore",
                  "pth_inside_courtyard": "error", "missing_courtyard": "error"}
    nets = {"classes": [{"name": "Default", "clearance": 0.15, "track_width": 0.2,
                         "via_diameter": VIA, "via_drill": DRILL, "wire_width": 6, "bus_width": 12,
                         "line_style": 0, "microvia_diameter": 0.3, "microvia_drill": 0.1,
                         "diff_pair_gap": 0.2, "diff_pair_width": 0.2, "diff_pair_via_gap": 0.2,
                         "pcb_color": "rgba(0, 0, 0, 0.000)",
                         "schematic_color": "rgba(0, 0, 0, 0.000)", "nets": []}],
            "meta": {"version": 2}, "net_colors": None}
    table = {"board": {"design_settings": {"rules": rules, "rule_severities": severities,
                                           "meta": {"version": 2},
                                           "track_widths": [0.0, 0.2, 0.3, 0.6],
                                           "via_dimensions": [{"diameter": VIA, "drill": DRILL}]}},
             "meta": {"filename": f"{board.name}.kicad_pro", "version": 1}, "net_settings": nets,
             "schematic": {"legacy_lib_dir": "", "legacy_lib_list": []},
             "sheets": [[stamp(board.name, "root"), ""],
                        *([stamp(board.name, "sheet", name), title]
                          for name, title in board.sheets)],
             "text_variables": {}}
    assert CLEARANCE >= rules["min_clearance"]
    return json.dumps(table, indent=2) + "\n"
