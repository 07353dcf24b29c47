# SPDX-License-Identifier: BSD-3-Clause
"""Where the parts lie: connectors, jumpers and the large parts by hand, the others as near as they
fit to the pin that they belong to."""
from __future__ import annotations

from typing import Any

import numpy

from model import Board, Box, Part, Place, box_at, gap, pad_at, pad_box
from footprints import ALL, grown
from small import adis_by_hand, leds_by_hand

STEP = 0.25  # mm of the grid that small parts lie on
REACH = 30.0  # mm that a part may be away from its pin
EDGE = 0.6  # mm between a courtyard and the edge
NEAR = 2.5  # mm from a chip's pin to its capacitor
MOAT = 2.2  # mm around an isolated area
Grid = numpy.ndarray[Any, Any]


CAMERAS_AT = (18.5, 40.5, 67.0, 85.0)  # middle of their connectors, at the lower edge
ISOLATED_AT = ((2, 20.5), (3, 39.5))  # middle of each isolated area, at the right edge
ISLAND = (20.0, 8.4)  # its depth, and half of its height


def hand(width: float, height: float) -> dict[str, Place]:
    top, bottom = 3.1, height - 3.1
    places = {
        "U1": Place(26.0, 42.7, 90), "F5": Place(73.0, 26.4, 90), "F6": Place(89.0, 4.4, 0),
        "F1": Place(59.9, 64.5, 270), "F2": Place(55.8, 64.5, 270), "F3": Place(51.7, 64.5, 270),
        "F4": Place(47.6, 64.5, 270), "J1": Place(width - 9.5, 56.5, 270),
        "J120": Place(58.25, height - 9.5, 180), "J760": Place(68.5, 9.5, 0),
        "J820": Place(3.1, 13.0, 270), "J700": Place(3.1, 24.9, 270),
        "U2": Place(75.2, 53.5, 0), "U3": Place(66.5, 43.5, 90), "L1": Place(63.5, 35.5, 90),
        "D2": Place(57.25, 38.75, 0),
        "J800": Place(3.1, 63.4, 270), "U840": Place(9.0, height - 7.5, 0),
        "D802": Place(29.5, height - 10.0, 0)}
    places |= {f"H{i + 1}": Place(x, y) for i, (x, y) in enumerate(
        (x, y) for y in (3.6, height - 3.6) for x in (3.6, width - 3.6))}
    places |= {ref: Place(x, bottom) for ref, x in (
        ("J200", CAMERAS_AT[0]), ("J801", 29.5), *((f"J{200 + 100 * n}", CAMERAS_AT[n])
                                                  for n in (1, 2, 3)))}
    places |= {ref: Place(x, top, 180) for ref, x in (
        ("J720", 10.3), ("J721", 17.2), ("J740", 24.1), ("J742", 31.7), ("J741", 39.9),
        ("J600", 49.1), ("J620", 59.5))}
    for n, x in enumerate(CAMERAS_AT):
        b = 200 + 100 * n
        places[f"JP{b}"] = Place(x, height - 15.0)
        places[f"JP{b + 1}"] = Place(x + (7.0 if n % 2 == 0 else -7.0), height - 18.4, 270)
    for n, y in ISOLATED_AT:
        b = 1000 + 100 * n
        places[f"U{b}"] = Place(width - ISLAND[0] - 1.4, y)
        places[f"J{b}"] = Place(width - 3.1, y, 90)
        places[f"C{b}"] = Place(width - ISLAND[0] - 3.8, y - 4.3, 90)
    return places | jumpers_at_the_top() | signs(width, height)


def jumpers_at_the_top() -> dict[str, Place]:
    return {"JP820": Place(13.5, 25.8), "C13": Place(8.3, 29.6), "C12": Place(11.9, 29.6),
            "JP700": Place(24.0, 28.2, 0), "JP701": Place(30.5, 28.2, 0),
            "JP600": Place(41.0, 28.2, 0), "JP601": Place(50.8, 27.3, 0),
            "JP620": Place(57.2, 28.2, 0), "JP621": Place(67.0, 27.3, 0),
            "JP800": Place(9.5, 57.6, 0)}


def signs(width: float, height: float) -> dict[str, Place]:
    """Lights and test points."""
    return {"D4": Place(width - 3.0, 69, 0), "D5": Place(width - 3.0, 65.5, 0),
            "D6": Place(width - 3.0, 72.5, 0), "D743": Place(36.6, 28.6, 0),
            "TP1": Place(69.6, 38.5), "TP2": Place(69.6, 35), "TP3": Place(73.3, 35),
            "TP4": Place(73.3, 31.5), "TP5": Place(73.3, 38.5)}


def islands(board: Board) -> dict[str, Box]:
    """Isolated areas, from the middle of the isolator to the edge of the board."""
    return {f"GND_ISO{n}": (board.width - ISLAND[0], y - ISLAND[1], board.width, y + ISLAND[1])
            for n, y in ISOLATED_AT if f"U{1000 + 100 * n}" in board.parts}


class Placer:
    def __init__(self, board: Board):
        self.board = board
        self.columns = int(board.width / STEP) + 1
        self.rows = int(board.height / STEP) + 1
        self.taken = numpy.zeros((self.rows, self.columns), bool)
        self.island = numpy.zeros((self.rows, self.columns), int)
        for i, box in enumerate(board.islands.values()):
            self.fill(self.island, (box[0] - MOAT, box[1] - MOAT, box[2], box[3] + MOAT), -1)
            self.fill(self.island, box, i + 1)
        for part in board.parts.values():
            if part.ref in board.places:
                self.occupy(part)

    def fill(self, grid: Grid, box: Box, value: int) -> None:
        x0, y0 = max(0, int(box[0] / STEP + 0.99)), max(0, int(box[1] / STEP + 0.99))
        grid[y0:int(box[3] / STEP) + 1, x0:int(box[2] / STEP) + 1] = value

    def occupy(self, part: Part) -> None:
        box = box_at(self.room(part), self.board.places[part.ref])
        self.fill(self.taken, box, True)

    @staticmethod
    def room(part: Part) -> Box:
        """The courtyard; of chips, also room for tracks, of connectors and jumpers for a label."""
        footprint = ALL[part.component.footprint]
        if footprint.name.startswith("JST") or part.component.family == "led":
            box = footprint.courtyard
            return box[0], box[1] - 1.3, box[2], box[3]
        if footprint.name.startswith("MICRO") and part.label:
            box = footprint.courtyard
            return box[0], box[1], box[2], box[3] + 1.3
        if part.component.family in ("jumper", "test_point"):
            return grown(footprint.body, 1.2)  # for its label
        if not 5 <= len(footprint.pads) <= 17 or part.component.family == "connector":
            return footprint.courtyard
        return grown(footprint.courtyard, 0.5 if footprint.name == "SSOP-8" else 0.25)

    def home(self, part: Part) -> int:
        """The island that a part belongs to; 0 for the rest of the board."""
        for i, ground in enumerate(self.board.islands):
            if part.group == ground.replace("GND_ISO", "isolated") and "+3V3" not in \
                    part.nets.values():
                return i + 1
        return 0

    def targets(self, part: Part) -> dict[str, list[tuple[float, float]]]:
        """Where the nets of a part already have pads."""
        found: dict[str, list[tuple[float, float]]] = {}
        for number, net in part.nets.items():
            if net in self.board.planes.values() or net in self.board.islands:
                continue
            spots = [pad_at(pad, self.board.places[other.ref])
                     for other, pin in self.board.pins_of(net) if other.ref in self.board.places
                     for pad in ALL[other.component.footprint].pads if pad.number == pin.number]
            if spots:
                found[number] = spots
        return found

    def anchor(self, part: Part) -> tuple[float, float]:
        ref, _, pin = part.near.partition(".")
        other = self.board.parts[ref]
        numbers = [each.number for each in other.component.pins if pin in (each.name, each.number)]
        for pad in ALL[other.component.footprint].pads:
            if pad.number in numbers:
                return pad_at(pad, self.board.places[ref])
        raise KeyError(part.near)

    def place(self, part: Part) -> None:
        """A chip only where its capacitors find room beside it, too."""
        x, y = self.anchor(part)
        helpers = [other for other in self.board.parts.values()
                   if other.component.family == "capacitor" and other.component.footprint == "0603"
                   and other.near.startswith(f"{part.ref}.") and other.ref not in self.board.places]
        refused: list[tuple[float, float]] = []
        while True:
            tries = [found for turn in (0, 90, 180, 270)
                     if (found := self.best_at(part, turn, (x, y), refused))]
            if not tries or len(refused) > 400:
                raise RuntimeError(f"no room for {part.ref} near {part.near}")
            for best in sorted(tries):
                if self.settle(part, Place(best[1], best[2], best[3]), helpers):
                    return
                refused.append((best[1], best[2]))

    def settle(self, part: Part, place: Place, helpers: list[Part]) -> bool:
        before = self.taken.copy()
        self.board.places[part.ref] = place
        self.occupy(part)
        for helper in helpers:
            self.place(helper)
        if all(self.gap_to(helper) <= NEAR for helper in helpers):
            return True
        self.taken = before
        for each in (part, *helpers):
            del self.board.places[each.ref]
        return False

    def gap_to(self, helper: Part) -> float:
        """From a capacitor's pad to the pin that it belongs to."""
        ref, _, number = helper.near.partition(".")
        other = self.board.parts[ref]
        net = other.net(number)
        boxes = [pad_box(pad, self.board.places[each.ref]) for each in (other, helper)
                 for pad in ALL[each.component.footprint].pads
                 if (pad.number == number if each is other else each.nets.get(pad.number) == net)]
        return gap(boxes[0], boxes[1])

    def best_at(self, part: Part, turn: int, at: tuple[float, float],
                refused: list[tuple[float, float]]) -> tuple[float, float, float, int] | None:
        x, y = at
        box = box_at(self.room(part), Place(0, 0, turn))
        xs = numpy.arange(round((x - REACH) / STEP), round((x + REACH) / STEP) + 1)
        ys = numpy.arange(round((y - REACH) / STEP), round((y + REACH) / STEP) + 1)
        free = self.free(box, xs, ys, self.home(part))
        if not free.any():
            return None
        gx, gy = numpy.meshgrid(xs * STEP, ys * STEP)
        cost = self.cost(part, turn, gx, gy, (x, y))
        cost[~free] = numpy.inf
        for bad_x, bad_y in refused:
            cost[(abs(gx - bad_x) < 0.4) & (abs(gy - bad_y) < 0.4)] = numpy.inf
        if not numpy.isfinite(cost).any():
            return None
        row, column = numpy.unravel_index(numpy.argmin(cost), cost.shape)
        return (float(cost[row, column]), round(float(gx[row, column]), 3),
                round(float(gy[row, column]), 3), turn)

    def free(self, box: Box, xs: Grid, ys: Grid, home: int) -> Grid:
        blocked = self.taken | (self.island != home)
        sums = numpy.zeros((self.rows + 1, self.columns + 1), int)
        sums[1:, 1:] = blocked.cumsum(0).cumsum(1)
        left = numpy.floor(box[0] / STEP).astype(int) + xs
        right = numpy.ceil(box[2] / STEP).astype(int) + xs + 1
        top = numpy.floor(box[1] / STEP).astype(int) + ys
        bottom = numpy.ceil(box[3] / STEP).astype(int) + ys + 1
        edge = int(EDGE / STEP)
        inside = ((left >= edge) & (right <= self.columns - edge))[None, :] & \
            ((top >= edge) & (bottom <= self.rows - edge))[:, None]
        left, right = left.clip(0, self.columns), right.clip(0, self.columns)
        top, bottom = top.clip(0, self.rows), bottom.clip(0, self.rows)
        count = (sums[bottom][:, right] - sums[top][:, right] - sums[bottom][:, left]
                 + sums[top][:, left])
        return numpy.asarray(inside & (count == 0))

    def cost(self, part: Part, turn: int, gx: Grid, gy: Grid, anchor: tuple[float, float]) -> Grid:
        cost = 0.0 * gx
        pads = {pad.number: pad for pad in ALL[part.component.footprint].pads}
        near = [number for number, net in part.nets.items()
                if net == self.board.parts[part.near.split(".")[0]].net(part.near.split(".")[1])]
        spread = {} if part.component.family == "capacitor" else self.targets(part)
        for number, spots in spread.items():
            dx, dy = pad_at(pads[number], Place(0, 0, turn))
            cost = cost + numpy.min([abs(gx + dx - x) + abs(gy + dy - y) for x, y in spots], 0)
        dx, dy = pad_at(pads[near[0]], Place(0, 0, turn)) if near else (0.0, 0.0)
        strong = 6.0 if part.component.family == "capacitor" else 1.5
        return cost + strong * numpy.hypot(gx + dx - anchor[0], gy + dy - anchor[1])


RANK = {"esd": 0, "tvs": 0, "t45": 1, "schmitt": 1, "lvc": 1, "capacitor": 2, "clamp": 3, "nmos": 1}


def place(board: Board, by_hand: dict[str, Place]) -> None:
    board.places = {ref: at for ref, at in by_hand.items() if ref in board.parts}
    board.islands = islands(board)
    placer = Placer(board)
    waiting = [part for part in board.parts.values() if part.ref not in board.places]
    groups = list(dict.fromkeys(part.group for part in waiting))

    def turn(part: Part) -> tuple[bool, int, int]:
        """ESD parts first, at their connectors; then group by group."""
        family = part.component.family
        return family not in ("esd", "tvs"), groups.index(part.group), RANK.get(family, 4)

    waiting.sort(key=turn)
    while waiting:
        ready = [part for part in waiting if part.near.split(".")[0] in board.places]
        if not ready:
            raise RuntimeError(f"{[part.ref for part in waiting]} are near nothing that is placed")
        ready.sort(key=turn)
        placer.place(ready[0])
        waiting = [part for part in waiting if part.ref not in board.places]


HANDS = {"carrier": hand, "leds": leds_by_hand, "adis": adis_by_hand}
