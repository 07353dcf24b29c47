# SPDX-License-Identifier: BSD-3-Clause
"""The carrier board for a Raspberry Pi Pico: each part, with its nets. Its only description."""
from __future__ import annotations

import pathlib
import re

import catalogue as c
from catalogue import capacitor, gh, jumper, micro_fit, resistor
from model import Board, Component, Mark, Rail

ROOT = pathlib.Path(__file__).resolve().parents[2]
WIDTH, HEIGHT = 100.0, 83.0
CAMERAS = 4
ISOLATED = (2, 3)  # channels that can be populated for 24 V
LEVELS = {"1.8 V": "+1V8", "3.3 V": "+3V3", "5 V": "+5V"}
LEVEL_MARKS = (("1.8", -2.54, 2.0, 0), ("3.3", 2.54, 2.0, 0), ("5V", 2.1, -2.54, 0),
               ("LVL", -2.3, -2.54, 0))
PWR_MARKS = (("V0", -1.9, 3.0, 0), ("V3", 10.9, 3.0, 0), ("GND", -2.5, 1.65, 0))
INVERT_MARKS = (("P", -1.8, 0.0, 0), ("S", -1.8, 2.54, 0))
SHARED = ("i2c_data", "i2c_clock")  # pins that SPI names


def ends(first: str, last: str, turn: int) -> tuple[Mark, ...]:
    """Words beyond the first and the last pin of a row of three; turned as the board is read."""
    return (first, -1.95, 0.0, turn), (last, 7.03, 0.0, turn)


def firmware_names() -> dict[str, int]:
    """GPIO by name as the firmware has them: of cameras the first; some names share a pin."""
    text = (ROOT / "firmware/rp2040/pins.hpp").read_text()
    body = re.search(r"enum Pin : unsigned \{(.*?)\};", text, re.S)
    assert body
    return {name: int(number) for name, number in re.findall(r"pin_(\w+) = (\d+)", body.group(1))}


def firmware_pins() -> dict[str, int]:
    """GPIO by signal, of the firmware itself."""
    pins: dict[str, int] = {}
    for name, gpio in firmware_names().items():
        if name == "count" or name in SHARED:
            continue
        count = CAMERAS if name in ("exposure0", "trigger0") else 1
        for i in range(count):
            pins[f"{name[:-1]}{i}" if count > 1 else name] = gpio + i
    return pins


def decouple(board: Board, ref: str, group: str, pin: str, net: str,
             component: Component = c.C100N, fitted: tuple[str, ...] = ()) -> None:
    board.add(ref, component, group, near=pin, fitted=fitted, _1=net, _2="GND")


def supply(board: Board) -> None:
    """7 to 24 V, or USB. The eFuse limits current and inrush, blocks reversed polarity, and
    disconnects above 30 V; meanwhile USB keeps the Pico alive."""
    board.sheet("power", "Supply: 7 to 24 V or USB")
    g = "power"
    board.add("J1", micro_fit(2), g, marks=(("GND", -4.2, -1.5, 0), ("7-24V", 7.2, -2.5, 0)),
              _1="GND", _2="VIN")
    board.add("D1", c.TVS, g, near="J1.2", _1="VIN", _2="GND")
    board.add("U2", c.EFUSE, g, IN="VIN", UVLO="UVLO", OVP="OVP", MODE="RTN", RTN="RTN", EP="RTN",
              GND="GND", IMON="IMON", ILIM="ILIM", dVdT="DVDT", FLT="FAULT", OUT="VPROT")
    decouple(board, "C1", g, "U2.1", "VIN")
    board.add("R1", resistor("470k"), g, near="U2.3", _1="VIN", _2="UVLO")
    board.add("R2", resistor("82k"), g, near="U2.3", _1="UVLO", _2="OVP")
    board.add("R3", resistor("22k6"), g, near="U2.5", _1="OVP", _2="RTN")
    board.add("R4", resistor("6k04"), g, near="U2.11", _1="ILIM", _2="RTN")
    board.add("R5", resistor("10k"), g, near="U2.10", _1="IMON", _2="RTN")
    board.add("C2", c.C22N, g, near="U2.12", _1="DVDT", _2="RTN")
    board.add("U3", c.BUCK, g, FB="5V_BUCK", EN="VPROT", VIN="VPROT", GND="GND", SW="SW", BST="BST")
    decouple(board, "C3", g, "U3.3", "VPROT", c.C10U_50)
    decouple(board, "C4", g, "U3.3", "VPROT")
    board.add("C5", c.C100N, g, near="U3.6", _1="BST", _2="SW")
    board.add("L1", c.INDUCTOR, g, _1="SW", _2="5V_BUCK")
    decouple(board, "C6", g, "L1.2", "5V_BUCK", c.C22U)
    decouple(board, "C7", g, "L1.2", "5V_BUCK", c.C22U)
    board.add("D2", c.POWER_DIODE, g, near="L1.2", A="5V_BUCK", K="+5V")
    decouple(board, "C8", g, "D2.1", "+5V", c.C22U)
    board.add("U4", c.LDO18, g, near="D2.1", VIN="+5V", EN="+5V", GND="GND", VOUT="+1V8")
    decouple(board, "C9", g, "U4.1", "+5V", c.C1U)
    decouple(board, "C10", g, "U4.5", "+1V8", c.C1U)
    board.add("D3", c.ZENER_CLAMP, g, near="U4.1", K="VCLAMP", A="GND")
    decouple(board, "C11", g, "D3.1", "VCLAMP")
    # Keeps the clamp charged, so that it takes nothing from an edge; the diode blocks the way back.
    board.add("D7", c.SCHOTTKY, g, near="D3.1", A="+5V", K="CLAMP_BIAS")
    board.add("R9", resistor("10k"), g, near="D3.1", _1="CLAMP_BIAS", _2="VCLAMP")
    board.add("F5", c.PTC500, g, near="D2.1", _1="+5V", _2="5V_OUT")
    lights(board)


def lights(board: Board) -> None:
    g = "power"
    for ref, colour, ohm, high, low, word in (
            ("D4", c.YELLOW, "10k", "VPROT", "GND", "VIN"),
            ("D5", c.GREEN, "2k2", "+5V", "GND", "5V"),
            ("D6", c.RED, "2k2", "+5V", "FAULT", "ERR")):
        node = f"LED_{ref}"
        board.add(ref, colour, g, marks=((word, 0.0, -1.25, 0),), A=node, K=low)
        board.add(f"R{int(ref[1:]) + 2}", resistor(ohm), g, near=f"{ref}.2", _1=high, _2=node)


def controller(board: Board) -> None:
    board.sheet("pico", "USB and Raspberry Pi Pico")
    nets = {f"GP{gpio}": name.upper() for name, gpio in firmware_pins().items()}
    del nets[f"GP{firmware_pins()['loop']}"]  # must stay open
    board.add("U1", c.PICO, "pico", GND="GND", AGND="GND", VSYS="+5V", 
              named={"3V3": "+3V3", **nets})
    board.add("C12", c.C10U, "pico", near="U1.36", _1="+3V3", _2="GND")
    board.add("C13", c.C10U, "pico", near="U1.39", _1="+5V", _2="GND")
    for ref, net in (("TP1", "GND"), ("TP2", "+5V"), ("TP3", "+3V3"), ("TP4", "+1V8"),
                     ("TP5", "VPROT")):
        board.add(ref, c.TEST_POINT, "pico", label=net, _1=net)


def rest(board: Board, ref: str, group: str, signal: str, near: str) -> None:
    """What holds an output of the Pico until its first configuration: low, or by the other
    resistor high. 4.7 k also suits a Pico 2, whose leakage 8.2 k and more cannot hold."""
    board.add(f"R{ref}", resistor("4k7"), group, near=near, _1=signal, _2="GND")
    board.add(f"R{int(ref) + 1}", resistor("4k7"), group, near=near, fitted=("none",), _1=signal,
              _2="+3V3")


def camera(board: Board, n: int) -> None:
    """Trigger driver and exposure input, both supplied by the channel's level jumper."""
    board.sheet(f"camera{n}", f"Camera {n}")
    g, b = f"camera{n}", 200 + 100 * n
    level, trigger, exposure = f"LEVEL{n}", f"CAM{n}_TRIGGER", f"CAM{n}_EXPOSURE"
    direct = tuple(v for v in board.variants if v != "isolated" or n not in ISOLATED)
    board.add(f"J{b}", gh(4), g, label=f"CAM{n}", _1="GND", _2=trigger, _3=exposure, _4="GND",
              MP="GND")
    board.add(f"JP{b}", c.LEVEL, g, marks=LEVEL_MARKS, delivered="3.3", _1="+1V8", _2=level,
              _3="+3V3", _4="+5V")
    board.add(f"JP{b + 1}", jumper(3), g, marks=ends("UP", "DN", 0), delivered="UP",
              _1=f"CAM{n}_UP", _2=exposure, _3=f"CAM{n}_DOWN")
    board.add(f"D{b}", c.ESD24, g, near=f"J{b}.2", IO1=trigger, IO2=exposure, GND="GND")
    # Trigger: Pico, rest, driver, series resistor, connector.
    board.add(f"U{b}", c.T45, g, near=f"J{b}.2", VCCA="+3V3", GND="GND", A=f"TRIGGER{n}",
              B=f"CAM{n}_DRIVER", DIR="+3V3", VCCB=level)
    board.add(f"R{b}", resistor("47R"), g, near=f"U{b}.4", _1=f"CAM{n}_DRIVER", _2=trigger)
    rest(board, str(b + 1), g, f"TRIGGER{n}", f"U{b}.3")
    # Exposure: connector, 4.7 k that bears 24 V, clamp, Schmitt trigger, translator, Pico.
    board.add(f"R{b + 3}", resistor("4k7", "0805"), g, near=f"J{b}.3", _1=exposure, _2=f"CAM{n}_IN")
    board.add(f"D{b + 1}", c.CLAMP, g, near=f"R{b + 3}.2", A="GND", K="VCLAMP", AK=f"CAM{n}_IN")
    board.add(f"R{b + 7}", resistor("100k"), g, near=f"D{b + 1}.3", _1=f"CAM{n}_IN", _2="GND")
    board.add(f"U{b + 1}", c.SCHMITT, g, near=f"D{b + 1}.3", A=f"CAM{n}_IN", GND="GND",
              Y=f"CAM{n}_CLEAN", VCC=level)
    board.add(f"U{b + 2}", c.T45, g, near=f"U{b + 1}.4", fitted=direct, VCCA="+3V3", GND="GND",
              A=f"EXPOSURE{n}", B=f"CAM{n}_CLEAN", DIR="GND", VCCB=level)
    board.add(f"R{b + 4}", resistor("4k7"), g, near=f"U{b + 2}.3", _1=f"EXPOSURE{n}", _2="GND")
    # Pull-up through a diode, so that a camera with power feeds no board without.
    board.add(f"D{b + 2}", c.SCHOTTKY, g, near=f"JP{b + 1}.1", A=level, K=f"CAM{n}_PULL")
    board.add(f"R{b + 5}", resistor("1k5"), g, near=f"JP{b + 1}.1", _1=f"CAM{n}_PULL",
              _2=f"CAM{n}_UP")
    board.add(f"R{b + 6}", resistor("4k7", "0805"), g, near=f"JP{b + 1}.3", _1=f"CAM{n}_DOWN",
              _2="GND")
    for i, (pin, net) in enumerate(((f"U{b}.1", "+3V3"), (f"U{b}.6", level),
                                    (f"U{b + 1}.5", level), (f"U{b + 2}.1", "+3V3"),
                                    (f"U{b + 2}.6", level))):
        decouple(board, f"C{b + i}", g, pin, net)
    decouple(board, f"C{b + 5}", g, f"JP{b}.2", level, c.C1U)


def camera_supply(board: Board) -> None:
    """Each camera's own fuse; a connector of its own, of a family that no signal has. Supplies are
    in the row towards the fuses, with ground at the pin of the other row."""
    board.sheet("camera_supply", "Supply of the cameras")
    g = "camera_supply"
    board.add("J120", micro_fit(CAMERAS, 2), g, label="PWR", marks=PWR_MARKS, named={
        **{str(n + 1): "GND" for n in range(CAMERAS)},
        **{str(CAMERAS + n + 1): f"VCAM{n}" for n in range(CAMERAS)}})
    for n in range(CAMERAS):
        board.add(f"F{n + 1}", c.PTC300, g, near=f"J120.{CAMERAS + n + 1}", _1="VPROT",
                  _2=f"VCAM{n}")


def isolated(board: Board, n: int) -> None:
    """24 V, isolated, supplied by the camera's side (18 to 30 V): a populated option. The plug
    brings these volts: it has more pins than any other of its family, and enters none of them."""
    if n == ISOLATED[0]:
        board.sheet("isolated", "Isolated 24 V, option of channels 2 and 3")
    g, b, fitted = f"isolated{n}", 1000 + 100 * n, ("isolated",)
    ground, supplied, out, into = (f"GND_ISO{n}", f"5V_ISO{n}", f"ISO{n}_TRIGGER",
                                   f"ISO{n}_EXPOSURE")
    add = board.add
    add(f"J{b}", gh(10), g, label=f"ISO{n} 24V", fitted=fitted, MP=ground, named={
        **{str(i): ground for i in range(2, 11)}, "1": f"24V_ISO{n}", "3": out, "5": into})
    add(f"U{b}", c.ISOLATOR, g, fitted=fitted, VCC1="+3V3", GND1="GND", OUTA=f"EXPOSURE{n}",
        INB=f"TRIGGER{n}", VCC2=supplied, GND2=ground, INA=f"ISO{n}_IN", OUTB=f"ISO{n}_DRIVE")
    add(f"C{b}", c.C100N, g, near=f"U{b}.1", fitted=fitted, _1="+3V3", _2="GND")
    add(f"D{b}", c.ESD32, g, near=f"J{b}.4", fitted=fitted, IO1=out, IO2=into, GND=ground)
    add(f"C{b + 1}", c.C100N, g, near=f"U{b}.8", fitted=fitted, _1=supplied, _2=ground)
    add(f"D{b + 1}", c.ZENER, g, near=f"U{b}.8", fitted=fitted, K=supplied, A=ground)
    add(f"R{b}", resistor("2k7", "1206"), g, near=f"D{b + 1}.3", fitted=fitted,
        _1=f"24V_ISO{n}", _2=supplied)
    # Trigger: the isolator switches an NPN, which switches 24 V through a PNP.
    add(f"R{b + 1}", resistor("10k"), g, near=f"U{b}.6", fitted=fitted, _1=f"ISO{n}_DRIVE",
        _2=f"ISO{n}_BASE")
    add(f"Q{b}", c.NPN, g, near=f"R{b + 1}.2", fitted=fitted, B=f"ISO{n}_BASE", E=ground,
        C=f"ISO{n}_SINK")
    add(f"R{b + 2}", resistor("10k"), g, near=f"Q{b}.3", fitted=fitted, _1=f"ISO{n}_SINK",
        _2=f"ISO{n}_GATE")
    add(f"Q{b + 1}", c.PNP, g, near=f"R{b + 2}.2", fitted=fitted, B=f"ISO{n}_GATE",
        E=f"24V_ISO{n}", C=out)
    add(f"R{b + 3}", resistor("4k7"), g, near=f"Q{b + 1}.1", fitted=fitted, _1=f"24V_ISO{n}",
        _2=f"ISO{n}_GATE")
    add(f"R{b + 4}", resistor("10k", "0805"), g, near=f"Q{b + 1}.3", fitted=fitted, _1=out,
        _2=ground)
    # Exposure: an open collector, pulled up to 24 V, divided, clamped.
    add(f"R{b + 5}", resistor("4k7", "1206"), g, near=f"J{b}.5", fitted=fitted,
        _1=f"24V_ISO{n}", _2=into)
    add(f"R{b + 6}", resistor("10k", "0805"), g, near=f"J{b}.5", fitted=fitted, _1=into,
        _2=f"ISO{n}_IN")
    add(f"R{b + 7}", resistor("4k7"), g, near=f"U{b}.7", fitted=fitted, _1=f"ISO{n}_IN", _2=ground)
    add(f"D{b + 2}", c.CLAMP, g, near=f"U{b}.7", fitted=fitted, A=ground, K=supplied,
        AK=f"ISO{n}_IN")


def lidar(board: Board, n: int) -> None:
    """PPS and NMEA, each with its polarity; driven with 3.3 or 5 V."""
    if n == 0:
        board.sheet("lidar", "LiDARs")
    g, b = f"lidar{n}", 600 + 20 * n
    level, pps, serial = f"LIDAR{n}_LEVEL", f"LIDAR{n}_PPS", f"LIDAR{n}_SERIAL"
    board.add(f"J{b}", gh(5), g, label=f"LIDAR{n}", _1=pps, _2="GND", _3=serial, _4="GND", _5="GND",
              MP="GND")
    board.add(f"D{b}", c.ESD24, g, near=f"J{b}.2", IO1=pps, IO2=serial, GND="GND")
    # Delivered at 3.3 V: 5 V destroys the inputs of a Livox.
    board.add(f"JP{b}", jumper(3), g, marks=ends("3.3", "5V", 90), delivered="3.3", _1="+3V3",
              _2=level, _3="+5V")
    board.add(f"JP{b + 1}", jumper(2, 2), g, label="INVERT", marks=INVERT_MARKS,
              _1=f"LIDAR{n}_PPS_INVERT", _2="+3V3",
              _3=f"LIDAR{n}_SERIAL_INVERT", _4="+3V3")
    board.add(f"U{b}", c.T45_2, g, near=f"J{b}.2", VCCA="+3V3", GND="GND", DIR="+3V3", VCCB=level,
              A1=f"LIDAR{n}_PPS_3V3", B1=f"LIDAR{n}_PPS_5V", A2=f"LIDAR{n}_SERIAL_3V3",
              B2=f"LIDAR{n}_SERIAL_5V")
    board.add(f"U{b + 1}", c.XOR2, g, near=f"U{b}.2", VCC="+3V3", GND="GND",
              named={"1A": "SYNC_OUTPUT", "1B": f"LIDAR{n}_PPS_INVERT", "1Y": f"LIDAR{n}_PPS_3V3",
                 "2A": "UART_TRANSMIT", "2B": f"LIDAR{n}_SERIAL_INVERT",
                 "2Y": f"LIDAR{n}_SERIAL_3V3"})
    board.add(f"R{b}", resistor("47R"), g, near=f"J{b}.1", _1=f"LIDAR{n}_PPS_5V", _2=pps)
    board.add(f"R{b + 1}", resistor("47R"), g, near=f"J{b}.3", _1=f"LIDAR{n}_SERIAL_5V", _2=serial)
    board.add(f"R{b + 2}", resistor("10k"), g, near=f"U{b + 1}.2", _1=f"LIDAR{n}_PPS_INVERT",
              _2="GND")
    board.add(f"R{b + 3}", resistor("10k"), g, near=f"U{b + 1}.6", _1=f"LIDAR{n}_SERIAL_INVERT",
              _2="GND")
    for i, (pin, net) in enumerate(((f"U{b}.1", "+3V3"), (f"U{b}.8", level),
                                    (f"U{b + 1}.8", "+3V3"))):
        decouple(board, f"C{b + i}", g, pin, net)


def slow_input(board: Board, ref: int, group: str, outside: str, node: str, connector: str,
               idle: str = "GND") -> None:
    """4.7 k bears 24 V and RS-232, the clamp keeps the buffer within its limits."""
    board.add(f"R{ref}", resistor("4k7", "0805"), group, near=connector, _1=outside, _2=node)
    board.add(f"D{ref}", c.CLAMP, group, near=f"R{ref}.2", A="GND", K="VCLAMP", AK=node)
    board.add(f"R{ref + 1}", resistor("100k"), group, near=f"D{ref}.3", _1=node, _2=idle)


def pulses(board: Board) -> None:
    """PPS, NMEA, aux and sync."""
    board.sheet("pulses", "Pulses and NMEA")
    g = "gnss"
    # Pins as of the IMU's UART, so that either cable bears the other's place.
    board.add("J700", gh(6), g, label="GNSS", _1="5V_OUT", _2="GND", _4="NMEA_IN", _5="PPS_IN",
              _6="GND", MP="GND")
    board.add("D700", c.ESD24, g, near="J700.4", IO1="PPS_IN", IO2="NMEA_IN", GND="GND")
    board.add("JP700", jumper(2), g, label="50 OHM", _1="PPS_IN", _2="PPS_50")
    board.add("R700", resistor("49R9", "1206"), g, near="JP700.2", _1="PPS_50", _2="GND")
    slow_input(board, 702, g, "PPS_IN", "PPS_NODE", "J700.5")
    slow_input(board, 704, g, "NMEA_IN", "NMEA_NODE", "J700.4", "+3V3")
    board.add("U700", c.SCHMITT2, g, near="D702.3", VCC="+3V3", GND="GND", named={
        "1A": "PPS_NODE", "1Y": "PPS", "2A": "NMEA_NODE", "2Y": "NMEA_CLEAN"})
    decouple(board, "C700", g, "U700.5", "+3V3")
    board.add("JP701", jumper(2), g, label="NMEA INV", _1="NMEA_INVERT", _2="+3V3")
    board.add("U701", c.XOR, g, near="U700.4", A="NMEA_CLEAN", B="NMEA_INVERT", GND="GND",
              Y="NMEA_RECEIVED", VCC="+3V3")
    decouple(board, "C701", g, "U701.5", "+3V3")
    board.add("R706", resistor("10k"), g, near="U701.2", _1="NMEA_INVERT", _2="GND")
    aux(board)
    sync(board)


def aux(board: Board) -> None:
    g = "aux"
    for i in (0, 1):
        board.add(f"J{720 + i}", gh(2), g, label=f"AUX{i}", _1=f"AUX{i}_IN", _2="GND", MP="GND")
        board.add(f"D{720 + i}", c.ESD24, g, near=f"J{720 + i}.1", IO1=f"AUX{i}_IN", IO2="GND",
                  GND="GND")
    slow_input(board, 722, g, "AUX0_IN", "AUX0_NODE", "J720.1")
    slow_input(board, 724, g, "AUX1_IN", "AUX1_NODE", "J721.1")
    board.add("U720", c.SCHMITT2, g, near="D722.3", VCC="+3V3", GND="GND", named={
        "1A": "AUX0_NODE", "1Y": "AUX0", "2A": "AUX1_NODE", "2Y": "AUX1"})
    decouple(board, "C720", g, "U720.5", "+3V3")


def sync(board: Board) -> None:
    """Sync from and to another board, and the test output, with 5 V. The LED board is at TEST. An
    input's plug fits inputs only, an output's fits outputs."""
    g = "sync"
    board.add("J740", gh(2), g, label="SYNC IN", _1="SYNC_IN", _2="GND", MP="GND")
    board.add("J742", gh(3), g, label="SYNC OUT", _2="SYNC_OUT", _3="GND", MP="GND")
    board.add("J741", gh(3), g, label="TEST", _1="5V_OUT", _2="TEST_OUT", _3="GND", MP="GND")
    board.add("D740", c.ESD24, g, near="J740.1", IO1="SYNC_IN", IO2="GND", GND="GND")
    board.add("D744", c.ESD24, g, near="J742.2", IO1="SYNC_OUT", IO2="GND", GND="GND")
    board.add("D741", c.ESD24, g, near="J741.2", IO1="TEST_OUT", IO2="GND", GND="GND")
    board.add("U740", c.T45_2, g, near="J741.1", VCCA="+3V3", GND="GND", DIR="+3V3", VCCB="+5V",
              A1="SYNC_OUTPUT", B1="SYNC_5V", A2="TEST_OUTPUT", B2="TEST_5V")
    decouple(board, "C740", g, "U740.1", "+3V3")
    decouple(board, "C741", g, "U740.8", "+5V")
    board.add("R740", resistor("47R"), g, near="J742.2", _1="SYNC_5V", _2="SYNC_OUT")
    board.add("R741", resistor("47R"), g, near="J741.2", _1="TEST_5V", _2="TEST_OUT")
    slow_input(board, 742, g, "SYNC_IN", "SYNC_NODE", "J740.1")
    board.add("U741", c.SCHMITT, g, near="D742.3", A="SYNC_NODE", GND="GND", Y="SYNC_INPUT",
              VCC="+3V3")
    decouple(board, "C742", g, "U741.5", "+3V3")
    rest(board, "744", g, "SYNC_OUTPUT", "U740.2")
    rest(board, "746", g, "TEST_OUTPUT", "U740.3")
    board.add("D743", c.YELLOW, g, A="LED_D743", K="GND")
    board.add("R748", resistor("2k2"), g, near="D743.2", _1="SYNC_5V", _2="LED_D743")


def light(board: Board) -> None:
    """The pulse passes a capacitor: whatever the firmware does, the light goes off after a time
    that R and C give."""
    board.sheet("light", "Light")
    g = "light"
    board.add("J760", micro_fit(4), g, label="LIGHT", _1="VLIGHT", _2="LIGHT_SINK", _3="LIGHT_5V",
              _4="GND", marks=(("V", 0.0, 1.65, 0), ("GND", 9.0, 1.65, 0)))
    board.add("D760", c.ESD32, g, near="J760.2", IO1="LIGHT_SINK", IO2="LIGHT_5V", GND="GND")
    board.add("F6", c.PTC300, g, near="J760.1", _1="VPROT", _2="VLIGHT")
    board.add("Q760", c.MOSFET, g, near="J760.2", G="LIGHT_GATE", S="GND", D="LIGHT_SINK")
    board.add("U760", c.SCHMITT, g, near="Q760.1", A="LIGHT_TIMED", GND="GND", Y="LIGHT_LIMITED",
              VCC="+3V3")
    decouple(board, "C760", g, "U760.5", "+3V3")
    # 1 k keeps the current small with which the capacitor empties into the Pico.
    board.add("R765", resistor("1k"), g, near="U760.2", _1="LIGHT", _2="LIGHT_AC")
    board.add("C761", c.C100N, g, near="U760.2", _1="LIGHT_AC", _2="LIGHT_TIMED")
    board.add("R760", resistor("100k"), g, near="U760.2", _1="LIGHT_TIMED", _2="GND")
    board.add("D761", c.SCHOTTKY, g, near="U760.2", K="LIGHT_TIMED", A="GND")
    board.add("R761", resistor("100R"), g, near="Q760.1", _1="LIGHT_DRIVER", _2="LIGHT_GATE")
    board.add("R762", resistor("10k"), g, near="Q760.1", _1="LIGHT_GATE", _2="GND")
    board.add("U761", c.T45, g, near="U760.4", VCCA="+3V3", GND="GND", A="LIGHT_LIMITED",
              B="LIGHT_DRIVER", DIR="+3V3", VCCB="+5V")
    decouple(board, "C762", g, "U761.1", "+3V3")
    decouple(board, "C763", g, "U761.6", "+5V")
    board.add("R763", resistor("100R"), g, near="U761.4", _1="LIGHT_DRIVER", _2="LIGHT_5V")
    board.add("R764", resistor("4k7"), g, near="R765.1", _1="LIGHT", _2="GND")


def imus(board: Board) -> None:
    board.sheet("imu", "IMUs")
    g, pins = "imu", firmware_pins()
    spi = ("SPI_CLOCK", "SPI_TRANSMIT", "SPI_RECEIVE", "SPI_SELECT0", "SPI_SELECT1", "IMU_READY0",
           "ACCEL_READY")
    outside = {name: f"{name}_X" for name in spi}
    names = firmware_names()
    data, clock = (next(net for name, net in outside.items()
                        if pins[name.lower()] == names[shared]) for shared in SHARED)
    board.add("J800", gh(9), g, label="IMU SPI", _1="+3V3", _2="GND", MP="GND",
              named={str(i + 3): outside[name] for i, name in enumerate(spi)})
    board.add("J801", gh(7), g, label="I2C", words={"3": "SCL", "4": "SDA"}, _1="+3V3", _2="GND",
              _3=clock, _4=data, _5="IMU_READY0_X", _6="GND", _7="GND", MP="GND")
    board.add("D800", c.ESD5, g, near="J800.4", IO1=outside[spi[0]], GND="GND", IO2=outside[spi[1]],
              IO3=outside[spi[2]], IO4=outside[spi[3]])
    board.add("D801", c.ESD5, g, near="J800.7", IO1=outside[spi[4]], GND="GND", IO2=outside[spi[5]],
              IO3=outside[spi[6]], IO4="GND")
    board.add("D802", c.ESD5, g, near="J801.4", IO1=outside[spi[0]], GND="GND",
              IO2=outside[spi[1]], IO3=outside[spi[5]], IO4="GND")
    for i, name in enumerate(spi):
        ohm = "1k" if name.endswith("READY") or name == "IMU_READY0" else "33R"
        board.add(f"R{800 + i}", resistor(ohm), g, near=f"J800.{i + 3}", _1=name, _2=outside[name])
    board.add("JP800", jumper(2, 2), g, label="I2C PULL", _1="I2C_PULL_DATA", _2=data,
              _3="I2C_PULL_CLOCK", _4=clock)
    board.add("R807", resistor("2k2"), g, near="JP800.1", _1="+3V3", _2="I2C_PULL_DATA")
    board.add("R808", resistor("2k2"), g, near="JP800.3", _1="+3V3", _2="I2C_PULL_CLOCK")
    for ref, name, to in (("R809", "SPI_SELECT0", "+3V3"), ("R810", "SPI_SELECT1", "+3V3"),
                          ("R811", "IMU_READY0", "GND"), ("R812", "ACCEL_READY", "GND"),
                          ("R813", "SPI_RECEIVE", "GND")):
        board.add(ref, resistor("4k7"), g, near=f"U1.GP{pins[name.lower()]}", _1=name, _2=to)
    decouple(board, "C800", g, "J800.1", "+3V3", c.C10U)
    uart(board)
    on_board_imu(board)


def uart(board: Board) -> None:
    g = "uart"
    board.add("J820", gh(6), g, label="IMU UART", _1="5V_OUT", _2="GND", _3="UART_OUT",
              _4="UART_IN", _5="READY1_IN", _6="GND", MP="GND")
    board.add("D820", c.ESD24, g, near="J820.4", IO1="UART_IN", IO2="READY1_IN", GND="GND")
    board.add("D821", c.ESD24, g, near="J820.3", IO1="UART_OUT", IO2="GND", GND="GND")
    slow_input(board, 822, g, "UART_IN", "UART_NODE", "J820.4", "+3V3")
    slow_input(board, 824, g, "READY1_IN", "READY1_NODE", "J820.5")
    board.add("U820", c.SCHMITT2, g, near="D822.3", VCC="+3V3", GND="GND", named={
        "1A": "UART_NODE", "1Y": "UART_CLEAN", "2A": "READY1_NODE", "2Y": "IMU_READY1"})
    decouple(board, "C820", g, "U820.5", "+3V3")
    board.add("U821", c.SCHMITT, g, near="J820.3", A="UART_TRANSMIT", GND="GND", Y="UART_DRIVER",
              VCC="+3V3")
    decouple(board, "C821", g, "U821.5", "+3V3")
    board.add("R826", resistor("100R"), g, near="U821.4", _1="UART_DRIVER", _2="UART_OUT")
    board.add("R827", resistor("4k7"), g, near="U821.2", _1="UART_TRANSMIT", _2="+3V3")
    board.add("JP820", jumper(3), g, label="RX", marks=ends("IMU", "NMEA", 90), delivered="IMU",
              _1="UART_CLEAN", _2="UART_SELECTED", _3="NMEA_RECEIVED")
    board.add("R828", resistor("100R"), g, near="JP820.2", _1="UART_SELECTED", _2="UART_RECEIVE")
    board.add("R829", resistor("4k7"), g, near="JP820.2", _1="UART_RECEIVE", _2="+3V3")


def on_board_imu(board: Board) -> None:
    """Optional, beside a mounting hole, where the board bends least."""
    g, fitted = "imu_chip", ("imu",)
    board.add("U840", c.IMU, g, fitted=fitted, SDO="SPI_RECEIVE", INT1="IMU_READY0", VDDIO="+3V3",
              GND="GND", VDD="+3V3", INT2="GND", CS="SPI_SELECT0", SCLK="SPI_CLOCK",
              SDI="SPI_TRANSMIT")
    board.add("C840", c.C100N, g, near="U840.5", fitted=fitted, _1="+3V3", _2="GND")
    board.add("C841", c.C100N, g, near="U840.8", fitted=fitted, _1="+3V3", _2="GND")
    board.add("C842", c.C1U, g, near="U840.8", fitted=fitted, _1="+3V3", _2="GND")


def carrier() -> Board:
    board = Board("carrier", "VersaVIS carrier for the Raspberry Pi Pico", WIDTH, HEIGHT,
                  ("standard", "isolated", "imu"))
    board.rails = {
        "VIN": Rail(7, 12, 53.3, 2000), "VPROT": Rail(6.5, 12, 31.2, 2000),
        "5V_BUCK": Rail(4.9, 5.0, 5.1, 1000), "+5V": Rail(4.2, 4.7, 5.25, 800),
        "5V_OUT": Rail(4.0, 4.6, 5.25, 500), "+3V3": Rail(3.2, 3.3, 3.4, 300),
        "+1V8": Rail(1.77, 1.8, 1.83, 300), "VCLAMP": Rail(4.8, 5.1, 5.4, 280),
        **{f"VCAM{n}": Rail(6.4, 12, 31.2, 300) for n in range(CAMERAS)},
        "VLIGHT": Rail(6.4, 12, 31.2, 300),
        **{f"24V_ISO{n}": Rail(18, 24, 30, 200) for n in ISOLATED},
        **{f"5V_ISO{n}": Rail(4.6, 5.1, 5.4, 3.5) for n in ISOLATED}}
    supply(board)
    controller(board)
    imus(board)
    light(board)
    for n in range(CAMERAS):
        camera(board, n)
    camera_supply(board)
    for n in ISOLATED:
        isolated(board, n)
    pulses(board)
    for n in (0, 1):
        lidar(board, n)
    board.sheet("mechanics", "Holes")
    for i in range(4):
        board.add(f"H{i + 1}", c.HOLE, "mechanics")
    board.planes = {"In1.Cu": "GND", "In2.Cu": "+3V3"}
    board.texts = [(27.0, 40.5, 1.8, "VersaVIS carrier"), (27.0, 44.0, 1.0, "CERN-OHL-P-2.0"),
                   (5.0, 42.7, 1.2, "USB")]
    return board
