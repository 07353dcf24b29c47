# SPDX-License-Identifier: BSD-3-Clause
"""Small boards that go with the carrier: a row of LEDs that counts, and an adapter for IMUs."""
from __future__ import annotations

import catalogue as c
from catalogue import gh, jumper, resistor
from model import Board, Place, Rail

LEDS = 10
PITCH = 10.0  # mm from LED to LED


def leds() -> Board:
    """The row that `versavis evaluate leds` reads: 1 and 10 always on, one of 2 to 5, and 6 to 9 in
    binary. Each rising edge at TEST is a step."""
    board = Board("leds", "VersaVIS LED timing board", PITCH * LEDS, 24.0)
    board.layers, board.planes = 2, {"B.Cu": "GND"}
    board.rails = {"+5V": Rail(4.0, 4.7, 5.25, 150)}
    board.sheet("counter", "Counter and LEDs")
    g = "counter"
    board.add("J1", gh(3), g, label="5V TEST GND", words={"1": "5 V in"}, _1="+5V", _2="TEST",
              _3="GND", MP="GND")
    board.add("R1", resistor("47k"), g, near="U1.2", _1="TEST", _2="GND")
    board.add("U1", c.INVERTER, g, A="TEST", GND="GND", Y="CLOCK", VCC="+5V")
    board.add("U2", c.COUNTER, g, CP="CLOCK", MR="GND", GND="GND", VCC="+5V", Q0="BIT0", Q1="BIT1",
              Q2="BIT2", Q3="BIT3", Q4="BIT4", Q5="BIT5")
    board.add("U3", c.DECODER, g, GND="GND", VCC="+5V",
              named={"1E": "GND", "1A0": "BIT0", "1A1": "BIT1", "1Y0": "STEP0", "1Y1": "STEP1",
                 "1Y2": "STEP2", "1Y3": "STEP3", "2E": "+5V", "2A0": "GND", "2A1": "GND"})
    for ref, near in (("C1", "U1.5"), ("C2", "U2.14"), ("C3", "U3.16")):
        board.add(ref, c.C100N, g, near=near, _1="+5V", _2="GND")
    board.add("C4", c.C10U, g, near="J1.1", _1="+5V", _2="GND")
    for i in range(LEDS):
        high, low = ends_of(i)
        node = f"LED{i + 1}"
        board.add(f"D{i + 1}", c.RED, g, label=str(i + 1), A=node if low != node else high, K=low)
        board.add(f"R{i + 11}", resistor("1k"), g, near=f"D{i + 1}.2", _1=high, _2=node)
    for i in (1, 2):
        board.add(f"H{i}", c.HOLE, "mechanics")
    board.texts = [(50.0, 20.6, 1.4, "VersaVIS LEDs  CERN-OHL-P-2.0")]
    return board


def ends_of(i: int) -> tuple[str, str]:
    """Nets that the resistor and the cathode of LED i + 1 go to."""
    if i in (0, LEDS - 1):
        return "+5V", "GND"
    return ("+5V", f"STEP{i - 1}") if i < 5 else (f"BIT{i - 3}", "GND")


def leds_by_hand(width: float, height: float) -> dict[str, Place]:
    places = {f"D{i + 1}": Place(5.0 + PITCH * i, 5.0, 0) for i in range(LEDS)}
    places |= {"J1": Place(15.0, height - 3.1, 0), "U1": Place(24.0, 14.0, 0),
               "U2": Place(43.0, 13.5, 90), "U3": Place(66.0, 13.5, 90),
               "H1": Place(3.8, height - 4.0), "H2": Place(width - 3.8, height - 4.0)}
    return places


def adis() -> Board:
    """From the carrier's IMU SPI to the 16 pins of Analog Devices' breakout boards: ADIS16IMU2 for
    ADIS1644x (with ADIS1644X/FLEX), and those of ADIS1646x and 1647x. Data-ready is DIO1 of the
    ADIS1644x, DIO2 of others: the jumper chooses."""
    board = Board("adis", "VersaVIS adapter for ADIS IMUs", 34.0, 26.0)
    board.layers, board.planes = 2, {"B.Cu": "GND"}
    board.rails = {"+3V3": Rail(3.2, 3.3, 3.4, 200)}
    board.sheet("adapter", "Adapter")
    g = "adapter"
    board.add("J1", gh(9), g, label="IMU SPI", words={"1": "3.3 V in"}, _1="+3V3", _2="GND",
              _3="SCLK", _4="DIN", _5="DOUT", _6="CS", _8="READY", MP="GND")
    board.add("J2", c.RIBBON, g, label="ADIS 1", _1="RESET", _2="SCLK", _3="CS", _4="DOUT",
              _6="DIN", _7="GND", _8="GND", _9="GND", _10="+3V3", _11="+3V3", _12="+3V3",
              _13="DIO1", _14="DIO2")
    board.add("JP1", jumper(3), g, label="READY", marks=(("1", -2.05, 0, 0), ("2", 7.13, 0, 0)),
              delivered="1", _1="DIO1", _2="READY", _3="DIO2")
    board.add("R1", resistor("10k"), g, near="J2.1", _1="RESET", _2="+3V3")
    board.add("C1", c.C100N, g, near="J2.10", _1="+3V3", _2="GND")
    board.add("C2", c.C10U, g, near="J2.12", _1="+3V3", _2="GND")
    for i in (1, 2):
        board.add(f"H{i}", c.HOLE, "mechanics")
    return board


def adis_by_hand(width: float, height: float) -> dict[str, Place]:
    return {"J1": Place(width / 2, height - 3.1), "J2": Place(10.0, 5.4),
            "JP1": Place(11.0, 14.0), "H1": Place(3.8, 3.8), "H2": Place(width - 3.8, 3.8)}
