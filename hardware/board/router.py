# SPDX-License-Identifier: BSD-3-Clause
"""A router for boards whose nets are slow: two outer layers on a grid of 0.2 mm, planes within.

All nets are routed as if others gave way, at a price for each conflict that grows from round to
round, until none is left (negotiated congestion, after McMurchie and Ebeling's PathFinder).
"""
from __future__ import annotations

import heapq
import math
import sys
from typing import Any, Iterator

import numpy

from footprints import ALL
from model import Board, Box, Pad, Part, pad_at, pad_box, turned
from rules import CLEARANCE, DRILL, EDGE, FACE, ISOLATION, VIA, WIDTHS

PITCH = 0.2
VIA_COST = 8.0
Track = tuple[str, str, float, float, float, float, float]
Via = tuple[str, float, float]
Node = tuple[int, int, int]  # layer, row, column
Grid = numpy.ndarray[Any, Any]
POWER = {"VIN", "VPROT", "5V_BUCK", "+5V", "SW", "5V_OUT", "VLIGHT", "VCAM0", "VCAM1", "VCAM2",
         "VCAM3"}


def width_class(net: str) -> int:
    if net in POWER:
        return 2
    supply = net.startswith(("LEVEL", "24V", "5V", "LIDAR0_LEVEL", "LIDAR1_LEVEL", "+1"))
    return 1 if supply or net in ("RTN", "LIGHT_SINK", "BST") else 0


def disc(radius: float) -> list[tuple[int, int]]:
    """Grid points nearer than this; those at exactly this distance are free."""
    reach, limit = int(radius / PITCH) + 1, radius - 1e-6
    return [(dy, dx) for dy in range(-reach, reach + 1) for dx in range(-reach, reach + 1)
            if math.hypot(dx, dy) * PITCH < limit]


class Window:
    """A part of the board in which one way is searched (A*); nodes are numbers here."""

    def __init__(self, box: tuple[int, int, int, int], cost: Grid, via_cost: Grid, plane: bool):
        y0, y1, self.x0, x1 = box
        self.y0, self.wide, self.tall = y0, x1 - self.x0 + 1, y1 - y0 + 1
        self.x1, self.y1, self.plane = x1, y1, plane
        self.size = self.wide * self.tall
        self.costs = cost[:, y0:y1 + 1, self.x0:x1 + 1].ravel().tolist()
        self.vias = via_cost[y0:y1 + 1, self.x0:x1 + 1].ravel().tolist()
        self.targets: set[int] = set()
        self.aim_box = (0, 0, 0, 0)
        self.came: dict[int, int] = {}

    def index(self, node: Node) -> int:
        return node[0] * self.size + (node[1] - self.y0) * self.wide + node[2] - self.x0

    def aim(self, goals: set[Node]) -> None:
        self.targets = {self.index(n) for n in goals if self.y0 <= n[1] <= self.y1 and
                        self.x0 <= n[2] <= self.x1}
        rows = [n[1] - self.y0 for n in goals] or [0]
        columns = [n[2] - self.x0 for n in goals] or [0]
        self.aim_box = min(rows), max(rows), min(columns), max(columns)

    def guess(self, i: int) -> float:
        """Never more than what is left to go."""
        if self.plane or i < 0:
            return 0.0
        low_y, high_y, low_x, high_x = self.aim_box
        y, x = divmod(i % self.size, self.wide)
        dy = low_y - y if y < low_y else y - high_y if y > high_y else 0
        dx = low_x - x if x < low_x else x - high_x if x > high_x else 0
        return dx + 0.414 * dy if dx > dy else dy + 0.414 * dx

    def beside(self, i: int) -> Iterator[tuple[int, float]]:
        """Nodes next to one on its layer, and what a step there costs."""
        wide, costs, spot = self.wide, self.costs, i % self.size
        x = spot % wide
        for step, length in ((1, 1.0), (-1, 1.0), (wide, 1.0), (-wide, 1.0), (wide + 1, 1.414),
                             (wide - 1, 1.414), (-wide + 1, 1.414), (-wide - 1, 1.414)):
            if not 0 <= spot + step < self.size or abs((spot + step) % wide - x) > 1:
                continue
            price = costs[i + step]
            if length > 1:  # the corners beside it count, too
                row = wide if step > 1 else -wide
                price = max(price, costs[i + row], costs[i + step - row])
            yield i + step, length * price

    def through(self, i: int) -> tuple[int, float]:
        """The other end of a via; a negative number is the plane."""
        price = self.vias[i % self.size]
        if self.plane:
            return -i - 1, price
        j = i + self.size if i < self.size else i - self.size
        return j, price + self.costs[j]

    def find(self, sources: list[int]) -> tuple[int, bool]:
        """Where the cheapest way ends, and whether with a via to the plane; -1: there is none."""
        best = {i: 0.0 for i in sources}
        heap = [(self.guess(i), i) for i in best]
        heapq.heapify(heap)
        done: set[int] = set()
        while heap:
            _, i = heapq.heappop(heap)
            if i in done:
                continue
            done.add(i)
            if i < 0:
                return -i - 1, True
            if i in self.targets:
                return i, False
            base = best[i]
            for j, price in (*self.beside(i), self.through(i)):
                if base + price < best.get(j, math.inf):
                    best[j] = base + price
                    if j >= 0:
                        self.came[j] = i
                    heapq.heappush(heap, (best[j] + self.guess(j), j))
        return -1, False

    def trace(self, i: int) -> list[Node]:
        path = []
        while True:
            layer, spot = divmod(i, self.size)
            path.append((layer, spot // self.wide + self.y0, spot % self.wide + self.x0))
            if i not in self.came:
                return path[::-1]
            i = self.came[i]


class Router:
    def __init__(self, board: Board, keep: dict[str, Box] | None = None):
        self.board = board
        self.rows, self.columns = round(board.height / PITCH) + 1, round(board.width / PITCH) + 1
        self.shape = (2, self.rows, self.columns)
        self.names = board.nets()
        self.number = {net: i + 1 for i, net in enumerate(self.names)}
        self.static = [numpy.zeros(self.shape, numpy.int32) for _ in WIDTHS]
        self.static_via = numpy.zeros((self.rows, self.columns), numpy.int32)
        self.used = [numpy.zeros(self.shape, numpy.int32) for _ in WIDTHS]
        self.used_via = numpy.zeros((self.rows, self.columns), numpy.int32)
        self.history = numpy.zeros(self.shape)
        self.leads: list[Track] = []
        self.pads: dict[str, list[tuple[tuple[int, ...], Box, bool]]] = {}
        self.paths: dict[str, list[list[Node]]] = {}
        self.marks: dict[str, list[Grid]] = {}
        self.pressure = 0.5
        self.discs = [[disc(w / 2 + v / 2 + CLEARANCE) for v in WIDTHS] for w in WIDTHS]
        self.via_discs = [disc(VIA / 2 + v / 2 + CLEARANCE) for v in WIDTHS]
        self.via_via = disc(max(VIA + CLEARANCE, DRILL + 0.26))
        self.block_edges()
        self.block_pads()
        for net, box in (keep or {}).items():
            for grid in self.static:
                self.claim(grid[1], box, 0.2, self.number[net])
            self.claim(self.static_via, box, 0.5, self.number[net])

    def claim(self, grid: Grid, box: Box, margin: float, owner: int) -> None:
        """Blocks what lies nearer than the margin for all but one net."""
        x0, y0 = math.ceil((box[0] - margin) / PITCH), math.ceil((box[1] - margin) / PITCH)
        x1, y1 = math.floor((box[2] + margin) / PITCH), math.floor((box[3] + margin) / PITCH)
        x0, y0 = max(x0, 0), max(y0, 0)
        rows = numpy.arange(y0, min(y1, self.rows - 1) + 1) * PITCH
        columns = numpy.arange(x0, min(x1, self.columns - 1) + 1) * PITCH
        if not len(rows) or not len(columns):
            return
        dy = numpy.maximum(numpy.maximum(box[1] - rows, rows - box[3]), 0)[:, None]
        dx = numpy.maximum(numpy.maximum(box[0] - columns, columns - box[2]), 0)[None, :]
        near = dx * dx + dy * dy < (margin - 1e-6) ** 2
        if margin == 0:
            near = numpy.ones_like(near)
        part = grid[y0:y0 + len(rows), x0:x0 + len(columns)]
        part[near] = numpy.where((part[near] == 0) | (part[near] == owner), owner, -1)

    def block_edges(self) -> None:
        grids = [(grid[face], width / 2) for grid, width in zip(self.static, WIDTHS)
                 for face in (0, 1)] + [(self.static_via, VIA / 2)]
        for grid, half in grids:
            rim = math.ceil((EDGE + half) / PITCH - 1e-9)
            for part in (grid[:rim], grid[-rim:], grid[:, :rim], grid[:, -rim:]):
                part[:] = -1

    def block_pads(self) -> None:
        for part in self.board.parts.values():
            place = self.board.places[part.ref]
            for pad in ALL[part.component.footprint].pads:
                net = part.nets.get(pad.number, "")
                owner = self.number.get(net, -1)
                faces = (0, 1) if pad.drill else (0,)
                box = pad_box(pad, place)
                for face in faces:
                    for grid, width in zip(self.static, WIDTHS):
                        self.claim(grid[face], box, width / 2 + max(CLEARANCE, 0.26 * (
                            not pad.plated)), owner)
                self.claim(self.static_via, box, VIA / 2 + CLEARANCE, owner)
                if not pad.drill:  # solder would flow away
                    self.claim(self.static_via, box, VIA / 2 + 0.05, -1)
                else:
                    self.claim(self.static_via, box, VIA / 2 + 0.25, -1)
                if net and not self.joined(part, pad, net):
                    if ALL[part.component.footprint].escape:
                        box = self.lead_out(part, pad, net, owner)
                    elif pad.shape in ("oval", "circle"):
                        box = within(box)
                    self.pads.setdefault(net, []).append((faces, box, pad.drill > 0))

    def joined(self, part: Part, pad: Pad, net: str) -> bool:
        """Beside the last pad of a row that has the same net: a short track joins them, and wide
        tracks leave from the last one, where there is room."""
        footprint = ALL[part.component.footprint]
        if footprint.name != "HTSSOP-16" or net == "RTN" or pad.number not in ("2", "15"):
            return False
        number = {"2": "1", "15": "16"}[pad.number]
        other = next(p for p in footprint.pads if p.number == number)
        assert part.nets.get(number) == net
        a, b = (pad_at(p, self.board.places[part.ref]) for p in (pad, other))
        self.leads.append(("F.Cu", net, 0.4, round(a[0], 3), round(a[1], 3), round(b[0], 3),
                           round(b[1], 3)))
        return True

    def lead_out(self, part: Part, pad: Pad, net: str, owner: int) -> Box:
        """A straight track from a narrow pad outwards; what it ends at is on the grid's terms."""
        length = ALL[part.component.footprint].escape
        place = self.board.places[part.ref]
        dx, dy = ((math.copysign(length, pad.x), 0.0) if pad.width > pad.height else
                  (0.0, math.copysign(length, pad.y)))
        x0, y0 = pad_at(pad, place)
        dx, dy = turned(dx, dy, place.turn)
        x1, y1 = x0 + dx, y0 + dy
        self.leads.append(("F.Cu", net, WIDTHS[0], round(x0, 3), round(y0, 3), round(x1, 3),
                           round(y1, 3)))
        box = min(x0, x1) - 0.1, min(y0, y1) - 0.1, max(x0, x1) + 0.1, max(y0, y1) + 0.1
        for grid, width in zip(self.static, WIDTHS):
            self.claim(grid[0], box, width / 2 + CLEARANCE, owner)
        self.claim(self.static_via, box, VIA / 2 + CLEARANCE, owner)
        return x1 - 0.1, y1 - 0.1, x1 + 0.1, y1 + 0.1

    def home(self, net: str) -> str:
        return next((ground for ground in self.board.islands
                     if ground.replace("GND_", "") in net), "")

    def free(self, net: str) -> tuple[Grid, Grid]:
        """Where tracks and vias of a net may lie, whatever other nets do."""
        k, owner = width_class(net), self.number[net]
        tracks = (self.static[k] == 0) | (self.static[k] == owner)
        vias = (self.static_via == 0) | (self.static_via == owner)
        for ground, box in self.board.islands.items():
            mask = numpy.zeros((self.rows, self.columns), numpy.int32)
            if ground == self.home(net):
                mask[:] = 1
                inner = (box[0] + 0.4, box[1] + 0.4, box[2], box[3] - 0.4)
                x0, y0 = math.ceil(inner[0] / PITCH), math.ceil(inner[1] / PITCH)
                mask[y0:math.floor(inner[3] / PITCH) + 1, x0:] = 0
            else:
                self.claim(mask, box, ISOLATION + 0.3, 1)
            tracks &= (mask == 0)[None]
            vias &= mask == 0
        return tracks, vias

    def inside(self, box: Box) -> list[tuple[int, int]]:
        """Grid points in a pad; at least the nearest one."""
        xs = range(math.ceil(box[0] / PITCH - 1e-9), math.floor(box[2] / PITCH + 1e-9) + 1)
        ys = range(math.ceil(box[1] / PITCH - 1e-9), math.floor(box[3] / PITCH + 1e-9) + 1)
        return [(y, x) for y in ys for x in xs if 0 <= y < self.rows and 0 <= x < self.columns]

    def pad_nodes(self, net: str) -> list[list[Node]]:
        k = width_class(net)
        found = []
        for faces, box, _ in self.pads[net]:
            nodes = [(face, y, x) for face in faces for y, x in self.inside(box)]
            good = [n for n in nodes if self.static[k][n] in (0, self.number[net])]
            found.append(good or nodes)
        return found

    def route(self, net: str) -> None:
        tracks, vias = self.free(net)
        k = width_class(net)
        cost = 1.0 + self.history + self.pressure * self.used[k]
        cost[~tracks] = numpy.inf
        via_cost = VIA_COST + self.pressure * 3 * self.used_via
        via_cost[~vias] = numpy.inf
        pads = self.pad_nodes(net)
        if net in self.plane_nets():
            self.paths[net] = self.to_plane(net, pads, cost, via_cost)
        else:
            self.paths[net] = self.tree(net, pads, cost, via_cost)
        self.mark(net, 1)

    def plane_nets(self) -> set[str]:
        return {*self.board.planes.values(), *self.board.islands}

    def to_plane(self, net: str, pads: list[list[Node]], cost: Grid, via_cost: Grid
                 ) -> list[list[Node]]:
        """From each pad on the surface to a via of its own, or to one beside it."""
        paths = []
        ready: set[Node] = set()
        for (_, box, drilled), nodes in zip(self.pads[net], pads):
            if drilled:
                continue
            path = self.search(net, nodes, ready, cost, via_cost, True)
            paths.append(path)
            ready.update(path)
        return paths

    def tree(self, net: str, pads: list[list[Node]], cost: Grid, via_cost: Grid
             ) -> list[list[Node]]:
        joined = list(pads[0])
        waiting = list(range(1, len(pads)))
        paths = []

        def distance(i: int) -> float:
            _, y, x = pads[i][0]
            return min(abs(y - b) + abs(x - a) for _, b, a in joined)

        while waiting:
            nearest = min(waiting, key=distance)
            path = self.search(net, joined, set(pads[nearest]), cost, via_cost, False)
            paths.append(path)
            joined += path + pads[nearest]
            waiting.remove(nearest)
        return paths

    def search(self, net: str, sources: list[Node], goals: set[Node], cost: Grid, via_cost: Grid,
               plane: bool) -> list[Node]:
        for margin in (30, 100, 10_000):
            path = self.search_within(sources, goals, cost, via_cost, plane, margin)
            if path:
                return path
        raise RuntimeError(f"no way for {net} from {self.where(sources)} to "
                           f"{self.where(list(goals))}")

    @staticmethod
    def where(nodes: list[Node]) -> str:
        if not nodes:
            return "the plane"
        return f"({nodes[0][2] * PITCH:.1f}, {nodes[0][1] * PITCH:.1f})"

    def window(self, sources: list[Node], goals: set[Node], plane: bool, margin: int
               ) -> tuple[int, int, int, int]:
        nodes = sources if plane else [*sources, *goals]
        rows, columns = [n[1] for n in nodes], [n[2] for n in nodes]
        return (max(min(rows) - margin, 0), min(max(rows) + margin, self.rows - 1),
                max(min(columns) - margin, 0), min(max(columns) + margin, self.columns - 1))

    def search_within(self, sources: list[Node], goals: set[Node], cost: Grid, via_cost: Grid,
                      plane: bool, margin: int) -> list[Node]:
        box = self.window(sources, goals, plane, margin)
        window = Window(box, cost, via_cost, plane)
        window.aim(goals)
        finish, at_via = window.find([window.index(n) for n in sources])
        if finish < 0:
            return []
        path = window.trace(finish)
        if at_via:
            layer, y, x = path[-1]
            path.append((1 - layer, y, x))
        return path

    def vias_of(self, net: str) -> set[tuple[int, int]]:
        return {(b[1], b[2]) for path in self.paths[net] for a, b in zip(path, path[1:])
                if a[0] != b[0]}

    def nodes_of(self, net: str) -> set[Node]:
        """On which a track lies; a via that only reaches a plane has none on the far side."""
        found: set[Node] = set()
        for path in self.paths[net]:
            found.update(path)
        return found

    def mark(self, net: str, sign: int) -> None:
        if sign > 0:
            self.marks[net] = self.shadow(net)
        *tracks, vias = self.marks[net]
        for grid, mark in zip(self.used, tracks):
            grid += sign * mark
        self.used_via += sign * vias

    def shadow(self, net: str) -> list[Grid]:
        k = width_class(net)
        nodes, vias = self.nodes_of(net), self.vias_of(net)
        marks = []
        for c in range(len(WIDTHS)):
            mark = numpy.zeros(self.shape, bool)
            stamp(mark, nodes, self.discs[k][c])
            for face in (0, 1):
                stamp(mark, {(face, y, x) for y, x in vias}, self.via_discs[c])
            marks.append(mark)
        flat = numpy.zeros((1, self.rows, self.columns), bool)
        stamp(flat, {(0, y, x) for _, y, x in nodes}, self.via_discs[k])
        stamp(flat, {(0, y, x) for y, x in vias}, self.via_via)
        return [*marks, flat[0]]

    def conflicts(self) -> set[str]:
        """Nets that lie too near to another one."""
        wrong = set()
        for net in self.paths:
            k = width_class(net)
            own = self.marks[net]
            hit = any(self.used[k][n] > own[k][n] for n in self.nodes_of(net))
            if hit or any(self.used_via[v] > own[-1][v] for v in self.vias_of(net)):
                wrong.add(net)
        return wrong

    def run(self, rounds: int = 60) -> None:
        def span(net: str) -> float:
            boxes = [box for _, box, _ in self.pads[net]]
            return (max(b[2] for b in boxes) - min(b[0] for b in boxes)
                    + max(b[3] for b in boxes) - min(b[1] for b in boxes))

        order = sorted((n for n in self.names if len(self.pads[n]) > 1),
                       key=lambda n: (n not in self.plane_nets(), -width_class(n), span(n)))
        todo = set(order)
        for turn in range(rounds):
            for net in (n for n in order if n in todo):
                if net in self.paths:
                    self.mark(net, -1)
                self.route(net)
            todo = self.conflicts()
            print(f"round {turn}: {len(todo)} nets in conflict", file=sys.stderr, flush=True)
            if not todo:
                return
            self.pressure = min(self.pressure * 1.4, 40)
            spots = self.remember(todo, turn)
            if turn % 6 == 5:  # those around them may have to move, too
                todo |= self.neighbours(spots)
        raise RuntimeError(f"{len(todo)} nets are still in conflict: {sorted(todo)}")

    def remember(self, nets: set[str], turn: int) -> list[Node]:
        """Makes the nodes dearer that they fight for, for good; and returns these."""
        spots = []
        for net in sorted(nets):
            k = width_class(net)
            for node in self.nodes_of(net):
                if self.used[k][node] > self.marks[net][k][node]:
                    self.history[node] += 0.6 + 0.1 * turn
                    spots.append(node)
        return spots

    def neighbours(self, spots: list[Node]) -> set[str]:
        """Nets that pass within 2.4 mm."""
        squares = {(y // 12 + dy, x // 12 + dx) for _, y, x in spots for dy in (-1, 0, 1)
                   for dx in (-1, 0, 1)}
        planes = self.plane_nets()
        return {net for net in self.paths if net not in planes and
                any((y // 12, x // 12) in squares for _, y, x in self.nodes_of(net))}

    def tracks(self) -> list[Track]:
        found = list(self.leads)
        for net, paths in sorted(self.paths.items()):
            width = WIDTHS[width_class(net)]
            seen: set[tuple[Node, Node]] = set()
            for path in paths:
                for first, last in straight(path, seen):
                    found.append((FACE[first[0]], net, width, round(first[2] * PITCH, 3),
                                  round(first[1] * PITCH, 3), round(last[2] * PITCH, 3),
                                  round(last[1] * PITCH, 3)))
        return found

    def vias(self) -> list[Via]:
        return [(net, round(x * PITCH, 3), round(y * PITCH, 3)) for net in sorted(self.paths)
                for y, x in sorted(self.vias_of(net))]


def within(box: Box) -> Box:
    """Of a round pad, what surely lies in it."""
    by = 0.15 * min(box[2] - box[0], box[3] - box[1])
    return box[0] + by, box[1] + by, box[2] - by, box[3] - by


def stamp(mark: Grid, nodes: set[Node], offsets: list[tuple[int, int]]) -> None:
    if not nodes:
        return
    where = numpy.array(sorted(nodes))
    _, rows, columns = mark.shape
    for dy, dx in offsets:
        y = (where[:, 1] + dy).clip(0, rows - 1)
        x = (where[:, 2] + dx).clip(0, columns - 1)
        mark[where[:, 0], y, x] = True


def straight(path: list[Node], seen: set[tuple[Node, Node]]) -> Iterator[tuple[Node, Node]]:
    """Its straight pieces on one layer."""
    start = 0
    for i in range(1, len(path) + 1):
        if i < len(path) and i - start >= 1:
            first = (path[start + 1][0] - path[start][0], path[start + 1][1] - path[start][1],
                     path[start + 1][2] - path[start][2])
            step = (path[i][0] - path[i - 1][0], path[i][1] - path[i - 1][1],
                    path[i][2] - path[i - 1][2])
            if step == first:
                continue
        if i - 1 > start and path[start][0] == path[i - 1][0]:
            piece = (path[start], path[i - 1])
            if piece not in seen:
                seen.add(piece)
                yield piece
        start = i - 1
        if i < len(path) and path[i][0] != path[i - 1][0]:
            start = i
