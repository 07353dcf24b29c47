# SPDX-License-Identifier: BSD-3-Clause
"""Parts that can be ordered, with the figures of their data sheets that the checks use.

Figures of logic: `vih`/`vil` as a share of the supply (or `vih3` in V at 3.0 to 3.6 V), `vtp`/`vtm`
thresholds of Schmitt inputs by supply, `voh`/`vol` at `ma`, `delay` the longest in ns. Prices are a
class for tens, not an offer.
"""
from __future__ import annotations

from model import Component, Pin


def pins(text: str, ioff: bool = False) -> tuple[Pin, ...]:
    """`number name kind [supply]`, separated by commas."""
    kinds = {"pi": "power_in", "po": "power_out", "in": "input", "out": "output",
             "oc": "open_collector", "bi": "bidirectional", "pas": "passive", "nc": "nc"}
    found = []
    for row in text.split(","):
        number, name, kind, *supply = row.split()
        found.append(Pin(number, name, kinds[kind], supply[0] if supply else "", ioff))
    return tuple(found)


TWO = pins("1 1 pas, 2 2 pas")
POLAR = pins("1 K pas, 2 A pas")


def resistor(ohm: str, size: str = "0603") -> Component:
    code = {"0603": "RC0603FR-07", "0805": "RC0805FR-07", "1206": "RC1206FR-07"}[size]
    watts = {"0603": 0.1, "0805": 0.125, "1206": 0.25}[size]
    return Component(ohm, size, TWO, f"{code}{ohm.upper()}L",
                     "Yageo", "Yageo RC_L series data sheet, 1 %",
                     ("any thick film, 1 %, same size and power",), 0.01, "resistor",
                     (("ohm", ohms(ohm)), ("watts", watts)), "resistor")


def ohms(text: str) -> float:
    for letter, factor in (("R", 1.0), ("k", 1e3), ("M", 1e6)):
        if letter in text:
            whole, part = text.split(letter)
            return float(f"{whole}.{part or 0}") * factor
    raise ValueError(text)


def capacitor(value: str, mpn: str, farad: float, volts: float, size: str = "0603",
              usd: float = 0.02) -> Component:
    maker = "Samsung" if mpn.startswith("CL") else "Murata"
    return Component(value, size, TWO, mpn, maker, f"{maker} {mpn}",
                     ("any X7R or X5R of the same value, voltage and size",), usd, "capacitor",
                     (("farad", farad), ("volts", volts)), "capacitor")


C100N = capacitor("100n 50V", "CL10B104KB8NNNC", 100e-9, 50)
C1U = capacitor("1u 25V", "CL10A105KA8NNNC", 1e-6, 25)
C22N = capacitor("22n 50V", "CL10B223KB8NNNC", 22e-9, 50)
C10U_50 = capacitor("10u 50V", "GRM32ER71H106KA12L", 10e-6, 50, "1210", 0.25)
C22U = capacitor("22u 16V", "CL31A226KOHNNNE", 22e-6, 16, "1206", 0.08)
C10U = capacitor("10u 16V", "CL21A106KOQNNNE", 10e-6, 16, "0805", 0.03)

LVC = "±24 mA at 3 V; inputs 5.5 V; IOFF"
T45 = Component(
    "74LVC1T45", "SOT-23-6",
    pins("1 VCCA pi, 2 GND pi, 3 A bi VCCA, 4 B bi VCCB, 5 DIR in VCCA, 6 VCCB pi", True),
    "SN74LVC1T45DBVR", "Texas Instruments",
    "TI SCES515, Nexperia 74LVC1T45 rev. 7: ports 1.2 to 5.5 V, IOFF, outputs off while either "
    "supply is 0 V",
    ("74LVC1T45GW,125 has another body; same pins only as DBV: SN74LVC1T45DBVT",), 0.20, "t45",
    (("ma", 24), ("most_v", 5.5), ("supply_ma", 0.1)))
T45_2 = Component(
    "74LVC2T45", "SSOP-8",
    pins("1 VCCA pi, 2 A1 bi VCCA, 3 A2 bi VCCA, 4 GND pi, 5 DIR in VCCA, 6 B2 bi VCCB, "
         "7 B1 bi VCCB, 8 VCCB pi", True),
    "SN74LVC2T45DCTR", "Texas Instruments", "TI SCES516: as the 74LVC1T45, two bits",
    ("74LVC2T45DC has another body; SN74LVC2T45DCTT",), 0.35, "t45",
    (("ma", 24), ("most_v", 5.5), ("supply_ma", 0.1)))
SCHMITT = Component(
    "74LVC1G17", "SOT-23-5", pins("1 NC nc, 2 A in VCC, 3 GND pi, 4 Y out VCC, 5 VCC pi", True),
    "SN74LVC1G17DBVR", "Texas Instruments",
    "Nexperia 74LVC1G17 rev. 12; thresholds of the family: NXP 74LVC3G17 rev. 6, table 11",
    ("74LVC1G17GV,125 (Nexperia)",), 0.08, "schmitt",
    (("ma", 24), ("most_v", 5.5), ("supply_ma", 0.1)))
SCHMITT2 = Component(
    "74LVC2G17", "SOT-23-6",
    pins("1 1A in VCC, 2 GND pi, 3 2A in VCC, 4 2Y out VCC, 5 VCC pi, 6 1Y out VCC", True),
    "SN74LVC2G17DBVR", "Texas Instruments",
    "TI SCES381; thresholds of the family: NXP 74LVC3G17 rev. 6, table 11",
    ("74LVC2G17GV,125 (Nexperia)",), 0.15, "schmitt",
    (("ma", 24), ("most_v", 5.5), ("supply_ma", 0.1)))
XOR2 = Component(
    "74LVC2G86", "SSOP-8",
    pins("1 1A in VCC, 2 1B in VCC, 3 2Y out VCC, 4 GND pi, 5 2A in VCC, 6 2B in VCC, "
         "7 1Y out VCC, 8 VCC pi", True),
    "SN74LVC2G86DCTR", "Texas Instruments", "TI SCES360", ("SN74LVC2G86DCTT",), 0.30, "lvc",
    (("ma", 24), ("most_v", 5.5), ("supply_ma", 0.1)))
XOR = Component(
    "74LVC1G86", "SOT-23-5", pins("1 A in VCC, 2 B in VCC, 3 GND pi, 4 Y out VCC, 5 VCC pi", True),
    "SN74LVC1G86DBVR", "Texas Instruments", "TI SCES222", ("74LVC1G86GV,125 (Nexperia)",), 0.10,
    "lvc", (("ma", 24), ("most_v", 5.5), ("supply_ma", 0.1)))
ISOLATOR = Component(
    "ISO7721F", "SOIC-8",
    pins("1 VCC1 pi, 2 OUTA out VCC1, 3 INB in VCC1, 4 GND1 pi, 5 GND2 pi, 6 OUTB out VCC2, "
         "7 INA in VCC2, 8 VCC2 pi"),
    "ISO7721FDR", "Texas Instruments",
    "TI SLLSEP4: 11 ns typ., 16 at most, 2.25 to 5.5 V, 1.7 mA a channel; 3 kV, 4 mm; F: outputs "
    "are low while the other side has no supply (without F and the ADuM1201: high, which triggers)",
    ("ISO6721FBDR",), 1.20, "isolator",
    (("ma", 4), ("most_v", 5.5), ("supply_ma", 2.8), ("fails_low", 1)))
EFUSE = Component(
    "TPS26600", "HTSSOP-16",
    pins("1 IN pi, 2 IN pi, 3 UVLO in, 4 NC nc, 5 OVP in, 6 MODE in, 7 SHDN in, 8 RTN pas, "
         "9 GND pi, 10 IMON pas, 11 ILIM pas, 12 dVdT pas, 13 NC nc, 14 FLT oc, 15 OUT po, "
         "16 OUT po, 17 EP pas"),
    "TPS26600PWPR", "Texas Instruments",
    "TI SLVSDG2: 4.2 to 55 V, -60 V reverse, OVP and UVLO at 1.19 V, R(ILIM) = 12 V / I, 150 mOhm",
    (), 1.90, "efuse", (("most_v", 60.0), ("amps", 2.0), ("ohm", 0.25)))
BUCK = Component(
    "AP63205", "SOT-23-6", pins("1 FB in, 2 EN in, 3 VIN pi, 4 GND pi, 5 SW po, 6 BST pas"),
    "AP63205WU-7", "Diodes", "Diodes AP63205: 3.8 to 32 V, 5.0 V, 2 A, 1.1 MHz",
    ("AP63205QWU-7",), 0.55, "buck", (("most_v", 32.0), ("amps", 2.0)))
LDO18 = Component(
    "AP2112K-1.8", "SOT-23-5", pins("1 VIN pi, 2 GND pi, 3 EN in, 4 NC nc, 5 VOUT po"),
    "AP2112K-1.8TRG1", "Diodes", "Diodes AP2112: 2.5 to 6 V, 600 mA, 1.8 V ±1.5 %",
    ("TLV70218DBVR (300 mA, same pins)",), 0.12, "ldo", (("most_v", 6.0), ("amps", 0.6)))
TVS = Component(
    "SMBJ33CA", "SMB", pins("1 1 pas, 2 2 pas"), "SMBJ33CA", "Littelfuse",
    "Littelfuse SMBJ: 33 V stand-off, 36.7 V breakdown, 53.3 V at 11.3 A, both ways",
    ("SMBJ33CA-13-F (Diodes)", "SMBJ33CA-E3/52 (Vishay)"), 0.15, "tvs",
    (("standoff", 33.0), ("clamps", 53.3)), "tvs")
ESD24 = Component(
    "NUP2105L", "SOT-23", pins("1 IO1 pas, 2 IO2 pas, 3 GND pas"), "NUP2105LT1G", "onsemi",
    "onsemi NUP2105L: two lines, 24 V stand-off both ways, 26.2 V breakdown, 30 pF, 30 kV contact",
    ("PESD1CAN,215 (Nexperia)", "SM24CANB-02HTG (Littelfuse)"), 0.12, "esd",
    (("standoff", 24.0), ("farad", 30e-12)), "esd")
ESD32 = Component(
    "NUP3105L", "SOT-23", pins("1 IO1 pas, 2 IO2 pas, 3 GND pas"), "NUP3105LT1G", "onsemi",
    "onsemi NUP3105L: two lines, 32 V stand-off both ways, 35.6 V breakdown, 30 pF, 30 kV contact",
    ("SM36-02HTG (Littelfuse)",), 0.20, "esd", (("standoff", 32.0), ("farad", 30e-12)), "esd")
ESD5 = Component(
    "SRV05-4", "SOT-23-6", pins("1 IO1 pas, 2 GND pas, 3 IO2 pas, 4 IO3 pas, 5 VP nc, 6 IO4 pas"),
    "SRV05-4.TCT", "Semtech",
    "Semtech SRV05-4: four lines, 5 V stand-off, 3 pF, 15 kV; pin 5 open, "
    "so that no line feeds the supply", ("TPD4E001DBVR (Texas Instruments)",), 0.15, "esd",
    (("standoff", 5.0), ("farad", 3e-12)))
CLAMP = Component(
    "BAV99", "SOT-23", pins("1 A pas, 2 K pas, 3 AK pas"), "BAV99,215", "Nexperia",
    "Nexperia BAV99: 100 V, 215 mA, 0.86 V at 10 mA, 1.5 pF; pin 3 is between the diodes",
    ("BAV99LT1G (onsemi)", "BAV99-7-F (Diodes)"), 0.02, "clamp",
    (("volts", 100.0), ("drop", 0.86), ("farad", 1.5e-12)), "dual_diode")
SCHOTTKY = Component(
    "BAT54WS", "SOD-323", POLAR, "BAT54WS-7-F", "Diodes",
    "Diodes BAT54WS: 30 V, 100 mA, 0.32 V at 1 mA, 2 uA", ("BAT54WS-E3-08 (Vishay)",), 0.04,
    "diode", (("volts", 30.0), ("drop", 0.32)), "diode")
POWER_DIODE = Component(
    "B5819W", "SOD-123", POLAR, "B5819W-TP", "MCC", "MCC B5819W: 40 V, 1 A, 0.45 V at 0.5 A",
    ("B5819W (CJ)",), 0.05, "diode", (("volts", 40.0), ("drop", 0.45)), "diode")
ZENER_CLAMP = Component(
    "1SMA5918B", "SMA", POLAR, "1SMA5918BT3G", "onsemi",
    "onsemi 1SMA5918B: 5.1 V ±5 % at 73 mA, 1.5 W", ("SZ1SMA5918BT3G", "BZG05C5V1 (Vishay)"), 0.15,
    "zener", (("volts", 5.36),), "zener")
ZENER = Component(
    "BZX84-C5V1", "SOT-23", pins("1 A pas, 2 NC nc, 3 K pas"), "BZX84-C5V1,215", "Nexperia",
    "Nexperia BZX84: 4.8 to 5.4 V at 5 mA, 250 mW", ("BZX84C5V1LT1G (onsemi)",), 0.03, "zener",
    (("volts", 5.4),), "zener3")
NPN = Component(
    "MMBT3904", "SOT-23", pins("1 B in, 2 E pas, 3 C oc"), "MMBT3904LT1G", "onsemi",
    "onsemi MMBT3904: 40 V, 200 mA, storage time 200 ns", ("MMBT3904,215 (Nexperia)",), 0.02,
    "npn", (("volts", 40.0),), "npn")
PNP = Component(
    "MMBT2907A", "SOT-23", pins("1 B in, 2 E pas, 3 C oc"), "MMBT2907ALT1G", "onsemi",
    "onsemi MMBT2907A: 60 V, 600 mA, storage time 80 ns", ("PMBT2907A,215 (Nexperia)",), 0.03,
    "pnp", (("volts", 60.0),), "pnp")
MOSFET = Component(
    "SI2308", "SOT-23", pins("1 G in, 2 S pas, 3 D oc"), "SI2308BDS-T1-GE3", "Vishay",
    "Vishay Si2308BDS: 60 V, 1.9 A, 0.19 Ohm at 4.5 V, gate threshold 1 to 3 V",
    ("DMN6140L-7 (Diodes)",), 0.20, "nmos", (("volts", 60.0), ("amps", 1.9)), "nmos")
PTC500 = Component(
    "PTC 0.5A 15V", "1812", TWO, "MF-MSMF050-2", "Bourns",
    "Bourns MF-MSMF: hold 0.50 A, trip 1.00 A, 15 V", ("1812L050PR (Littelfuse)",),
    0.20, "fuse", (("amps", 0.5), ("volts", 15.0)), "fuse")
PTC300 = Component(
    "PTC 0.3A 30V", "1812", TWO, "MF-MSMF030-2", "Bourns",
    "Bourns MF-MSMF: hold 0.30 A, trip 0.60 A, 30 V", ("1812L035/30 (Littelfuse)",), 0.20, "fuse",
    (("amps", 0.3), ("volts", 30.0)), "fuse")
INDUCTOR = Component(
    "6.8uH", "L-6045", TWO, "SRN6045TA-6R8M", "Bourns", "Bourns SRN6045TA: 6.8 uH, semi-shielded",
    ("SWPA6045S6R8MT (Sunlord)",), 0.25, "inductor", (("amps", 3.0),), "inductor")
IMU = Component(
    "ICM-42688-P", "LGA-14",
    pins("1 SDO out VDDIO, 2 RESV nc, 3 RESV nc, 4 INT1 out VDDIO, 5 VDDIO pi, 6 GND pi, "
         "7 RESV nc, 8 VDD pi, 9 INT2 pas, 10 RESV nc, 11 RESV nc, 12 CS in VDDIO, "
         "13 SCLK in VDDIO, 14 SDI in VDDIO"),
    "ICM-42688-P", "TDK InvenSense", "TDK DS-000347", (), 3.50, "imu",
    (("ma", 4), ("most_v", 3.6), ("supply_ma", 1.0)))


def led(colour: str, mpn: str) -> Component:
    return Component(f"LED {colour}", "LED-0603", POLAR, mpn, "Lite-On", f"Lite-On {mpn}",
                     ("any LED of this colour, 0603",), 0.03, "led", (("drop", 1.8),), "led")


GREEN, RED = led("green", "LTST-C191KGKT"), led("red", "LTST-C191KRKT")
YELLOW = led("yellow", "LTST-C191KSKT")


def gh(count: int) -> Component:
    numbers = ", ".join(f"{i} {i} pas" for i in range(1, count + 1))
    return Component(f"GH {count}", f"JST-GH-{count}", pins(numbers + ", MP MP pas"),
                     f"SM{count:02}B-GHS-TB(LF)(SN)", "JST",
                     "JST GH series: 1.25 mm, locks, 1 A a contact, 50 V", (), 0.15 + 0.04 * count,
                     "connector", (("amps", 1.0),), "connector",
                     (f"GHR-{count:02}V-S", "SSHL-002T-P0.2"))


def jumper(columns: int, rows: int = 1) -> Component:
    numbers = ", ".join(f"{i} {i} pas" for i in range(1, columns * rows + 1))
    return Component(f"header {columns}x{rows}", f"HEADER-{columns}x{rows}", pins(numbers),
                     f"61300{columns}{rows}1121" if rows == 1 else "pin header 2.54 mm",
                     "Würth" if rows == 1 else "any", "pin header 2.54 mm",
                     ("any pin header 2.54 mm",), 0.02 * columns * rows, "jumper", (), "connector")


LEVEL = Component("level jumper", "HEADER-LEVEL", pins("1 1 pas, 2 2 pas, 3 3 pas, 4 4 pas"),
                  "pin header 2.54 mm", "any", "pin header 2.54 mm: 1x3 and 1x1",
                  ("any pin header 2.54 mm",), 0.08, "jumper", (), "connector")
SHUNT = Component("shunt 2.54 mm", "", (), "60900213421", "Würth", "shunt 2.54 mm",
                  ("any shunt 2.54 mm",), 0.03)


def micro_fit(columns: int, rows: int = 1) -> Component:
    count = columns * rows
    series, housing = ("43650", "43645") if rows == 1 else ("43045", "43025")
    name = f"{columns}" if rows == 1 else f"{rows}x{columns}"
    numbers = ", ".join(f"{i} {i} pas" for i in range(1, count + 1))
    return Component(f"Micro-Fit {name}", f"MICRO-FIT-{name}", pins(numbers),
                     f"{series}-{count:02}00", "Molex", f"Molex PS-{series}: 3 mm, locks, 5 A at "
                     "most, fewer with more circuits and thinner wire", (f"{series}{count:02}00",),
                     0.40 + 0.10 * count, "connector", (("amps", 5.0),), "connector",
                     (f"{housing}-{count:02}00", "43030-0007"))


HOLE = Component("M3", "HOLE-M3", (), "", "", "", (), 0.0, "hole", (), "none")
TEST_POINT = Component("test point", "TEST-POINT", pins("1 1 pas"), "", "", "", (), 0.0,
                       "test_point", (), "connector")


def pico() -> Component:
    """Pins of the data sheet's figure; GPIO by pin as in tests/system/pin_map."""
    gpios = dict(zip([1, 2, 4, 5, 6, 7, 9, 10, 11, 12, 14, 15, 16, 17, 19, 20, 21, 22, 24, 25, 26,
                      27, 29, 31, 32, 34], [*range(0, 23), 26, 27, 28]))
    special = {30: "RUN in", 33: "AGND pi", 35: "ADC_VREF nc", 36: "3V3 po", 37: "3V3_EN nc",
               39: "VSYS pi", 40: "VBUS po"}
    rows = []
    for number in range(1, 41):
        if number in gpios:
            rows.append(f"{number} GP{gpios[number]} bi 3V3")
        else:
            rows.append(f"{number} {special.get(number, 'GND pi')}")
    return Component("Raspberry Pi Pico", "RASPBERRY-PI-PICO", pins(", ".join(rows)), "SC0915",
                     "Raspberry Pi", "Raspberry Pi Pico and RP2040 data sheets: inputs 3.6 V, "
                     "high from 2.0 V, low to 0.8 V",
                     ("SC0917 (Pico H)", "SC0918 (Pico W)"), 4.00, "pico",
                     (("ma", 4), ("most_v", 3.6)))


PICO = pico()
COUNTER = Component(
    "74HC4024", "SOIC-14",
    pins("1 CP in VCC, 2 MR in VCC, 3 Q6 out VCC, 4 Q5 out VCC, 5 Q4 out VCC, 6 Q3 out VCC, "
         "7 GND pi, 8 NC nc, 9 Q2 out VCC, 10 NC nc, 11 Q1 out VCC, 12 Q0 out VCC, 13 NC nc, "
         "14 VCC pi"),
    "74HC4024D,653", "Nexperia", "Nexperia 74HC4024: counts at the falling edge, 5.2 mA",
    ("MC74HC4024ADG",), 0.30, "hc", (("ma", 4), ("most_v", 6.0), ("supply_ma", 1.0)))
DECODER = Component(
    "74HC139", "SOIC-16",
    pins("1 1E in VCC, 2 1A0 in VCC, 3 1A1 in VCC, 4 1Y0 out VCC, 5 1Y1 out VCC, 6 1Y2 out VCC, "
         "7 1Y3 out VCC, 8 GND pi, 9 2Y3 out VCC, 10 2Y2 out VCC, 11 2Y1 out VCC, 12 2Y0 out VCC, "
         "13 2A1 in VCC, 14 2A0 in VCC, 15 2E in VCC, 16 VCC pi"),
    "74HC139D,653", "Nexperia", "Nexperia 74HC139: low at the chosen output, 5.2 mA",
    ("SN74HC139DR",), 0.25, "hc", (("ma", 4), ("most_v", 6.0), ("supply_ma", 1.0)))
INVERTER = Component(
    "74LVC1G14", "SOT-23-5", pins("1 NC nc, 2 A in VCC, 3 GND pi, 4 Y out VCC, 5 VCC pi", True),
    "SN74LVC1G14DBVR", "Texas Instruments", "TI SCES218", ("74LVC1G14GV,125 (Nexperia)",), 0.08,
    "schmitt", (("ma", 24), ("most_v", 5.5), ("supply_ma", 0.1)))
RIBBON = Component("ribbon 2x8", "RIBBON-2x8",
                   pins(", ".join(f"{i} {i} pas" for i in range(1, 17))), "header 2x8, 2.00 mm",
                   "any", "box header or pin header, 2.00 mm, 2x8: for a 16-pin ribbon cable of "
                   "2.00 mm IDC, as Samtec TCSD", ("any header 2x8, 2.00 mm",), 0.80, "connector",
                   (), "connector")
