# SPDX-License-Identifier: BSD-3-Clause
"""Checks of places and tracks: those that a DRC does not make, and those that show without KiCad
whether the kept layout still belongs to the circuit."""
from __future__ import annotations

import itertools
import math
from typing import Iterator

from checks import DECOUPLED
from footprints import ALL
from kicad_pcb import heat_areas, heat_vias, label_box, labels, overlaps
from layout import Layout
from model import Board, Box, Pad, Part, box_at, gap, pad_at, pad_box
from rules import DRILL, ISOLATION, VIA

CLEAR = 0.15
DECOUPLING = 3.0  # mm from a supply pin to its capacitor
ESD_REACH = 7.0  # mm from a connector's pin to its ESD part
LONGEST = {"SW": 14.0, "BST": 12.0, "RTN": 45.0, "TRIGGER": 130.0, "EXPOSURE": 130.0,
           "CAM": 75.0, "SPI_": 110.0}
Point = tuple[float, float]
# Layer ("*": all), net, half width, ends; of a pad, its box instead of the last two.
Shape = tuple[str, str, float, Point, Point, Box | None]


def pads_of(board: Board) -> Iterator[tuple[Part, Pad, str]]:
    for part in board.parts.values():
        for pad in ALL[part.component.footprint].pads:
            yield part, pad, part.nets.get(pad.number, "")


def placed(board: Board) -> list[str]:
    missing = [f"{ref} has no place" for ref in board.parts if ref not in board.places]
    return missing + [f"{ref} has a place, but is no part" for ref in board.places
                      if ref not in board.parts]


def courtyards(board: Board) -> list[str]:
    boxes = [(part.ref, box_at(ALL[part.component.footprint].courtyard, board.places[part.ref]))
             for part in board.parts.values()]
    return [f"{a} and {b} overlap" for (a, first), (b, second) in itertools.combinations(boxes, 2)
            if first[0] < second[2] - 0.01 and second[0] < first[2] - 0.01 and
            first[1] < second[3] - 0.01 and second[1] < first[3] - 0.01]


def inside(board: Board) -> list[str]:
    faults = []
    for part, pad, _ in pads_of(board):
        x0, y0, x1, y1 = pad_box(pad, board.places[part.ref])
        if min(x0, y0, board.width - x1, board.height - y1) < 0.25:
            faults.append(f"{part.ref}: pad {pad.number} is less than 0.25 mm from the edge")
    return faults


def pin_spot(board: Board, part: Part, number: str) -> Point:
    pad = next(p for p in ALL[part.component.footprint].pads if p.number == number)
    return pad_at(pad, board.places[part.ref])


def near_capacitor(board: Board) -> list[str]:
    faults = []
    for part in board.parts.values():
        if part.component.family not in DECOUPLED:
            continue
        for pin in part.component.pins:
            net = part.nets.get(pin.number, "")
            if pin.kind != "power_in" or not net or net.startswith("GND"):
                continue
            spots = [pad_edge_gap(board, (part, pin.number), (other, each.number))
                     for other, each in board.pins_of(net)
                     if other.component.family == "capacitor"]
            if min(spots, default=99) > DECOUPLING:
                faults.append(f"{part.ref}: {pin.name} is {min(spots, default=99):.1f} mm from its "
                              f"capacitor, {DECOUPLING:g} are allowed")
    return faults


def pad_edge_gap(board: Board, one: tuple[Part, str], two: tuple[Part, str]) -> float:
    boxes = []
    for part, number in (one, two):
        pad = next(p for p in ALL[part.component.footprint].pads if p.number == number)
        boxes.append(pad_box(pad, board.places[part.ref]))
    return gap(boxes[0], boxes[1])


def near_connector(board: Board) -> list[str]:
    """ESD parts lie at the connector."""
    faults = []
    for part in board.parts.values():
        if part.component.family != "connector":
            continue
        for pin in part.component.pins:
            net = part.nets.get(pin.number, "")
            spots = [pad_edge_gap(board, (part, pin.number), (other, each.number))
                     for other, each in board.pins_of(net)
                     if other.component.family in ("esd", "tvs")] if net else []
            if spots and not net.startswith("GND") and min(spots) > ESD_REACH:
                faults.append(f"the ESD part of {net} is {min(spots):.1f} mm from {part.ref}")
    return faults


def lengths(board: Board, layout: Layout) -> list[str]:
    total: dict[str, float] = {}
    for _, net, _, x0, y0, x1, y1 in layout.tracks:
        total[net] = total.get(net, 0.0) + math.hypot(x1 - x0, y1 - y0)
    return [f"{net} is {length:.0f} mm long, {most:g} are allowed"
            for net, length in sorted(total.items()) for start, most in LONGEST.items()
            if net.startswith(start) and length > most]


def shapes(board: Board, layout: Layout) -> list[Shape]:
    """All copper but the planes; pads as the line along their middle."""
    found: list[Shape] = [(layer, net, width / 2, (x0, y0), (x1, y1), None)
                          for layer, net, width, x0, y0, x1, y1 in layout.tracks]
    found += [("*", net, VIA / 2, (x, y), (x, y), None) for net, x, y in [*layout.vias,
                                                                    *heat_vias(board)]]
    for part, pad, net in pads_of(board):
        box = pad_box(pad, board.places[part.ref])
        name = net or f"{part.ref}.{pad.number or (pad.x, pad.y)}{home_of(part)}"
        found.append(("*" if pad.drill else "F.Cu", name, 0.0, (box[0], box[1]), (box[2], box[3]),
                      box))
    return found


def home_of(part: Part) -> str:
    """Names the isolated side that all pads of a part are on."""
    isolated = part.group.startswith("isolated") and part.component.family != "isolator"
    return f" of {part.group.replace('isolated', 'ISO')}" if isolated else ""


def distance(a: Shape, b: Shape) -> float:
    """Between the edges of two shapes; negative if they touch."""
    if a[5] and b[5]:
        return gap(a[5], b[5]) or -0.01
    if a[5] or b[5]:
        box, other = (a[5], b) if a[5] else (b[5], a)
        assert box
        return to_box(other, box) - other[2]
    ends = [(p, b) for p in (a[3], a[4])] + [(p, a) for p in (b[3], b[4])]
    if crossing(a[3:5], b[3:5]):
        return -a[2] - b[2]
    return min(to_segment(p, s[3], s[4]) for p, s in ends) - a[2] - b[2]


def to_box(line: Shape, box: Box) -> float:
    """From the middle of a track to a pad."""
    if within(box, line[3]) or within(box, line[4]):
        return -0.01
    x0, y0, x1, y1 = box
    corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    sides = tuple(zip(corners, (*corners[1:], corners[0])))
    if any(crossing(line[3:5], side) for side in sides):
        return -0.01
    return min(*(to_segment(p, *side) for side in sides for p in line[3:5]),
               *(to_segment(corner, line[3], line[4]) for corner in corners))


def crossing(a: tuple[Point, Point], b: tuple[Point, Point]) -> bool:
    def side(p: Point, q: Point, r: Point) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(*a, b[0]) * side(*a, b[1]) < 0 and side(*b, a[0]) * side(*b, a[1]) < 0


def to_segment(p: Point, a: Point, b: Point) -> float:
    length = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    t = 0.0 if length == 0 else max(0.0, min(1.0, ((p[0] - a[0]) * (b[0] - a[0]) +
                                                   (p[1] - a[1]) * (b[1] - a[1])) / length))
    return math.hypot(p[0] - a[0] - t * (b[0] - a[0]), p[1] - a[1] - t * (b[1] - a[1]))


def pairs(found: list[Shape], reach: float) -> Iterator[tuple[int, int]]:
    """Of shapes that may be nearer to each other than this, by squares of 4 mm."""
    squares: dict[tuple[int, int], list[int]] = {}
    for i, (_, _, half, a, b, _) in enumerate(found):
        by = half + reach
        for x in range(int((min(a[0], b[0]) - by) // 4), int((max(a[0], b[0]) + by) // 4) + 1):
            for y in range(int((min(a[1], b[1]) - by) // 4), int((max(a[1], b[1]) + by) // 4) + 1):
                squares.setdefault((x, y), []).append(i)
    seen = set()
    for members in squares.values():
        for pair in itertools.combinations(members, 2):
            if pair not in seen:
                seen.add(pair)
                yield pair


def touch_layers(a: Shape, b: Shape) -> bool:
    return a[0] == "*" or b[0] == "*" or a[0] == b[0]


def clearances(board: Board, layout: Layout) -> list[str]:
    found = shapes(board, layout)
    faults = set()
    for i, j in pairs(found, CLEAR):
        a, b = found[i], found[j]
        if a[1] != b[1] and touch_layers(a, b) and distance(a, b) < CLEAR - 0.002:
            faults.add(f"{a[1]} and {b[1]} are {max(distance(a, b), 0):.2f} mm apart near "
                       f"({a[3][0]:.1f}, {a[3][1]:.1f})")
    return sorted(faults)


def connected(board: Board, layout: Layout) -> list[str]:
    """Each net is one piece; what reaches a plane by a via or a hole is joined by it."""
    found = shapes(board, layout)
    parent = list(range(len(found) + 1))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for i, j in pairs(found, 0.0):
        a, b = found[i], found[j]
        if a[1] == b[1] and touch_layers(a, b) and distance(a, b) < 0.0:
            parent[root(i)] = root(j)
    planes = {*board.planes.values(), *board.islands}
    first: dict[str, int] = {}
    for i, (layer, net, *_) in enumerate(found):
        if net in planes and layer == "*":
            parent[root(i)] = root(first.setdefault(net, i))
    areas = heat_areas(board)
    for i, (layer, net, _, spot, *_) in enumerate(found):
        if net in areas and within(areas[net], spot) and layer in ("F.Cu", "*"):
            parent[root(i)] = root(first.setdefault(net, i))
    pieces: dict[str, set[int]] = {}
    for i, (_, net, *_) in enumerate(found):
        pieces.setdefault(net, set()).add(root(i))
    return [f"{net} is in {len(roots)} pieces" for net, roots in sorted(pieces.items())
            if len(roots) > 1]


def within(box: Box, spot: Point) -> bool:
    return box[0] <= spot[0] <= box[2] and box[1] <= spot[1] <= box[3]


def widths(board: Board, layout: Layout) -> list[str]:
    """Tracks of supplies against their current, at 20 degrees of rise (IPC-2221, outer layer)."""
    faults = set()
    for _, net, width, x0, y0, x1, y1 in layout.tracks:
        if net in board.rails and math.hypot(x1 - x0, y1 - y0) > 1.0:
            bears = 0.048 * 20 ** 0.44 * (width * 39.37 * 1.378) ** 0.725
            if bears * 1000 < board.rails[net].milliamps:
                faults.add(f"{net} has a track of {width:g} mm, which bears {bears:.2f} A")
    return sorted(faults)


def isolation_gap(board: Board, layout: Layout) -> list[str]:
    """Copper of an isolated side, its plane included, is 2 mm from all other; below the isolator
    its own pads decide."""
    found = shapes(board, layout)
    faults = set()
    found += [("*", ground, 0.0, (box[0], box[1]), (box[2], box[3]), box)
              for ground, box in board.islands.items()]

    def home(net: str) -> str:
        return next((g for g in board.islands if g.replace("GND_", "") in net), "")

    for i, j in pairs(found, ISOLATION):
        a, b = found[i], found[j]
        if home(a[1]) != home(b[1]) and distance(a, b) < ISOLATION - 0.01:
            faults.add(f"{a[1]} and {b[1]} are {distance(a, b):.2f} mm apart, isolation needs "
                       f"{ISOLATION:g}")
    return sorted(faults)


def holes(board: Board, layout: Layout) -> list[str]:
    """Drilled holes are 0.25 mm apart."""
    drills = [(x, y, DRILL) for _, x, y in [*layout.vias, *heat_vias(board)]]
    for part, pad, _ in pads_of(board):
        if pad.drill:
            place = board.places[part.ref]
            x, y = pad_at(Pad(pad.number, pad.x, pad.y, 1, 1), place)
            drills.append((x, y, pad.drill))
    return [f"holes at ({a[0]:.1f}, {a[1]:.1f}) and ({b[0]:.1f}, {b[1]:.1f}) are too near"
            for a, b in itertools.combinations(sorted(drills), 2)
            if abs(a[0] - b[0]) < 5 and math.hypot(a[0] - b[0], a[1] - b[1]) <
            (a[2] + b[2]) / 2 + 0.25 - 0.001]


def silk(board: Board) -> list[str]:
    """Words do not lie on pads or on each other."""
    boxes = [(label[4], label_box(label)) for label in labels(board)]
    pads = [pad_box(pad, board.places[part.ref]) for part, pad, _ in pads_of(board)]
    faults = [f"'{text}' lies on a pad" for text, box in boxes if overlaps(box, pads, 0.0)]
    return faults + [f"'{a}' lies on '{b}'" for (a, one), (b, two) in
                     itertools.combinations(boxes, 2) if overlaps(one, [two], 0.0)]


SIMPLE = (placed, courtyards, inside, near_capacitor, near_connector, silk)
FULL = (lengths, widths, clearances, connected, isolation_gap, holes)


def layout_faults(board: Board, layout: Layout) -> list[str]:
    faults = placed(board)
    if faults:
        return faults
    for check in SIMPLE:
        faults += check(board)
    for full in FULL:
        faults += full(board, layout)
    return faults
