# SPDX-License-Identifier: BSD-3-Clause
"""Simulates the circuits whose levels and delays no rule of thumb gives, with ngspice.

Parts are as their data sheets bound them: an output is a source and a resistor that gives the
stated volts at the stated current; a threshold is its limit, not its usual value. Values of
resistors and capacitors come from the board's description.
"""
from __future__ import annotations

import dataclasses
import re
import subprocess
import tempfile

import cables
import checks
from carrier import carrier
from model import Board

MODELS = """
.model schottky D(IS=2e-7 N=1.04 RS=3 CJO=10p BV=30)
.model clamp D(IS=2.5e-9 N=1.75 RS=1 CJO=1.5p BV=100)
.model z51 D(IS=1e-14 BV=5.1 IBV=73m RS=1 CJO=400p)
.model z51small D(IS=1e-14 BV=5.1 IBV=5m RS=20 CJO=200p)
.model tvs D(IS=1e-12 BV=36.7 IBV=1m RS=1.2 CJO=1n)
.model npn NPN(IS=7e-15 BF=150 CJC=4p CJE=8p TF=0.4n TR=200n)
.model pnp PNP(IS=1e-14 BF=100 CJC=8p CJE=20p TF=0.6n TR=80n)
.model efuse SW(VT=1.5 VH=0.05 RON=0.25 ROFF=1e9)
.model gate SW(VT=1.25 VH=0.05 RON=8 ROFF=1e9)
"""
CABLE = "T{name} {a} 0 {b} 0 Z0=100 TD=25n"  # 5 m


@dataclasses.dataclass(frozen=True)
class Limit:
    measure: str
    low: float
    high: float
    about: str


@dataclasses.dataclass(frozen=True)
class Case:
    name: str
    netlist: str
    limits: tuple[Limit, ...]


def ohm(board: Board, ref: str) -> float:
    return board.parts[ref].component.figure("ohm")


def farad(board: Board, ref: str) -> float:
    return board.parts[ref].component.figure("farad")


def trigger_case(board: Board, row: cables.Cable) -> Case:
    """A 74LVC1T45 at its weakest into the input, which takes all the current it may."""
    volts, _, inside = cables.RAILS[row.level]
    load = max(row.draws_ma, 0.01)
    netlist = f"""
V1 source 0 PULSE(0 {volts} 1u 2n 2n 200u 1m)
R1 source driver {inside}
R2 driver connector {ohm(board, 'R200')}
C1 connector 0 40p
{CABLE.format(name=1, a='connector', b='camera')}
B1 camera 0 I=V(camera)>0.8 ? {load}m*min(1,(V(camera)-0.8)/0.6) : 0
C2 camera 0 50p
.tran 5n 20u
.meas tran level FIND V(camera) AT=15u
.meas tran late WHEN V(camera)={row.high_v} RISE=1
"""
    return Case(f"trigger of {row.name} at {row.level}", netlist, (
        Limit("level", row.high_v, row.highest_v, "V at the camera"),
        Limit("late", 1e-6, 1.4e-6, "s until it is high")))


def exposure_case(board: Board, level: str) -> Case:
    """An open drain that sinks 25 mA, 5 m of cable, pull-up through the diode."""
    volts, _, _ = cables.RAILS[level]
    high, low = checks.between(checks.SCHMITT_HIGH, volts), checks.between(checks.SCHMITT_LOW,
                                                                           volts)
    netlist = f"""
V1 level 0 {volts}
D1 level pull schottky
R1 pull connector {ohm(board, 'R205')}
C1 connector 0 40p
{CABLE.format(name=1, a='connector', b='camera')}
V2 gate 0 PULSE(2.5 0 5u 5n 5n 30u 1m)
S1 camera 0 gate 0 gate
C2 camera 0 50p
R2 connector in {ohm(board, 'R203')}
R3 in 0 {ohm(board, 'R207')}
C3 in 0 10p
D2 0 in clamp
D3 in rail clamp
D4 0 rail z51
R4 bias rail 10k
V4 bias 0 3.9
.tran 5n 70u
.meas tran top FIND V(in) AT=30u
.meas tran bottom FIND V(in) AT=60u
.meas tran up WHEN V(in)={high} RISE=1
.meas tran down WHEN V(in)={low} FALL=LAST
"""
    return Case(f"exposure input at {level}, open drain, 5 m", netlist, (
        Limit("top", high, volts + 0.1, "V when high"), Limit("bottom", -0.3, low, "V when low"),
        Limit("up", 5e-6, 11e-6 if level == "1.8 V" else 7e-6,
              "s of the rising edge, sent at 5 us"),
        Limit("down", 35e-6, 35.6e-6, "s of the falling edge, sent at 35 us")))


def strobe_case(board: Board) -> Case:
    high = checks.between(checks.SCHMITT_HIGH, 1.8)
    netlist = f"""
V1 source 0 PULSE(0 1.71 1u 5n 5n 20u 1m)
R1 source camera 100
{CABLE.format(name=1, a='camera', b='connector')}
C1 connector 0 40p
R2 connector in {ohm(board, 'R203')}
R3 in 0 {ohm(board, 'R207')}
C3 in 0 20p
.tran 5n 20u
.meas tran top FIND V(in) AT=15u
.meas tran up WHEN V(in)={high} RISE=1
"""
    return Case("strobe of 1.8 V at the level 1.8 V", netlist, (
        Limit("top", high, 2.0, "V when high"), Limit("up", 1e-6, 2e-6, "s of the edge")))


def miswired_case(board: Board) -> Case:
    """24 V, for long, at an exposure input."""
    netlist = f"""
V1 connector 0 24
R1 connector in {ohm(board, 'R203')}
R3 in 0 {ohm(board, 'R207')}
D1 0 in clamp
D2 in rail clamp
D3 0 rail z51
.op
.tran 1u 100u
.meas tran node FIND V(in) AT=90u
.meas tran watts FIND par('(V(connector)-V(in))*(V(connector)-V(in))/{ohm(board, 'R203')}') AT=90u
"""
    return Case("24 V at an exposure input", netlist, (
        Limit("node", 4.8, 6.5, "V at the buffer, which bears 6.5"),
        Limit("watts", 0, board.parts["R203"].component.figure("watts"), "W in the resistor")))


def camera_first_case(board: Board, diode: bool = True) -> Case:
    """The camera has power, the board none: what arrives at the rails of the board."""
    way = "D1 level pull schottky" if diode else "R9 level pull 0.01"
    netlist = f"""
V1 camera 0 3.6
{way}
R1 pull camera {ohm(board, 'R205')}
R2 camera in {ohm(board, 'R203')}
D2 in rail clamp
D3 0 rail z51
R3 in 0 {ohm(board, 'R207')}
I1 camera level 10u
R4 level 0 1k
.tran 1u 1m
.meas tran fed FIND V(level) AT=0.9m
"""
    return Case("camera powered first", netlist, (
        Limit("fed", -0.1, 0.1, "V at the rail of a board without supply, with 1 k"),))


def supply_case(volts: float, inside: float, name: str, high: float, low: float) -> Case:
    """The eFuse as its data sheet says: off below 0 V and above 30.8 V, 5 us late."""
    netlist = f"""
V1 source 0 PULSE(12 {volts} 1m 5m 50m 100m 300m)
R1 source vin {inside}
D1 x vin tvs
D2 x 0 tvs
B1 on 0 V=3*u(V(vin)-6.6)*u(30.8-V(vin))
R2 on slow 1k
C1 slow 0 5n
S1 vin vout slow 0 efuse
C2 vout 0 10u
R3 vout 0 12
.tran 20u 200m
.meas tran most MAX V(vout)
.meas tran least MIN V(vout)
"""
    return Case(name, netlist, (
        Limit("most", 0, high, "V behind the eFuse at most, the converter bears 32"),
        Limit("least", low, 12, "V behind the eFuse at least")))


def light_case(board: Board, threshold: float) -> Case:
    """The firmware hangs with the light on."""
    netlist = f"""
V1 light 0 PULSE(0 3.3 1m 10n 10n 100m 300m)
R1 light pin {50 + ohm(board, 'R765')}
C1 pin timed {farad(board, 'C761')}
R2 timed 0 {ohm(board, 'R760')}
D1 0 timed schottky
.tran 10u 60m
.meas tran off WHEN V(timed)={threshold} FALL=1
"""
    return Case(f"light that stays on, threshold {threshold:g} V", netlist, (
        Limit("off", 1e-3 + 5e-3, 1e-3 + 20e-3, "s until the light goes off, on at 1 ms"),))


def isolated_case(board: Board, volts: float) -> Case:
    """From the isolator's output to 24 V and back."""
    netlist = f"""
V1 supply 0 {volts}
V2 drive 0 PULSE(0 4.6 5u 5n 5n 50u 1m)
R1 drive base {ohm(board, 'R1201')}
Q1 sink base 0 npn
R2 sink gate {ohm(board, 'R1202')}
R3 supply gate {ohm(board, 'R1203')}
Q2 out gate supply pnp
R4 out 0 {ohm(board, 'R1204')}
C1 out 0 60p
R5 out load {(volts - 2) / 0.008:.0f}
D1 load 0 z51small
.tran 10n 110u
.meas tran level FIND V(out) AT=40u
.meas tran on WHEN V(out)=12 RISE=1
.meas tran off WHEN V(out)=12 FALL=1
"""
    return Case(f"isolated trigger at {volts:g} V", netlist, (
        Limit("level", volts - 1, volts, "V at the camera, which takes 8 mA"),
        Limit("on", 5e-6, 7e-6, "s of the rising edge, sent at 5 us"),
        Limit("off", 55e-6, 62e-6, "s of the falling edge, sent at 55 us")))


def cases(board: Board) -> list[Case]:
    found = [trigger_case(board, row) for row in cables.triggers()]
    found += [exposure_case(board, level) for level in ("1.8 V", "3.3 V", "5 V")]
    found += [strobe_case(board), miswired_case(board), camera_first_case(board),
              supply_case(-28.0, 1.0, "reversed polarity", 32, -0.5),
              supply_case(35.0, 1.0, "load dump of 35 V", 32, -0.5),
              light_case(board, 0.6), light_case(board, 1.5), isolated_case(board, 18.0),
              isolated_case(board, 24.0)]
    return found


def simulate(case: Case) -> dict[str, float]:
    with tempfile.NamedTemporaryFile("w", suffix=".cir") as file:
        file.write(f"* {case.name}\n{MODELS}{case.netlist}.end\n")
        file.flush()
        said = subprocess.run(["ngspice", "-b", file.name], capture_output=True, text=True,
                              check=False)
    return {name: float(value) for name, value in
            re.findall(r"^(\w+)\s+=\s+(\S+)", said.stdout, re.M) if value != "failed"}


def judge(case: Case) -> list[str]:
    found = simulate(case)
    faults = []
    for limit in case.limits:
        value = found.get(limit.measure)
        if value is None:
            faults.append(f"{case.name}: {limit.measure} ({limit.about}) was not reached")
        elif not limit.low <= value <= limit.high:
            faults.append(f"{case.name}: {value:.4g} {limit.about}, {limit.low:g} to "
                          f"{limit.high:g} are allowed")
    return faults


def run() -> list[str]:
    board = carrier()
    faults = []
    for case in cases(board):
        found = judge(case)
        faults += found
        values = ", ".join(f"{name} {value:.4g}" for name, value in simulate(case).items()
                           if name in {limit.measure for limit in case.limits})
        print(f"{'FAULT' if found else 'ok   '} {case.name}: {values}")
    if not judge(camera_first_case(board, diode=False)):
        faults.append("a pull-up without its diode is not noticed")
    if not judge(supply_case(60.0, 0.1, "load dump of 60 V", 20, -0.5)):
        faults.append("a load dump that goes through is not noticed")
    return faults
