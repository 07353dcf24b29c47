# SPDX-License-Identifier: BSD-3-Clause
"""Mistakes, each made on purpose in a copy of the board, and the sentence that must name it."""
from __future__ import annotations

import copy
import dataclasses
from typing import Callable

import cables
import catalogue as c
import checks
import documents
import kept
import layout_checks
import reread
from layout import Layout
from model import Board, Component, Place

Change = Callable[[Board], None]
Check = Callable[[Board], list[str]]


def net(ref: str, pin: str, name: str) -> Change:
    def change(board: Board) -> None:
        if name:
            board.parts[ref].nets[pin] = name
        else:
            del board.parts[ref].nets[pin]
    return change


def swap(ref: str, component: Component) -> Change:
    def change(board: Board) -> None:
        board.parts[ref].component = component
    return change


def without(*refs: str) -> Change:
    def change(board: Board) -> None:
        for ref in refs:
            del board.parts[ref]
            board.places.pop(ref, None)
    return change


def fit(ref: str, *variants: str) -> Change:
    def change(board: Board) -> None:
        board.parts[ref].fitted = frozenset(variants)
    return change


def rail(name: str, **figures: float) -> Change:
    def change(board: Board) -> None:
        board.rails[name] = dataclasses.replace(board.rails[name], **figures)
    return change


def both(*changes: Change) -> Change:
    def change(board: Board) -> None:
        for each in changes:
            each(board)
    return change


CIRCUIT: tuple[tuple[Check, str, Change], ...] = (
    (checks.unconnected, "U200: pin DIR is open",
     net("U200", "5", "")),
    (checks.unconnected, "U201: pin 1 must stay open",
     net("U201", "1", "GND")),
    (checks.unconnected, "ends at one pin",
     net("R200", "2", "NOWHERE")),
    (checks.drivers, "EXPOSURE2 is driven by U1200 and U402",
     fit("U402", "standard", "isolated", "imu")),
    (checks.drivers, "is driven by",
     net("U202", "3", "EXPOSURE1")),
    (checks.drivers, "the inputs on CAM0_IN float",
     without("R207")),
    (checks.level_faults, "gives 1.67 V on CAM0_CLEAN",
     net("U202", "6", "+3V3")),  # 1.8 V into 3.3 V logic
    (checks.level_faults, "puts 5.25 V on EXPOSURE0, U1 bears 3.6 V",
     net("U202", "1", "+5V")),
    (checks.pico_alone, "drives EXPOSURE0 also while the Pico has no supply",
     net("U202", "1", "+5V")),
    (checks.pico_alone, "of the Pico is at J200 without protection",
     net("J200", "3", "EXPOSURE0")),
    (checks.pico_alone, "through 33 ohm only",
     net("R802", "2", "CAM0_EXPOSURE")),
    (checks.rests, "holds TRIGGER0",
     without("R201")),
    (checks.rests, "holds TRIGGER0",
     swap("R201", c.resistor("10k"))),
    (checks.rests, "U1200 drives high",
     swap("U1200", dataclasses.replace(c.ISOLATOR, figures=()))),
    (checks.protection, "CAM1_TRIGGER at J300 has no ESD part",
     net("D300", "1", "GND")),
    (checks.protection, "stands 5 V, CAM0_EXPOSURE may have 24 V",
     net("D800", "6", "CAM0_EXPOSURE")),
    (checks.supplies, "U3 bears 32 V",
     rail("VPROT", most=36.0)),
    (checks.supplies, "+3V3 gives 150 mA",
     rail("+3V3", milliamps=150.0)),
    (checks.pin_map, "GP14 is EXPOSURE0",
     net("U1", "19", "TRIGGER0")),
    (checks.pin_map, "must stay open",
     net("U1", "24", "AUX0")),
    (checks.isolation, "joins ISO2 and the board",
     net("J1200", "4", "GND")),
    (checks.connectors, "J200 has VCAM0 beside a camera's signal",
     net("J200", "4", "VCAM0")),
    (checks.swaps, "CAM0 fits GNSS: at pin 1 ground meets what the board drives",
     swap("J700", c.gh(4))),
    (checks.swaps, "GNSS fits CAM0: at pin 1 the device takes its supply from an output",
     both(swap("J700", c.gh(4)), net("J200", "1", "CAM0_TRIGGER"))),
    (checks.swaps, "LIDAR0 fits I2C: at pin 1 3.4 V meet what bears 3.3 V",
     both(swap("J801", c.gh(5)), rail("+1V8", most=3.3), net("J600", "1", "CAM0_TRIGGER"))),
    (checks.swaps, "AUX0 fits SYNC IN: at pin 1 the device's output meets what the board drives",
     net("J740", "1", "SYNC_OUT")),
    (checks.swaps, "GNSS fits IMU UART: at pin 5 the device's output meets ground",
     net("J820", "5", "GND")),
    (checks.high_supplies, "PWR has VCAM0, up to 31.2 V, and the family of CAM0",
     swap("J120", c.gh(8))),
    (checks.high_supplies, "LIGHT has VLIGHT, up to 31.2 V, and the connector of CAM0",
     swap("J760", c.gh(4))),
    (checks.high_supplies, "ISO2 24V has 24V_ISO2, up to 30 V, and no more pins than IMU SPI",
     swap("J1200", c.gh(8))),
    (checks.contact_currents, "a contact of TEST bears 1 A, 5V_OUT may give 1.5",
     rail("5V_OUT", milliamps=1500.0)),
    (checks.ratings, "C3 bears 25 V",
     swap("C3", c.C1U)),
    (checks.ratings, "R203 bears",
     swap("R203", c.resistor("1k", "0805"))),
    (checks.decoupling, "U3: VIN at VPROT has no capacitor",
     without("C3", "C4")),
)


def move(ref: str, dx: float, dy: float) -> Change:
    def change(board: Board) -> None:
        at = board.places[ref]
        board.places[ref] = Place(at.x + dx, at.y + dy, at.turn)
    return change


def track(net_name: str, x0: float, y0: float, x1: float, y1: float
          ) -> Callable[[Board, Layout], None]:
    def change(_: Board, layout: Layout) -> None:
        layout.tracks.append(("F.Cu", net_name, 0.2, x0, y0, x1, y1))
    return change


def cut(net_name: str) -> Callable[[Board, Layout], None]:
    def change(_: Board, layout: Layout) -> None:
        first = next(t for t in layout.tracks if t[1] == net_name and t[2] < 0.5 and
                     abs(t[3] - t[5]) + abs(t[4] - t[6]) > 1.5)
        layout.tracks.remove(first)
    return change


def across_the_gap(board: Board, layout: Layout) -> None:
    x0, y0, _, _ = board.islands["GND_ISO2"]
    layout.tracks.append(("B.Cu", "+5V", 0.2, x0 - 1.0, y0 + 1, x0 - 1.0, y0 + 3))


def a_hole_too_near(_: Board, layout: Layout) -> None:
    name, x, y = layout.vias[0]
    layout.vias.append((name, x + 0.4, y))


def long_way(_: Board, layout: Layout) -> None:
    layout.tracks += [("B.Cu", "SW", 0.2, 1, 1, 40, 1)]


def on_layout(change: Change) -> Callable[[Board, Layout], None]:
    return lambda board, layout: change(board)


def lost(board: Board) -> None:
    del board.places["R203"]


LAYOUT: tuple[tuple[Callable[..., list[str]], str, Callable[[Board, Layout], None]], ...] = (
    (layout_checks.placed, "R203 has no place",
     on_layout(lost)),
    (layout_checks.courtyards, "overlap",
     on_layout(move("U201", 0.0, 3.0))),
    (layout_checks.inside, "less than 0.25 mm from the edge",
     on_layout(move("J200", 0.0, 1.0))),
    (layout_checks.near_capacitor, "mm from its capacitor",
     on_layout(move("C201", 0.0, -9.0))),
    (layout_checks.near_capacitor, "U2: IN is",
     on_layout(move("C1", 0.0, -9.0))),
    (layout_checks.near_connector, "the ESD part of CAM0_TRIGGER",
     on_layout(move("D200", 0.0, -7.0))),
    (layout_checks.silk, "lies on a pad",
     on_layout(lambda board: board.texts.append((19.0, 72.0, 1.0, "WORD")))),
    (layout_checks.lengths, "SW is",
     long_way),
    (layout_checks.widths, "VPROT has a track of 0.2 mm",
     track("VPROT", 10.0, 30.0, 13.0, 30.0)),
    (layout_checks.clearances, "mm apart near",
     track("VIN", 10.0, 30.0, 60.0, 45.0)),
    (layout_checks.connected, "is in 2 pieces",
     cut("EXPOSURE0")),
    (layout_checks.isolation_gap, "isolation needs 2",
     across_the_gap),
    (layout_checks.isolation_gap, "GND_ISO2 and LIGHT_5V are",
     on_layout(move("J760", 5.0, 2.0))),
    (layout_checks.holes, "are too near",
     a_hole_too_near),
)


def replaced(name: str, old: str, new: str) -> Callable[[dict[str, str]], None]:
    def change(files: dict[str, str]) -> None:
        assert old in files[name], old
        files[name] = files[name].replace(old, new)
    return change


FILES: tuple[tuple[str, Callable[[dict[str, str]], None]], ...] = (
    ("in the sheets at EXPOSURE1", replaced("camera0.kicad_sch", 'global_label "EXPOSURE0"',
                                            'global_label "EXPOSURE1"')),
    ("in the sheets at None", replaced("camera0.kicad_sch", "(wire", "(bus")),
    ("in the board at ", replaced("carrier.kicad_pcb", '"CAM0_DRIVER")', '"CAM0_DRIVEN")')))


def unnoticed(board: Board, layout: Layout) -> list[str]:
    """Mistakes that their check does not name, and checks that no mistake shows."""
    wrong = []
    for check, sentence, change in CIRCUIT:
        spoilt = copy.deepcopy(board)
        change(spoilt)
        if not any(sentence in fault for fault in check(spoilt)):
            wrong.append(f"{check.__name__} does not find '{sentence}'")
    for layout_check, sentence, spoil in LAYOUT:
        spoilt, tracks = copy.deepcopy(board), copy.deepcopy(layout)
        spoil(spoilt, tracks)
        found = layout_check(*((spoilt, tracks) if layout_check in layout_checks.FULL else
                               (spoilt,)))
        if not any(sentence in fault for fault in found):
            wrong.append(f"{layout_check.__name__} does not find '{sentence}'")
    for sentence, spoil_files in FILES:
        files = kept.files(board, layout)
        spoil_files(files)
        if not any(sentence in fault for fault in reread.faults(board, files)):
            wrong.append(f"reading the files again does not find '{sentence}'")
    if len(documents.faults("nothing")) < 5:
        wrong.append("a README without its numbers is not noticed")
    shown = {check for check, _, _ in CIRCUIT} | {check for check, _, _ in LAYOUT}
    return wrong + [f"no mistake shows {check.__name__}" for check in
                    (*checks.CIRCUIT, *layout_checks.SIMPLE, *layout_checks.FULL)
                    if check not in shown]


Change = Callable[[cables.Table, cables.Table], None]


def cable(name: str, **changes: object) -> Change:
    def change(table: cables.Table, _: cables.Table) -> None:
        row = next(row for row in [*table["cameras"], *table["others"]] if row["name"] == name)
        row.update(changes)
    return change


def trigger_input(name: str, **facts: object) -> Change:
    def change(_: cables.Table, wiring: cables.Table) -> None:
        wiring[name]["trigger"]["input"] = facts
    return change


def lidar_input(name: str, line: str, **facts: object) -> Change:
    def change(_: cables.Table, wiring: cables.Table) -> None:
        wiring[name][line]["input"] = facts
    return change


def supply_beside(table: cables.Table, _: cables.Table) -> None:
    table["connectors"]["camera"]["pins"]["4"] = "supply"


def first_camera_lost(table: cables.Table, _: cables.Table) -> None:
    del table["cameras"][0]


CABLES: tuple[tuple[str, Change], ...] = (
    ("flir: 5.25 V arrive, the input bears 3.6 V", cable("flir", level="5 V")),
    ("flir-opto: 0.66 V arrive at 7 mA", cable("flir-opto", level="1.8 V")),
    ("basler: 1.93 V arrive at 15 mA, 2.2 V are high", cable("basler", level="3.3 V")),
    ("flir: the output only pulls down", cable("flir", pull="none")),
    ("flir: trigger is at pin 2, in wiring.json at 1", cable("flir", camera_pins={
        "2": "trigger", "3": "exposure", "6": "ground"})),
    ("flir-opto: pin 1 is the camera's supply, and trigger here", cable("flir-opto", camera_pins={
        "1": "trigger", "4": "exposure"})),
    ("alvium-usb: exposure: 2.4 V arrive, 3.64 V are high at 5 V",
     cable("alvium-usb", level="5 V")),
    ("daheng: its pull-up leaves", trigger_input(
        "daheng", kind="direct", high_v=1.9, low_v=0.1, highest_v=24,
        pulls_up={"v": 3.3, "ohm": 1000})),
    ("velodyne: serial: 4.06 V arrive", lidar_input(
        "velodyne", "serial", kind="direct", high_v=4.1, needs_ma=2, highest_v=15)),
    ("ouster: pulse: 2.36 V arrive at 10 mA", cable("ouster", level="3.3 V")),
    ("velodyne: pulse: 3.4 V arrive as delivered, the input bears 3 V", lidar_input(
        "velodyne", "pulse", kind="direct", highest_v=3.0)),
    ("flir: 3.4 V arrive as delivered, the input bears 2 V", trigger_input(
        "flir", kind="direct", highest_v=2.0)),
    ("livox: pulse: 5.25 V arrive, the input bears 3.6 V", cable("livox", level="5 V")),
    ("u-blox: pps_in: 1.8 V arrive, 2.55 V are high", cable("u-blox", gives_v=[1.8, 1.8])),
    ("alvium-g1: exposure: 2.4 V arrive, 2.55 V are high", cable("alvium-g1", short_v={})),
    ("vn100: uart_in: 2.4 V arrive, 2.39 V are high: short_v is stale", cable("vn100", short_v={
        "uart_in": 0.1, "ready1": 0.15})),
    ("vn100: serial is no pin of imu_uart", cable("vn100", wires={"serial": "RX"})),
    ("camera: supply and a signal are on one connector", supply_beside),
    ("camera: its pins are not those of CAM0", supply_beside),
    ("flir of wiring.json has no cable", first_camera_lost),
)


def unnoticed_cables() -> list[str]:
    wrong = []
    for sentence, change in CABLES:
        table, wiring = cables.tables()
        change(table, wiring)
        found = cables.faults(table, wiring)
        if not any(sentence in fault for fault in found):
            wrong.append(f"no check of the cables finds '{sentence}': {found}")
    return wrong
