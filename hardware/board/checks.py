# SPDX-License-Identifier: BSD-3-Clause
"""Checks of the circuit that no program of KiCad makes. Each returns sentences, one a fault."""
from __future__ import annotations

import dataclasses
import itertools
from typing import Iterator

from carrier import LEVELS, firmware_pins
from model import Board, Part, Pin

# Meant to be open: by board.
OPEN = {"carrier": {("U2", "SHDN"), ("U1", "RUN"), ("U1", "VBUS"), ("U1", "GP18"), ("J700", "3"),
                    ("J742", "1")},
        "leds": {("U2", "Q6"), *(("U3", f"2Y{i}") for i in range(4))},
        "adis": {*(("J1", i) for i in ("7", "9")), *(("J2", i) for i in ("5", "15", "16"))}}
DRIVERS = {"output", "power_out"}
PICO_HIGH, PICO_LOW, PICO_MOST = 2.0, 0.8, 3.6
PICO_GIVES = (2.62, 0.5)  # at 4 mA
WEAK_PULL = 8.2e3  # ohm that still hold a pin of a Pico 2 against its leakage
BACK_FEED_OHM = 1000.0
DECOUPLED = ("t45", "schmitt", "lvc", "hc", "isolator", "buck", "ldo", "imu", "efuse")
SIGNAL_SUPPLY = ("VIN", "VPROT", "VCAM", "24V", "+")
SUPPLY_NAMES = ("power_in",)


def fitted(board: Board, variant: str) -> Iterator[Part]:
    return (part for part in board.parts.values() if variant in part.fitted)


def pins_on(board: Board, net: str, variant: str) -> list[tuple[Part, Pin]]:
    return [(part, pin) for part, pin in board.pins_of(net) if variant in part.fitted]


def driving(part: Part, pin: Pin) -> bool:
    """True of a pin that drives its net; of transceivers, direction decides."""
    if part.component.family == "t45":
        to_b = part.net("DIR") != "GND"
        return pin.name.startswith("B") == to_b and pin.name[0] in "AB"
    if part.ref == "U1" and pin.kind == "bidirectional":
        return pico_output(part.nets.get(pin.number, ""))
    return pin.kind in DRIVERS


def pico_output(net: str) -> bool:
    return net.startswith(("TRIGGER", "SYNC_OUTPUT", "TEST_OUTPUT", "LIGHT", "UART_TRANSMIT",
                           "SPI_CLOCK", "SPI_TRANSMIT", "SPI_SELECT"))


def listening(part: Part, pin: Pin) -> bool:
    if pin.kind not in ("input", "bidirectional") or part.component.family in ("npn", "pnp"):
        return False
    return not driving(part, pin)


def unconnected(board: Board) -> list[str]:
    faults = [f"{part.ref}: pin {pin.name} is open" for part in board.parts.values()
              for pin in part.component.pins
              if pin.kind != "nc" and pin.number not in part.nets
              and (part.ref, pin.name) not in OPEN[board.name]]
    faults += [f"{part.ref}: pin {pin.number} must stay open" for part in board.parts.values()
               for pin in part.component.pins if pin.kind == "nc" and pin.number in part.nets]
    return faults + [f"{net} ends at one pin" for net in board.nets()
                     if len(board.pins_of(net)) < 2]


def drivers(board: Board) -> list[str]:
    """In each variant: no net with two drivers, no input without a driver or a resistor."""
    faults = []
    for variant, net in itertools.product(board.variants, board.nets()):
        pins = pins_on(board, net, variant)
        driven = sorted({part.ref for part, pin in pins if driving(part, pin)})
        if len(driven) > 1 and net not in board.rails:
            faults.append(f"{variant}: {net} is driven by {' and '.join(driven)}")
        if any(listening(part, pin) for part, pin in pins) and not driven and \
                not held(board, net, variant):
            faults.append(f"{variant}: the inputs on {net} float")
    return faults


def held(board: Board, net: str, variant: str) -> bool:
    """A supply, or a resistor to something that is driven or a supply, holds it."""
    if is_supply(board, net):
        return True
    return any(is_supply(board, other) or has_driver(board, other, variant)
               for other, _ in across(board, net, variant))


def is_supply(board: Board, net: str) -> bool:
    return net == "GND" or net == "RTN" or net in board.rails or net.startswith(
        ("GND", "LEVEL", "LIDAR0_LEVEL", "LIDAR1_LEVEL"))


def has_driver(board: Board, net: str, variant: str) -> bool:
    return any(driving(part, pin) for part, pin in pins_on(board, net, variant))


def across(board: Board, net: str, variant: str) -> list[tuple[str, float]]:
    """Nets at the far ends of resistors, with their ohms."""
    found = []
    for part, _ in pins_on(board, net, variant):
        if part.component.family == "resistor":
            far = next(other for other in part.nets.values() if other != net)
            found.append((far, part.component.figure("ohm")))
    return found


def levels_of(board: Board, net: str) -> list[tuple[float, float]]:
    """Volts, least and most, that a supply may have; of a level, each choice of its jumper."""
    if net in board.rails:
        rail = board.rails[net]
        return [(rail.least, rail.most)]
    if net.startswith("LEVEL"):
        return [levels_of(board, rail)[0] for rail in LEVELS.values()]
    if net.endswith("_LEVEL"):
        return [levels_of(board, "+3V3")[0], levels_of(board, "+5V")[0]]
    raise KeyError(net)


def thresholds(part: Part, pin: Pin, least: float, most: float) -> tuple[float, float]:
    """Volts that are surely high, and surely low, at an input."""
    family = part.component.family
    if part.component.name == "Raspberry Pi Pico":
        return PICO_HIGH, PICO_LOW
    if family == "schmitt":
        return between(SCHMITT_HIGH, most), between(SCHMITT_LOW, least)
    if family == "isolator":
        return 0.7 * most, 0.3 * least
    if family in ("t45", "lvc", "imu") and least < 2.3:
        return 0.65 * most, 0.35 * least
    if family in ("t45", "lvc", "hc") and least >= 4.0:
        return 0.7 * most, 0.3 * least
    return (0.7 * most, 0.3 * least) if family == "imu" else (2.0, 0.8)


# NXP 74LVC3G17 rev. 6, table 11, -40 to +85 degrees: thresholds by supply.
SCHMITT_HIGH = ((1.8, 1.5), (2.3, 1.8), (3.0, 2.2), (4.5, 3.1), (5.5, 3.6))
SCHMITT_LOW = ((1.8, 0.25), (2.3, 0.40), (3.0, 0.60), (4.5, 1.0), (5.5, 1.2))


def between(table: tuple[tuple[float, float], ...], at: float) -> float:
    """On the line between two rows; the first and the last rows end it."""
    at = min(max(at, table[0][0]), table[-1][0])
    for (a, low), (b, high) in zip(table, table[1:]):
        if a <= at <= b:
            return low + (high - low) * (at - a) / (b - a)
    raise ValueError(at)


def supply_net(part: Part, pin: Pin) -> str:
    return part.net(pin.supply) if pin.supply else ""


def gives(part: Part, least: float) -> tuple[float, float]:
    """Volts at high at least, at low at most, with the load that the board puts on it."""
    if part.component.name == "Raspberry Pi Pico":
        return PICO_GIVES
    if part.component.family == "isolator":
        return least - 0.4, 0.4
    return least - 0.1, 0.1  # at 100 uA


def level_faults(board: Board) -> list[str]:
    """Each output against each input that it reaches, directly or through a resistor."""
    faults = []
    for variant, net in itertools.product(board.variants, board.nets()):
        outputs = [(p, pin) for p, pin in pins_on(board, net, variant)
                   if driving(p, pin) and pin.supply]
        reached = [net] + [far for far, ohm in across(board, net, variant) if ohm <= 1000]
        for part, pin in outputs:
            for far in reached:
                for other, to in pins_on(board, far, variant):
                    if listening(other, to) and to.supply:
                        faults += level_fault(board, (part, pin), (other, to), far)
    return faults


def level_fault(board: Board, source: tuple[Part, Pin], sink: tuple[Part, Pin], net: str
                ) -> list[str]:
    faults = []
    (part, pin), (other, to) = source, sink
    from_net, to_net = supply_net(part, pin), supply_net(other, to)
    for low, high in levels_of(board, from_net):
        choices = [(low, high)] if to_net == from_net else levels_of(board, to_net)
        for least, most in choices:
            one, zero = gives(part, low)
            needed, allowed = thresholds(other, to, least, most)
            if to_net == from_net:  # they rise and fall together
                needed, allowed = (max(thresholds(other, to, v, v)[0] - (v - low)
                                       for v in (low, high)), thresholds(other, to, low, low)[1])
            if one < needed:
                faults.append(f"{part.ref} gives {one:.2f} V on {net}, {other.ref} at {least:g} to "
                              f"{most:g} V needs {needed:.2f} V")
            if zero > allowed:
                faults.append(f"{part.ref} leaves {zero:.2f} V on {net}, {other.ref} allows "
                              f"{allowed:.2f} V")
            if high > other.component.figure("most_v"):
                faults.append(f"{part.ref} puts {high:g} V on {net}, {other.ref} bears "
                              f"{other.component.figure('most_v'):g} V")
    return faults


def pico_alone(board: Board) -> list[str]:
    """Nothing feeds a Pico without supply: what drives its pins is supplied by the Pico's own
    3.3 V, and what comes from outside meets a part that blocks without supply, or 1 k."""
    faults = []
    for pin in board.parts["U1"].component.pins:
        net = board.parts["U1"].nets.get(pin.number, "")
        if pin.kind != "bidirectional" or not net:
            continue
        for part, other in board.pins_of(net):
            if part.ref != "U1" and driving(part, other) and supply_net(part, other) != "+3V3":
                faults.append(f"{part.ref} at {supply_net(part, other)} drives {net} also while "
                              "the Pico has no supply")
            if part.component.family in ("connector", "jumper"):
                faults.append(f"{net} of the Pico is at {part.ref} without protection")
        for variant in board.variants:
            faults += bare_ways(board, net, variant)
    return faults


POWERED_BY_BOARD = {"J800", "J801"}  # their IMUs have no supply but the board's


def bare_ways(board: Board, net: str, variant: str) -> list[str]:
    return [f"{net} of the Pico is at {part.ref} through {ohm:g} ohm only"
            for far, ohm in across(board, net, variant) if ohm < BACK_FEED_OHM
            for part, _ in board.pins_of(far)
            if part.component.family == "connector" and part.ref not in POWERED_BY_BOARD]


def rests(board: Board) -> list[str]:
    """Each pin of the Pico has a resistor that holds it, strong enough for a Pico 2 as well, or is
    always driven."""
    faults = []
    pico = board.parts["U1"]
    for pin in pico.component.pins:
        net = pico.nets.get(pin.number, "")
        if pin.kind != "bidirectional" or not net or net.startswith("SPI_") and pico_output(net):
            continue
        for variant in board.variants:
            pulls = [ohm for far, ohm in across(board, net, variant) if is_supply(board, far)]
            always = any(driving(part, other) and part.ref != "U1" and
                         part.component.family in ("schmitt", "lvc")
                         for part, other in pins_on(board, net, variant))
            if not always and (not pulls or min(pulls) > WEAK_PULL):
                faults.append(f"{variant}: nothing of {WEAK_PULL / 1000:g} k or less holds {net}")
    faults += [f"{part.ref} drives high while its other side has no supply"
               for part in board.parts.values() if part.component.family == "isolator" and
               not dict(part.component.figures).get("fails_low")]
    return faults


def protection(board: Board) -> list[str]:
    """Each signal at a connector has an ESD part, whose stand-off is not below what the line may
    have."""
    faults = []
    for part in board.parts.values():
        if part.component.family != "connector":
            continue
        for pin in part.component.pins:
            net = part.nets.get(pin.number, "")
            if not net or net.startswith("GND") or net in board.rails and net != "VIN":
                continue
            guards = [other for other, _ in board.pins_of(net)
                      if other.component.family in ("esd", "tvs")]
            if not guards:
                faults.append(f"{net} at {part.ref} has no ESD part")
            faults += [f"{guard.ref} stands {guard.component.figure('standoff'):g} V, {net} may "
                       f"have {line_volts(net):g} V" for guard in guards
                       if guard.component.figure("standoff") < line_volts(net)]
    return faults


def line_volts(net: str) -> float:
    """What a line may have for long, wiring faults that it must survive included."""
    if net.startswith(("ISO", "24V", "LIGHT_SINK", "VIN")):
        return 30.0
    if net.startswith(("SPI_", "IMU_READY0", "ACCEL")):
        return 3.6  # only supplied by the board
    return 24.0


def supplies(board: Board) -> list[str]:
    """Consumers of each rail against what it gives, and volts against what parts bear."""
    faults = []
    for rail, milliamps in loads(board).items():
        if milliamps > board.rails[rail].milliamps:
            faults.append(f"{rail} gives {board.rails[rail].milliamps:g} mA, its consumers take "
                          f"{milliamps:.0f}")
    for part in board.parts.values():
        for pin in part.component.pins:
            net = part.nets.get(pin.number, "")
            if pin.kind == "power_in" and net in board.rails and part.component.figures and \
                    "most_v" in dict(part.component.figures) and \
                    board.rails[net].most > part.component.figure("most_v") and part.ref != "U1":
                faults.append(f"{part.ref} bears {part.component.figure('most_v'):g} V, {net} has "
                              f"up to {board.rails[net].most:g}")
    return faults


def loads(board: Board) -> dict[str, float]:
    """mA of each rail at its worst: every level jumper at the same rail, every output loaded."""
    total = {rail: 0.0 for rail in board.rails}
    for part in board.parts.values():
        figures = dict(part.component.figures)
        for pin in part.component.pins:
            net = part.nets.get(pin.number, "")
            if pin.kind == "power_in" and net in total:
                total[net] += figures.get("supply_ma", 0.0)
    triggers = 4 * (15 + 5)  # a camera takes up to 15 mA, its pull-up gives up to 5
    total["+3V3"] += 100 + triggers  # an ADIS16448 takes 104 mA at most, others less
    total["+1V8"] += triggers / 2
    lidars = 4 * 10
    usb_parts = 100 + 2 * 2.2  # the Pico itself, and lights
    total["5V_OUT"] += 2 * 150  # a GNSS receiver, and an IMU on the UART
    total["+5V"] += lidars + usb_parts + total["+3V3"] + total["+1V8"] + total["5V_OUT"]
    total["5V_BUCK"] = total["+5V"]
    # At the usual input; at 7 V the eFuse leaves 1.4 A to cameras and light together.
    total["VPROT"] += 4 * 300 + 300 + total["5V_BUCK"] * 5.0 / board.rails["VPROT"].usual / 0.85
    for n in (2, 3):
        if f"5V_ISO{n}" in total:
            total[f"5V_ISO{n}"] += 0.45
    return total


def pin_map(board: Board) -> list[str]:
    """The Pico's nets against the firmware's own table."""
    wanted = {f"GP{gpio}": name.upper() for name, gpio in firmware_pins().items()}
    pico = board.parts["U1"]
    found = {pin.name: pico.nets.get(pin.number, "") for pin in pico.component.pins
             if pin.name.startswith("GP")}
    faults = [f"{gpio} is {name} of the firmware, {found.get(gpio)} on the board"
              for gpio, name in wanted.items() if name != "LOOP" and found.get(gpio) != name]
    loop = next(gpio for gpio, name in wanted.items() if name == "LOOP")
    return faults + ([f"{loop} is the firmware's loop, which must stay open"]
                     if found[loop] else [])


def isolation(board: Board) -> list[str]:
    """Only the isolators join the isolated side and the other one."""
    faults = []
    for part in board.parts.values():
        sides = {side_of(net) for net in part.nets.values()}
        if len(sides) > 1 and part.component.family != "isolator":
            names = sorted(side or "the board" for side in sides)
            faults.append(f"{part.ref} joins {' and '.join(names)}")
    return faults


def side_of(net: str) -> str:
    for n in (2, 3):
        if f"ISO{n}" in net:
            return f"ISO{n}"
    return ""


def connectors(board: Board) -> list[str]:
    """A connector that carries a camera's signals carries no supply."""
    return [f"{part.ref} has {net} beside a camera's signal" for part in board.parts.values()
            if part.component.family == "connector" and
            any(net.startswith("CAM") for net in part.nets.values())
            for net in part.nets.values() if net.startswith(SIGNAL_SUPPLY)]


HIGH = 5.5  # V above which a supply destroys what is made for signals
INPUT_BEARS = 24.0  # V that an input of the board takes for long


@dataclasses.dataclass(frozen=True)
class Contact:
    """What a pin of a connector is for: the board supplies, drives or listens, or neither. `volts`
    is the most at each setting of a jumper."""
    kind: str  # open, ground, supply, output, input
    volts: tuple[float, ...] = ()


def contact(board: Board, part: Part, pin: Pin) -> Contact:
    net = part.nets.get(pin.number, "")
    if not net or net.startswith("GND"):
        return Contact("ground" if net else "open")
    if net in board.rails:
        return Contact("supply", (board.rails[net].most,))
    for variant in sorted(part.fitted):
        near = [net, *(far for far, ohm in across(board, net, variant) if ohm <= 1000)]
        for other, to in (found for each in near for found in pins_on(board, each, variant)):
            if to.kind == "open_collector":
                return Contact("output", (line_volts(net),))
            if driving(other, to) and to.supply:
                return Contact("output", tuple(most for _, most in
                                               levels_of(board, supply_net(other, to))))
    return Contact("input", (INPUT_BEARS,))


def plugs(board: Board) -> list[Part]:
    return [part for part in board.parts.values() if part.component.family == "connector"]


def contacts(board: Board, part: Part) -> dict[str, Contact]:
    return {pin.number: contact(board, part, pin) for pin in part.component.pins
            if pin.number != "MP"}


def named(part: Part) -> str:
    return part.label or part.ref


def swaps(board: Board) -> list[str]:
    """A plug that fits a connector of another use, too, destroys nothing there."""
    faults = []
    for part, other in itertools.permutations(plugs(board), 2):
        if part.component.name != other.component.name:
            continue
        there = contacts(board, other)
        for number, here in contacts(board, part).items():
            fault = harm(here, there[number])
            if fault:
                faults.append(f"the plug of {named(part)} fits {named(other)}: at pin {number} "
                              f"{fault}")
    return faults


def harm(meant: Contact, met: Contact) -> str:
    """Of a cable that was made for one contact and meets another. What the board drives is a
    device's input, and bears the least of what a jumper can set; where both connectors have the
    same choice, it is the user's."""
    if "open" in (meant.kind, met.kind) or meant == met:
        return ""
    if meant.kind == "ground":
        return "ground meets what the board drives" if met.kind in ("supply", "output") else ""
    if met.kind == "ground":
        return "the device's output meets ground" if meant.kind == "input" else ""
    if meant.kind == "input":
        return "the device's output meets what the board drives"
    if meant.kind == "supply" and met.kind == "output":
        return "the device takes its supply from an output"
    if max(met.volts) > min(meant.volts) and met.kind != "input":
        return f"{max(met.volts):g} V meet what bears {min(meant.volts):g} V"
    return ""


def high_supplies(board: Board) -> list[str]:
    """A supply above 5 V shares no type of connector with another use. What the board supplies
    does not even share the family; what a plug brings has more pins than all others of the family,
    so that this plug enters none of them, and its own connector is dead without it."""
    faults = []
    for part in plugs(board):
        for net in dict.fromkeys(part.nets.values()):
            if net not in board.rails or board.rails[net].most <= HIGH:
                continue
            says = f"{named(part)} has {net}, up to {board.rails[net].most:g} V"
            for other in plugs(board):
                same = contacts(board, other) == contacts(board, part)
                if other.component.name == part.component.name and not same:
                    faults.append(f"{says}, and the connector of {named(other)}")
                if family(other) == family(part) and low(board, other):
                    pins = len(part.component.pins)
                    if fed_here(board, net):
                        faults.append(f"{says}, and the family of {named(other)}")
                    elif len(other.component.pins) >= pins:
                        faults.append(f"{says}, and no more pins than {named(other)}")
    return faults


def family(part: Part) -> str:
    return part.component.name.split()[0]


def low(board: Board, part: Part) -> bool:
    """True of a connector without a supply above 5 V."""
    return all(board.rails[net].most <= HIGH for net in part.nets.values() if net in board.rails)


def fed_here(board: Board, net: str) -> bool:
    """True of a supply that comes from the board, not from what is plugged in."""
    return any(pin.kind == "power_out" or part.component.family == "fuse"
               for part, pin in board.pins_of(net))


def contact_currents(board: Board) -> list[str]:
    """Contacts bear what their rail may give."""
    return [f"a contact of {named(part)} bears {part.component.figure('amps'):g} A, {net} may give "
            f"{board.rails[net].milliamps / 1000:g}" for part in plugs(board)
            for net in dict.fromkeys(part.nets.values())
            if net in board.rails and
            board.rails[net].milliamps > part.component.figure("amps") * 1000]


def ratings(board: Board) -> list[str]:
    """Volts of capacitors and fuses, watts of resistors that may see a wrong 24 V."""
    faults = []
    for part in board.parts.values():
        family = part.component.family
        volts = [board.rails[net].most for net in part.nets.values() if net in board.rails]
        if family in ("capacitor", "fuse") and volts:
            most = min(max(volts), 36.7) if "VIN" in part.nets.values() else max(volts)
            if part.component.figure("volts") < most * (1.25 if family == "capacitor" else 0.95):
                faults.append(f"{part.ref} bears {part.component.figure('volts'):g} V, it may have "
                              f"{most:g}")
        if family == "resistor":
            watts = resistor_volts(board, part) ** 2 / part.component.figure("ohm")
            if watts > part.component.figure("watts") * 1.02:
                faults.append(f"{part.ref} bears {part.component.figure('watts'):g} W, it may "
                              f"take {watts:.2f}")
    return faults


def resistor_volts(board: Board, part: Part) -> float:
    """The most that may lie across it for long."""
    nets = set(part.nets.values())
    if any(net.endswith("_GATE") for net in nets):
        return 29.2 if any(net.endswith("_SINK") for net in nets) else 1.0  # base and emitter
    if any(net.startswith("24V") for net in nets):
        return 30.0 - (4.6 if any(net.startswith("5V") for net in nets) else 0.0)
    outside = any(net.endswith(("_EXPOSURE", "_IN", "_DOWN")) and not net.startswith("CAM") or
                  net.endswith("_EXPOSURE") for net in nets)
    if outside and part.component.figure("ohm") >= 1000:
        return 24.0 - (4.8 if any(net.endswith(("_IN", "_NODE")) for net in nets) else 0.0)
    if any(net.endswith("_DOWN") for net in nets):
        return 24.0
    if "PPS_50" in nets:
        return 3.5  # 3.3 V, or 5 V from 50 ohm
    rails = [board.rails[net].most for net in nets if net in board.rails]
    return max(rails) if rails and "GND" in nets else 0.0


def decoupling(board: Board) -> list[str]:
    """Each supply pin of a chip has a capacitor to ground on its net."""
    faults = []
    for part in board.parts.values():
        if part.component.family not in DECOUPLED:
            continue
        for pin in part.component.pins:
            net = part.nets.get(pin.number, "")
            if pin.kind != "power_in" or net.startswith("GND") or not net:
                continue
            if not any(other.component.family == "capacitor" and
                       any(far.startswith("GND") for far in other.nets.values())
                       for other, _ in board.pins_of(net)):
                faults.append(f"{part.ref}: {pin.name} at {net} has no capacitor")
    return faults


CIRCUIT = (unconnected, drivers, level_faults, pico_alone, rests, protection, supplies, pin_map,
           isolation, connectors, swaps, high_supplies, contact_currents, ratings, decoupling)


def circuit_faults(board: Board) -> list[str]:
    return [fault for check in CIRCUIT for fault in dict.fromkeys(check(board))]


def plain_faults(board: Board) -> list[str]:
    """Of a board without a Pico."""
    return [fault for check in (unconnected, drivers, level_faults, decoupling)
            for fault in dict.fromkeys(check(board))]
