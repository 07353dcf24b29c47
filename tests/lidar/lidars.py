# SPDX-License-Identifier: BSD-3-Clause
"""LiDARs that take the time from a pulse and a sentence, by their manuals (docs/user/lidar.md), and
a judge of what they made of it. Knows nothing of the firmware."""

import calendar
import re
from dataclasses import dataclass, field

import pynmea2

MS = 1_000_000
SECOND = 1_000 * MS


@dataclass(frozen=True)
class Manual:
    """What a LiDAR accepts; times in ns, of sentences after the pulse's rise."""
    name: str
    sentences: tuple
    width: tuple = (0, SECOND)
    begin: tuple = (0, SECOND)
    end: int = SECOND  # the sentence's, at the latest
    ends_after_pulse: bool = False
    pause: int = None  # at least, from the pulse's fall to the sentence
    period_tolerance: int = 500_000  # of two pulses


MANUALS = {manual.name: manual for manual in (
    # As strict as an HDL-32E.
    Manual("velodyne", ("GPRMC", "GPGGA"), width=(20 * MS, 200 * MS), begin=(0, 500 * MS),
           pause=50 * MS),
    Manual("ouster", ("GPRMC",)),
    Manual("livox", ("GPRMC",), width=(5 * MS, 900 * MS), begin=(0, 430 * MS)),
    Manual("hesai", ("GPRMC", "GPGGA"), width=(MS, SECOND), end=900 * MS, ends_after_pulse=True,
           period_tolerance=50_000),
    Manual("robosense", ("GPRMC",), width=(20 * MS, 200 * MS), end=500 * MS),
)}


def checksum(body):
    total = 0
    for letter in body:
        total ^= ord(letter)
    return f"{total:02X}"


def illegal(line):
    """Why NMEA 0183 does not allow this sentence; None: it does."""
    if len(line) > 82:
        return "longer than 82 characters"
    match = re.fullmatch(r"\$([A-Z0-9]{2})([A-Z]{3}),([\x20-\x7e]*)\*([0-9A-F]{2})\r\n", line)
    if not match:
        return "not $TTSSS,...*hh"
    talker, kind, fields, total = match.groups()
    if checksum(f"{talker}{kind},{fields}") != total:
        return "wrong checksum"
    try:
        parsed = pynmea2.parse(line.strip(), check=True)
    except pynmea2.ParseError as error:
        return f"pynmea2: {error}"
    count = {"RMC": 12, "GGA": 14, "ZDA": 6}.get(kind)
    if count is None or len(parsed.data) != count:
        return f"{len(parsed.data)} fields"
    return None


def time_of(line):
    """(kind, UTC in s since 1970) that a LiDAR reads; kind None: nothing it trusts. A GGA has the
    second of the day alone."""
    fields = line.split("*")[0].split(",")
    kind = fields[0][1:]
    if kind.endswith("RMC") and fields[2] == "A":
        clock, date = fields[1], fields[9]
        day = calendar.timegm((2000 + int(date[4:6]), int(date[2:4]), int(date[0:2]), 0, 0, 0))
    elif kind.endswith("GGA") and fields[6] != "0":
        clock, day = fields[1], 0
    elif kind.endswith("ZDA") and fields[1]:
        clock = fields[1]
        day = calendar.timegm((int(fields[4]), int(fields[3]), int(fields[2]), 0, 0, 0))
    else:
        return None, None
    assert clock.endswith(".00"), line
    return kind, day + int(clock[0:2]) * 3600 + int(clock[2:4]) * 60 + int(clock[4:6])


@dataclass
class Lidar:
    """Takes pulses and sentences in the order of time; `named` has what it believes: the begin of a
    pulse, and the second that it was."""
    manual: Manual
    named: list = field(default_factory=list)
    rise: int = None
    fall: int = None
    lock: bool = False
    longest_lock: int = 0
    locked_pulses: int = 0

    def pulse(self, rise, fall):
        period = None if self.rise is None else rise - self.rise
        steady = period is not None and abs(period - SECOND) <= self.manual.period_tolerance
        low, high = self.manual.width
        self.lock = steady and low <= fall - rise <= high
        self.locked_pulses = self.locked_pulses + 1 if self.lock else 0
        self.longest_lock = max(self.longest_lock, self.locked_pulses)
        self.rise, self.fall = rise, fall

    def sentence(self, begin, end, line):
        kind, utc = time_of(line)
        if kind not in self.manual.sentences or self.rise is None:
            return
        since = begin - self.rise
        low, high = self.manual.begin
        in_window = low <= since <= high and end - self.rise <= self.manual.end
        paused = self.manual.pause is None or begin - self.fall >= self.manual.pause
        if not in_window or not paused or (self.manual.ends_after_pulse and end < self.fall):
            return
        self.named.append((self.rise, kind, utc))


class Truth:
    """What the host's clock showed, and what the board knew of it."""

    def __init__(self):
        self.clocks = []  # (from, offset of the clock to true time)
        self.known = []  # (when it reached the board, offset that was right then); None: unknown

    def set_clock(self, at, utc):
        self.clocks.append((at, utc - at))

    def offset(self, at):
        return [offset for begin, offset in self.clocks if begin <= at][-1]

    def heard(self, at, known):
        self.known.append((at, self.offset(at) if known else None))

    def restart(self, at):
        self.known.append((at, None))

    def allowed(self, at, index):
        """Offsets by which a pulse at `at` may be named: the clock's, and that of the newest
        message before the pulse was decided. `index`: where the caller was in `known`."""
        while index + 1 < len(self.known) and self.known[index + 1][0] < at - 2 * MS:
            index += 1
        newest = self.known[index][1] if self.known else None
        return index, set() if newest is None else {newest, self.offset(at)}


def read_trace(lines):
    """Truth, pulses (rise, fall) and sentences (begin, end, text) of a trace."""
    truth, pulses, sent = Truth(), [], []
    active, rise = 1, None
    for line in lines:
        word, at, *rest = line.split()
        at = int(at)
        if word == "clock":
            truth.set_clock(at, int(rest[0]))
        elif word == "announced":
            truth.heard(at, True)
        elif word == "unknown":
            truth.heard(at, False)
        elif word == "restart":
            truth.restart(at)
            rise = None
        elif word == "level":
            if int(rest[0]) == active:
                rise = at
            elif rise is not None:
                pulses.append((rise, at))
                rise = None
        elif word == "bytes":
            sent.append((at, int(rest[0]), bytes.fromhex(rest[1]).decode("latin-1")))
    return truth, pulses, sent


def judge(name, truth, pulses, sent, delay=0, tolerance=100_000, holdover=30 * SECOND):
    """Faults, as lines, and the LiDAR with what it believed."""
    faults = []
    lidar = Lidar(MANUALS[name])
    restarts = {at for at, offset in truth.known if offset is None}
    for begin, end, line in sent:
        if not line.endswith("\r\n") and end in restarts:
            continue  # the chip was reset meanwhile
        reason = illegal(line)
        if reason:
            faults.append(f"{end}: illegal: {reason}: {line!r}")
    events = [(rise, 0, (rise, fall)) for rise, fall in pulses]
    events += [(begin, 1, (begin, end, line)) for begin, end, line in sent if line.endswith("\r\n")]
    for _, kind, values in sorted(events):
        (lidar.sentence if kind else lidar.pulse)(*values)
    index = 0
    for rise, _ in pulses:  # a LiDAR counts on by these alone
        index, allowed = truth.allowed(rise, index)
        if not any(abs((rise - delay + offset + SECOND // 2) % SECOND - SECOND // 2) <= tolerance
                   for offset in allowed):
            faults.append(f"{rise}: a pulse that is no second")
        if holdover is not None and rise - truth.known[index][0] > holdover + SECOND:
            faults.append(f"{rise}: a pulse after the holdover")
    index = 0
    for rise, kind, utc in lidar.named:
        index, allowed = truth.allowed(rise, index)
        span = 86_400 * SECOND if kind.endswith("GGA") else 1 << 63
        errors = [(rise - delay + offset - utc * SECOND + span // 2) % span - span // 2
                  for offset in allowed]
        if not any(abs(error) <= tolerance for error in errors):
            faults.append(f"{rise}: wrong: {kind} names {utc}, off by {errors} ns")
    return faults, lidar
