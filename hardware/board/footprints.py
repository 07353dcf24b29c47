# SPDX-License-Identifier: BSD-3-Clause
"""Footprints, drawn from the makers' land patterns. Where KiCad's library has the same, it is named
so that ./dev hardware compares the pads."""
from __future__ import annotations

from model import Box, Footprint, Pad


def grown(box: Box, by: float) -> Box:
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by


def around(pads: tuple[Pad, ...], body: Box, by: float = 0.25) -> Box:
    """The courtyard: pads and body, and room to place it."""
    return grown((min([body[0], *(p.x + p.shift[0] - p.width / 2 for p in pads)]),
                  min([body[1], *(p.y + p.shift[1] - p.height / 2 for p in pads)]),
                  max([body[2], *(p.x + p.shift[0] + p.width / 2 for p in pads)]),
                  max([body[3], *(p.y + p.shift[1] + p.height / 2 for p in pads)])), by)


def centred(width: float, height: float) -> Box:
    return -width / 2, -height / 2, width / 2, height / 2


def chip(name: str, x: float, width: float, height: float, body: Box, library: str,
         tall: float, shape: str = "roundrect", turn: float = 0) -> Footprint:
    """Two pads side by side."""
    pads = (Pad("1", -x, 0, width, height, shape=shape), Pad("2", x, 0, width, height, shape=shape))
    return Footprint(name, pads, around(pads, body), body, tall, library, turn=turn)


def two_rows(name: str, left: int, x: float, pitch: float, width: float, height: float, body: Box,
             library: str, tall: float, right: int = 0, shape: str = "roundrect",
             turn: float = 0) -> Footprint:
    """Pins down the left side and up the right one."""
    right = right or left
    step = pitch * (left - 1) / max(right - 1, 1) if right != left else pitch
    pads = [Pad(str(i + 1), -x, pitch * (i - (left - 1) / 2), width, height, shape=shape)
            for i in range(left)]
    pads += [Pad(str(left + i + 1), x, step * ((right - 1) / 2 - i), width, height, shape=shape)
             for i in range(right)]
    return Footprint(name, tuple(pads), around(tuple(pads), body), body, tall, library, turn=turn)


def htssop16() -> Footprint:
    base = two_rows("HTSSOP-16", 8, 2.86, 0.65, 1.4, 0.4, centred(4.4, 5.0), "", 1.2,
                    shape="rect", turn=-90)
    pads = (*base.pads, Pad("17", 0, 0, 3, 3, shape="rect"))
    return Footprint(base.name, pads, base.courtyard, base.body, 1.2,
                     "Package_SO:HTSSOP-16-1EP_4.4x5mm_P0.65mm_EP3x3mm", turn=-90)


def gh(count: int) -> Footprint:
    """JST GH, from the side; the cable leaves downwards (y grows)."""
    half = 1.25 * (count - 1) / 2
    pads = [Pad(str(i + 1), 1.25 * i - half, -1.85, 0.6, 1.7) for i in range(count)]
    pads += [Pad("MP", side * (half + 1.85), 1.35, 1.0, 2.7) for side in (-1, 1)]
    body = (-half - 2.25, -1.6, half + 2.25, 2.45)
    return Footprint(f"JST-GH-{count}", tuple(pads), (-half - 2.6, -2.95, half + 2.6, 2.95), body,
                     4.05, f"Connector_JST:JST_GH_SM{count:02}B-GHS-TB_1x{count:02}-1MP_P1.25mm_"
                     "Horizontal", turn=180)


def header(columns: int, rows: int, name: str = "", skip: tuple[str, ...] = ()) -> Footprint:
    """Pins of 2.54 mm; numbers run along the rows."""
    pads = []
    for row in range(rows):
        for column in range(columns):
            number = str(row * columns + column + 1)
            if number not in skip:
                pads.append(Pad(number, 2.54 * column, 2.54 * row, 1.7, 1.7, 1.0,
                                "rect" if number == "1" else "circle"))
    body = (-1.27, -1.27, 2.54 * (columns - 1) + 1.27, 2.54 * (rows - 1) + 1.27)
    return Footprint(name or f"HEADER-{columns}x{rows}", tuple(pads), grown(body, 0.1), body, 8.5,
                     kind="thru")


def ribbon(columns: int) -> Footprint:
    """Two rows of 2 mm, numbered as a ribbon cable: 1 and 2 face each other."""
    pads = tuple(Pad(str(2 * column + row + 1), 2.0 * column, -2.0 * row, 1.35, 1.35, 0.8,
                     "rect" if column + row == 0 else "circle")
                 for column in range(columns) for row in (0, 1))
    body = (-1.0, -3.0, 2.0 * (columns - 1) + 1.0, 1.0)
    return Footprint(f"RIBBON-2x{columns}", pads, grown(body, 0.25), body, 6.0, kind="thru")


def level_header() -> Footprint:
    """A plus without its fourth arm: each choice needs the pin in the middle, so that never two
    jumpers fit."""
    pads = (Pad("1", -2.54, 0, 1.7, 1.7, 1.0, "rect"), Pad("2", 0, 0, 1.7, 1.7, 1.0, "circle"),
            Pad("3", 2.54, 0, 1.7, 1.7, 1.0, "circle"), Pad("4", 0, -2.54, 1.7, 1.7, 1.0, "circle"))
    body = (-3.81, -3.81, 3.81, 1.27)
    return Footprint("HEADER-LEVEL", pads, grown(body, 0.1), body, 8.5, kind="thru")


def pico() -> Footprint:
    """From the drawing in the Pico data sheet: 51 x 21 mm, rows of 20 at 2.54 mm, 17.78 mm apart,
    pin 1 1.37 mm from the end with USB, whose socket stands out 1.3 mm. USB at the top. The copper
    reaches past the holes, so that the module can be soldered flat by its edge, too."""
    pads = []
    for i in range(20):
        y = 2.54 * i - 24.13
        pads.append(Pad(str(i + 1), -8.89, y, 3.2, 1.6, 1.02, "rect" if i == 0 else "oval",
                        shift=(-0.8, 0)))
        pads.append(Pad(str(40 - i), 8.89, y, 3.2, 1.6, 1.02, "oval", shift=(0.8, 0)))
    pads += [Pad("", side * 5.7, y, 2.1, 2.1, 2.1, "circle", plated=False)
             for side in (-1, 1) for y in (-23.5, 23.5)]
    body = (-10.5, -25.5, 10.5, 25.5)
    return Footprint("RASPBERRY-PI-PICO", tuple(pads), (-11.4, -25.75, 11.4, 25.75), body, 3.9,
                     kind="thru")


def micro_fit(columns: int, rows: int = 1) -> Footprint:
    """Molex Micro-Fit, from the side; the cable leaves upwards. Pegs hold it: one, or two from four
    columns on."""
    wide = 3.0 * (columns - 1)
    tall, shape, side = (2.02, "oval", 3.325) if rows == 1 else (1.5, "circle", 3.575)
    pads = [Pad(str(columns * row + column + 1), 3.0 * column, 3.0 * row, 1.5, tall, 1.02,
                shape if row or column else "roundrect")
            for row in range(rows) for column in range(columns)]
    pads += [Pad("", wide / 2 + x, -4.32, 3, 3, 3, "circle", plated=False)
             for x in ((0.0,) if columns < 4 else (-2.35, 2.35))]
    body = (-side, -8.92, wide + side, 0.99)
    count, series = columns * rows, "43650" if rows == 1 else "43045"
    return Footprint(f"MICRO-FIT-{columns}" if rows == 1 else f"MICRO-FIT-{rows}x{columns}",
                     tuple(pads), (-side - 0.495, -9.42, wide + side + 0.495,
                                   1.48 if rows == 1 else 4.25), body, 6.2 if rows == 1 else 7.4,
                     f"Connector_Molex:Molex_Micro-Fit_3.0_{series}-{count:02}00_{rows}x"
                     f"{columns:02}_P3.00mm_Horizontal", kind="thru")


def hole(drill: float = 3.2) -> Footprint:
    """For an M3 screw; its head needs the room of the courtyard."""
    pad = Pad("", 0, 0, drill, drill, drill, "circle", plated=False)
    return Footprint("HOLE-M3", (pad,), centred(6.4, 6.4), centred(6, 6), 0.0, hole=drill,
                     kind="hole")


def lga14() -> Footprint:
    """ICM-42688-P: 14 lands around a body of 3 x 2.5 mm."""
    pads = [Pad(str(i + 1), -1.1625, 0.5 * i - 0.75, 0.625, 0.35) for i in range(4)]
    pads += [Pad(str(5 + i), 0.5 * i - 0.5, 0.9125, 0.35, 0.625) for i in range(3)]
    pads += [Pad(str(8 + i), 1.1625, 0.75 - 0.5 * i, 0.625, 0.35) for i in range(4)]
    pads += [Pad(str(12 + i), 0.5 - 0.5 * i, -0.9125, 0.35, 0.625) for i in range(3)]
    return Footprint("LGA-14", tuple(pads), (-1.75, -1.5, 1.75, 1.5), centred(3, 2.5), 0.9,
                     "Package_LGA:LGA-14_3x2.5mm_P0.5mm_LayoutBorder3x4y", escape=0.85)


def inductor() -> Footprint:
    return chip("L-6045", 2.075, 2.35, 5.1, centred(6, 6), "Inductor_SMD:L_Bourns_SRN6045TA", 4.5,
                "rect")


def sot23() -> Footprint:
    pads = (Pad("1", -0.9375, -0.95, 1.475, 0.6), Pad("2", -0.9375, 0.95, 1.475, 0.6),
            Pad("3", 0.9375, 0, 1.475, 0.6))
    return Footprint("SOT-23", pads, around(pads, centred(1.3, 2.9)), centred(1.3, 2.9), 1.1,
                     "Package_TO_SOT_SMD:SOT-23", turn=180)


def test_point() -> Footprint:
    pad = Pad("1", 0, 0, 1.5, 1.5, shape="circle", paste=False)
    return Footprint("TEST-POINT", (pad,), centred(2, 2), centred(1.5, 1.5), 0.0, kind="none")


ALL = {footprint.name: footprint for footprint in (
    chip("0603", 0.825, 0.8, 0.95, centred(1.6, 0.8), "Resistor_SMD:R_0603_1608Metric", 0.55),
    chip("0805", 0.9125, 1.025, 1.4, centred(2.0, 1.25), "Resistor_SMD:R_0805_2012Metric", 0.7),
    chip("1206", 1.4625, 1.125, 1.75, centred(3.2, 1.6), "Resistor_SMD:R_1206_3216Metric", 0.9),
    chip("1210", 1.475, 1.15, 2.7, centred(3.2, 2.5), "Capacitor_SMD:C_1210_3225Metric", 2.5),
    chip("1812", 2.1375, 1.125, 3.4, centred(4.5, 3.2), "Fuse:Fuse_1812_4532Metric", 1.2),
    chip("LED-0603", 0.7875, 0.875, 0.95, centred(1.6, 0.8), "LED_SMD:LED_0603_1608Metric", 0.8,
         turn=180),
    chip("SOD-323", 1.05, 0.6, 0.45, centred(1.7, 1.25), "Diode_SMD:D_SOD-323", 1.0, "rect"),
    chip("SOD-123", 1.65, 0.9, 1.2, centred(2.8, 1.8), "Diode_SMD:D_SOD-123", 1.2, "rect"),
    chip("SMA", 2.0, 2.5, 1.8, centred(4.3, 2.6), "Diode_SMD:D_SMA", 2.3, "rect"),
    chip("SMB", 2.15, 2.5, 2.3, centred(4.6, 3.9), "Diode_SMD:D_SMB", 2.4, "rect"),
    two_rows("SOT-23-5", 3, 1.1375, 0.95, 1.325, 0.6, centred(1.6, 2.9),
             "Package_TO_SOT_SMD:SOT-23-5", 1.2, right=2, turn=180),
    two_rows("SOT-23-6", 3, 1.1375, 0.95, 1.325, 0.6, centred(1.6, 2.9),
             "Package_TO_SOT_SMD:SOT-23-6", 1.2, turn=180),
    two_rows("SSOP-8", 4, 1.7, 0.65, 1.6, 0.3, centred(2.8, 2.95),
             "Package_SO:SSOP-8_2.95x2.8mm_P0.65mm", 1.3, shape="rect", turn=-90),
    two_rows("SOIC-8", 4, 2.475, 1.27, 1.95, 0.6, centred(3.9, 4.9),
             "Package_SO:SOIC-8_3.9x4.9mm_P1.27mm", 1.75, turn=-90),
    two_rows("SOIC-14", 7, 2.475, 1.27, 1.95, 0.6, centred(3.9, 8.7),
             "Package_SO:SOIC-14_3.9x8.7mm_P1.27mm", 1.75, turn=-90),
    two_rows("SOIC-16", 8, 2.475, 1.27, 1.95, 0.6, centred(3.9, 9.9),
             "Package_SO:SOIC-16_3.9x9.9mm_P1.27mm", 1.75, turn=-90),
    ribbon(8), sot23(), htssop16(), lga14(), inductor(), micro_fit(2), micro_fit(4),
    micro_fit(4, 2), pico(), hole(),
    level_header(),
    test_point(), *(gh(count) for count in (2, 3, 4, 5, 6, 7, 9, 10)),
    header(1, 2), header(2, 1), header(3, 1), header(2, 2), header(3, 2), header(8, 2))}
