# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of the sheets, for readers without KiCad: drawn from the written files."""
from __future__ import annotations

import html
import math
from typing import Any

from reread import property_of, row, rows
from sexpr import read

Sexpr = list[Any]
RED, GREEN, BLUE, FILL = "#840000", "#008400", "#0000a0", "#ffffc2"


class Drawing:
    """Shapes in mm; points of a symbol are moved and turned to its place."""

    def __init__(self) -> None:
        self.out: list[str] = []
        self.points: list[tuple[float, float]] = []
        self.x, self.y, self.turn = 0.0, 0.0, 0.0

    def at(self, x: Any, y: Any) -> tuple[float, float]:
        angle = math.radians(self.turn)
        dx, dy = float(x), -float(y)
        return (self.x + dx * math.cos(angle) + dy * math.sin(angle),
                self.y - dx * math.sin(angle) + dy * math.cos(angle))

    def path(self, points: list[tuple[float, float]], colour: str, fill: str = "none",
             style: str = "") -> None:
        self.points += points
        text = " ".join(f"{x:.2f},{y:.2f}" for x, y in points)
        self.out.append(f'<polyline points="{text}" fill="{fill}" stroke="{colour}" '
                        f'stroke-width=".2"{style}/>')

    def text(self, x: float, y: float, words: str, size: float, colour: str,
             anchor: str = "middle") -> None:
        self.out.append(f'<text x="{x:.2f}" y="{y + size * 0.35:.2f}" font-size="{size:g}" '
                        f'fill="{colour}" text-anchor="{anchor}">{html.escape(words)}</text>')

    def symbol(self, instance: Sexpr, library: Sexpr) -> None:
        self.x, self.y, self.turn = (float(value) for value in row(instance, "at")[1:4])
        small = bool(rows(library, "pin_names")) and "hide" in row(library, "pin_names")
        for unit in rows(library, "symbol"):
            for shape in unit[2:]:
                self.shape(shape)
            for pin in rows(unit, "pin"):
                self.pin(pin, small)
        if property_of(instance, "Reference").startswith("#"):
            return
        for name, colour, size in (("Reference", "#006464", 1.3), ("Value", "#006464", 1.1)):
            spot = next(p for p in rows(instance, "property") if p[1] == name)
            self.text(float(row(spot, "at")[1]), float(row(spot, "at")[2]), str(spot[2]), size,
                      colour)

    def shape(self, shape: Any) -> None:
        if not isinstance(shape, list):
            return
        if shape[0] == "rectangle":
            x0, y0 = row(shape, "start")[1:]
            x1, y1 = row(shape, "end")[1:]
            fill = FILL if row(row(shape, "fill"), "type")[1] == "background" else "none"
            corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))
            self.path([self.at(x, y) for x, y in corners], RED, fill)
        elif shape[0] == "polyline":
            self.path([self.at(*xy[1:]) for xy in rows(row(shape, "pts"), "xy")], RED)
        elif shape[0] == "arc":
            self.path([self.at(*row(shape, name)[1:]) for name in ("start", "mid", "end")], RED)

    def pin(self, pin: Sexpr, small: bool) -> None:
        x, y, turn = (float(value) for value in row(pin, "at")[1:])
        length = float(row(pin, "length")[1])
        inner = x + length * math.cos(math.radians(turn)), y + length * math.sin(math.radians(turn))
        self.path([self.at(x, y), self.at(*inner)], RED)
        if small or "hide" in pin:
            return
        left = turn == 0
        name = self.at(inner[0] + (0.7 if left else -0.7), inner[1])
        self.text(*name, str(row(pin, "name")[1]), 1.2, "#006464", "start" if left else "end")
        number = self.at((x + inner[0]) / 2, y + 0.8)
        self.text(*number, str(row(pin, "number")[1]), 0.9, RED)

    def label(self, label: Sexpr) -> None:
        x, y, turn = (float(value) for value in row(label, "at")[1:])
        words = str(label[1])
        wide, sign = 0.78 * len(words) + 1.2, -1 if turn == 180 else 1
        self.path([(x, y - 0.9), (x + sign * wide, y - 0.9), (x + sign * wide, y + 0.9),
                   (x, y + 0.9), (x, y - 0.9)], RED, "white")
        self.text(x + sign * wide / 2, y, words, 1.1, RED)


def picture(text: str) -> str:
    sheet, drawing = read(text), Drawing()
    library = {str(each[1]): each for each in rows(row(sheet, "lib_symbols"), "symbol")}
    for line in rows(sheet, "polyline"):
        drawing.path([(float(xy[1]), float(xy[2])) for xy in rows(row(line, "pts"), "xy")], BLUE,
                     style=' stroke-dasharray="1.5 1"')
    for wire in rows(sheet, "wire"):
        drawing.path([(float(xy[1]), float(xy[2])) for xy in rows(row(wire, "pts"), "xy")], GREEN)
    for instance in rows(sheet, "symbol"):
        drawing.symbol(instance, library[str(row(instance, "lib_id")[1])])
    for label in rows(sheet, "global_label"):
        drawing.label(label)
    for words in rows(sheet, "text"):
        x, y = (float(value) for value in row(words, "at")[1:3])
        size = float(row(row(row(words, "effects"), "font"), "size")[1])
        drawing.text(x, y - size * 0.5, str(words[1]), size, BLUE, "start")
    for cross in rows(sheet, "no_connect"):
        x, y = (float(value) for value in row(cross, "at")[1:3])
        drawing.path([(x - 0.6, y - 0.6), (x + 0.6, y + 0.6)], BLUE)
        drawing.path([(x - 0.6, y + 0.6), (x + 0.6, y - 0.6)], BLUE)
    return framed(drawing)


def framed(drawing: Drawing) -> str:
    """All that was drawn, with a rim for the words around it."""
    xs, ys = ([point[i] for point in drawing.points] or [0.0, 50.0] for i in (0, 1))
    x, y, wide, high = min(xs) - 5, min(ys) - 6, max(xs) - min(xs) + 10, max(ys) - min(ys) + 16
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{x:.1f} {y:.1f} {wide:.1f} '
            f'{high:.1f}" width="{4 * wide:.0f}" font-family="sans-serif">\n'
            f'<rect x="{x:.1f}" y="{y:.1f}" width="100%" height="100%" fill="white"/>\n'
            + "\n".join(drawing.out) + "\n</svg>\n")
