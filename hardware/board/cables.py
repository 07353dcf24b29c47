# SPDX-License-Identifier: BSD-3-Clause
"""Cables from the carrier to cameras, LiDARs, IMUs and receivers, and whether each can work.

What a camera's lines are is in hardware/wiring.json, the table of `versavis wiring`; how the
carrier is set and wired for it is in hardware/cables.json.
"""
from __future__ import annotations

import dataclasses
import json
import pathlib
from typing import Any

import checks
from carrier import LEVELS, carrier

HARDWARE = pathlib.Path(__file__).resolve().parents[1]
Table = dict[str, Any]
BOARD = carrier()
# Ohm of a 74LVC1T45: 2.4 V at 16 mA from 3.0 V, 3.8 V at 32 mA from 4.5 V, 1.2 V at 4 mA from
# 1.65 V.
INSIDE = {"1.8 V": 112.0, "3.3 V": 37.5, "5 V": 22.0}
# The carrier's outputs: V at the rail at least and at most, ohm of the driver.
RAILS = {level: (BOARD.rails[rail].least, BOARD.rails[rail].most, INSIDE[level])
         for level, rail in LEVELS.items()}
SERIES = BOARD.parts["R200"].component.figure("ohm")
PULL_UP = BOARD.parts["R205"].component.figure("ohm")
DROP = BOARD.parts["D202"].component.figure("drop")
INPUT_MOST = 24.0
EXPOSURE = "CAM0_EXPOSURE"
# The carrier's nets of the inputs for pulses and serial lines, by their names in cables.json.
SLOW = {"pps_in": "PPS_IN", "nmea_in": "NMEA_IN", "uart_in": "UART_IN", "ready1": "READY1_IN"}


@dataclasses.dataclass(frozen=True)
class Cable:
    name: str
    level: str
    high_v: float
    highest_v: float
    draws_ma: float


def tables() -> tuple[Table, Table]:
    cables = json.loads((HARDWARE / "cables.json").read_text())
    wiring = json.loads((HARDWARE / "wiring.json").read_text())
    return cables, {row["name"]: row for row in [*wiring["cameras"], *wiring["lidars"]]}


def camera_facts(row: Table, wiring: Table) -> tuple[Table, Table]:
    """Of its trigger input and its exposure output."""
    camera = wiring[row["name"]]
    return camera["trigger"]["input"], camera["exposure"]["output"]


def triggers() -> list[Cable]:
    """Inputs whose levels are known, for the simulation."""
    table, wiring = tables()
    found = []
    for row in table["cameras"]:
        into, _ = camera_facts(row, wiring)
        if "high_v" in into:
            found.append(Cable(row["name"], row["level"], into["high_v"], into["highest_v"],
                               into.get("draws_ma", into.get("needs_ma", 0.1))))
    return found


def given(level: str, milliamps: float) -> float:
    """V that a trigger or a pulse still has at this current."""
    least, _, inside = RAILS[level]
    return least - (inside + SERIES) * milliamps / 1000


def resistors(net: str) -> tuple[float, float, str]:
    """Of an input: ohm before its Schmitt trigger, ohm behind, and what the latter goes to."""
    node, series = next((far, ohm) for far, ohm in checks.across(BOARD, net, "standard")
                        if any(part.component.family == "schmitt"
                               for part, _ in BOARD.pins_of(far)))
    bias, hold = next((far, ohm) for far, ohm in checks.across(BOARD, node, "standard")
                      if checks.is_supply(BOARD, far))
    return series, hold, bias


def wanted(net: str, volts: float) -> tuple[float, float]:
    """V at a connector that are surely high, and surely low, while the input is supplied with
    these volts."""
    series, hold, bias = resistors(net)
    rest = 0.0 if bias == "GND" else volts
    high, low = (checks.between(table, volts)
                 for table in (checks.SCHMITT_HIGH, checks.SCHMITT_LOW))
    return high + (high - rest) * series / hold, low + (low - rest) * series / hold


def surely_high(net: str, level: str) -> float:
    """At whatever supply the level may have."""
    return max(wanted(net, volts)[0] for volts in RAILS[level][:2])


def short_faults(row: Table, name: str, gives: float, net: str) -> list[str]:
    """Of an output's least volts. What misses the worst corner must be excepted in the table, by
    as much as is missing."""
    high = surely_high(net, row["level"])
    missing = max(round(high - gives, 2), 0.0)
    excepted = row.get("short_v", {}).get(name, 0.0)
    if missing == excepted:
        return []
    if not missing:
        return [f"{name}: {gives:g} V arrive, {high:.2f} V are high: short_v is stale"]
    return [f"{name}: {gives:g} V arrive, {high:.2f} V are high at {row['level']}: "
            f"{missing:.2f} V are missing, short_v is {excepted:.2f}"]


def exceptions() -> list[tuple[float, float]]:
    """Least V of each output that is excepted, and V that are missing."""
    table, wiring = tables()
    found: list[tuple[float, float]] = []
    for row in [*table["cameras"], *table["others"]]:
        if "short_v" not in row:
            continue
        gives = row["gives_v"] if "gives_v" in row else camera_facts(row, wiring)[1]["high_v"]
        found += [(gives[0], short) for short in row["short_v"].values()]
    return found


def trigger_faults(row: Table, into: Table) -> list[str]:
    if into.get("high_v") is None:
        return [] if not row["known"] else ["its input's levels are not known"]
    return input_faults(row["level"], into)


def input_faults(level: str, into: Table) -> list[str]:
    """Of an input at an output of the carrier; where no level is known, of what it bears."""
    faults: list[str] = []
    _, most, inside = RAILS[level]
    milliamps = into.get("draws_ma", into.get("needs_ma", 0.1))
    if "high_v" in into and given(level, milliamps) < into["high_v"]:
        faults.append(f"{given(level, milliamps):.2f} V arrive at {milliamps:g} mA, "
                      f"{into['high_v']:g} V are high")
    if most > into["highest_v"]:
        faults.append(f"{most:g} V arrive, the input bears {into['highest_v']:g} V")
    pull = into.get("pulls_up")
    if pull:
        low = pull["v"] * (inside + SERIES) / (inside + SERIES + pull["ohm"])
        if low > into.get("low_v", 0.8):
            faults.append(f"its pull-up leaves {low:.2f} V at low")
    return faults


def delivery_faults(ref: str, into: Table) -> list[str]:
    """Of an input at a jumper that nobody has moved yet: it may not work, but it must survive."""
    _, most, _ = RAILS[BOARD.parts[ref].delivered.removesuffix("V") + " V"]
    if most <= into.get("highest_v", most):
        return []
    return [f"{most:g} V arrive as delivered, the input bears {into['highest_v']:g} V"]


def exposure_faults(row: Table, output: Table) -> list[str]:
    faults, level = [], row["level"]
    least, most, _ = RAILS[level]
    if output["kind"] == "push-pull":
        faults += short_faults(row, "exposure", output["high_v"][0], EXPOSURE)
        if output["high_v"][1] > INPUT_MOST:
            faults.append(f"{output['high_v'][1]:g} V arrive, the input bears {INPUT_MOST:g} V")
        return faults
    if row["pull"] != "up":
        faults.append("the output only pulls down: its jumper must be at UP")
    series, hold, _ = resistors(EXPOSURE)
    for volts in (least, most):
        pulled = (volts - DROP) * (series + hold) / (PULL_UP + series + hold)
        if pulled < wanted(EXPOSURE, volts)[0]:
            faults.append(f"the pull-up gives {pulled:.2f} V, {wanted(EXPOSURE, volts)[0]:.2f} V "
                          "are high")
    milliamps = (most - DROP) / PULL_UP * 1000
    pull = output.get("pulls_up")
    milliamps += pull["v"] / pull["ohm"] * 1000 if pull else 0.0
    if milliamps > output.get("sinks_ma", 25):
        faults.append(f"the output bears {output['sinks_ma']:g} mA, the pull-up gives "
                      f"{milliamps:.1f}")
    if output.get("low"):
        left, low = residual(output["low"], milliamps), wanted(EXPOSURE, least)[1]
        if left > low:
            faults.append(f"the output leaves {left:.2f} V at low, {low:.2f} V are allowed")
    return faults


def residual(rows: list[Table], milliamps: float) -> float:
    """On the line through the first and the last figure."""
    first, last = rows[0], rows[-1]
    if first["ma"] == last["ma"]:
        return float(first["v"])
    slope = (last["v"] - first["v"]) / (last["ma"] - first["ma"])
    return float(first["v"] + slope * (milliamps - first["ma"]))


def pin_faults(row: Table, wiring: Table) -> list[str]:
    """No pin is driven and supply, and none contradicts the table of the wiring."""
    faults = []
    pins = row["camera_pins"]
    for name in ("trigger", "exposure"):
        numbers = [number for number, what in pins.items() if what == name]
        if row["known"] and len(numbers) != 1:
            faults.append(f"{name} is at {len(numbers)} pins")
        camera = wiring.get(row["name"])
        if camera and numbers and camera[name].get("pin") != int(numbers[0]):
            faults.append(f"{name} is at pin {numbers[0]}, in wiring.json at "
                          f"{camera[name].get('pin')}")
    camera = wiring.get(row["name"])
    if camera and str(camera.get("supply_pin", "")) in pins and \
            pins[str(camera["supply_pin"])] != "supply":
        faults.append(f"pin {camera['supply_pin']} is the camera's supply, and "
                      f"{pins[str(camera['supply_pin'])]} here")
    return faults


def shared_pins(table: Table) -> list[str]:
    """A pin that one camera uses for a signal and another one of the same plug for its supply may
    not be wired to both in one cable; the carrier has no such connector."""
    return [f"{name}: supply and a signal are on one connector"
            for name, connector in table["connectors"].items()
            if "supply" in connector["pins"].values() and
            {"trigger", "exposure"} & set(connector["pins"].values())]


# Words of the table's pins by the carrier's nets; other nets as they are called there.
PIN_WORDS = {"GND": "ground", "5V_OUT": "5 V", "+3V3": "3.3 V", "READY1_IN": "ready1"}
PIN_ENDS = (("_TRIGGER", "trigger"), ("_EXPOSURE", "exposure"), ("_PPS", "pps"),
            ("_SERIAL", "serial"))


def pin_word(net: str) -> str:
    if net.startswith("VCAM"):
        return "supply"
    ends = [word for end, word in PIN_ENDS if net.endswith(end)]
    return ends[0] if ends else PIN_WORDS.get(net, net.lower().removesuffix("_x"))


def connector_faults(table: Table) -> list[str]:
    """The table's pins are the carrier's."""
    faults = []
    for name, connector in table["connectors"].items():
        for label in connector["board"]:
            part = next(part for part in BOARD.parts.values() if part.label == label)
            there = {number: pin_word(net) for number, net in part.nets.items() if number != "MP"}
            if connector["pins"] != there:
                faults.append(f"{name}: its pins are not those of {label}")
    return faults


def lidar_faults(row: Table, wiring: Table) -> list[str]:
    lidar = wiring[row["name"]]
    return [f"{line}: {fault}" for line in ("pulse", "serial")
            for fault in [*input_faults(row["level"], lidar[line]["input"]),
                          *delivery_faults("JP600", lidar[line]["input"])]]


def other_faults(row: Table, table: Table) -> list[str]:
    faults = []
    pins = table["connectors"][row["at"]]["pins"].values()
    faults += [f"{signal} is no pin of {row['at']}" for signal in row["wires"]
               if signal not in pins]
    for signal in row["wires"]:
        if signal in SLOW:
            faults += short_faults(row, signal, row["gives_v"][0], SLOW[signal])
    if row["at"] == "imu_spi" and row["gives_v"][1] > 3.6:
        faults.append(f"gives {row['gives_v'][1]:g} V to a pin that bears 3.6 V")
    return faults


def faults(table: Table, wiring: Table) -> list[str]:
    """Of tables()."""
    found = shared_pins(table) + connector_faults(table)
    for row in table["cameras"]:
        into, output = camera_facts(row, wiring)
        found += [f"{row['name']}: {fault}" for fault in
                  [*trigger_faults(row, into), *delivery_faults("JP200", into),
                   *exposure_faults(row, output), *pin_faults(row, wiring)]]
    for row in table["others"]:
        wrong = (lidar_faults(row, wiring) if row["at"] == "lidar"
                 else other_faults(row, table))
        found += [f"{row['name']}: {fault}" for fault in wrong]
    return found + [f"{name} of wiring.json has no cable" for name in wiring
                    if name not in {row["name"] for row in [*table["cameras"], *table["others"]]}]
