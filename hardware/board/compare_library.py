# SPDX-License-Identifier: BSD-3-Clause
"""compare_library: pads of our footprints against those of KiCad's own library."""
from __future__ import annotations

import pathlib
import re
import sys

import footprints

LIBRARY = pathlib.Path("/usr/share/kicad/footprints")
PAD = re.compile(r'\(pad "?([^" ]*)"? (\w+) \w+ \(at ([-\d.]+) ([-\d.]+)(?: ([-\d.]+))?\) '
                 r'\(size ([\d.]+) ([\d.]+)\)')


def library_pads(name: str) -> list[tuple[str, float, float, float, float]]:
    library, footprint = name.split(":")
    text = (LIBRARY / f"{library}.pretty" / f"{footprint}.kicad_mod").read_text()
    found = []
    for number, _, x, y, turn, width, height in PAD.findall(text):
        size = (float(width), float(height))
        if turn in ("90", "270"):
            size = (size[1], size[0])
        if number:
            found.append((number, float(x), float(y), *size))
    return found


def faults() -> list[str]:
    wrong = []
    for mine in footprints.ALL.values():
        if not mine.library:
            continue
        theirs = library_pads(mine.library)
        for pad in (pad for pad in mine.pads if pad.number):
            near = [max(abs(pad.x - x), abs(pad.y - y), abs(pad.width - w), abs(pad.height - h))
                    for number, x, y, w, h in theirs if number == pad.number]
            if not near or min(near) > 0.3:
                wrong.append(f"{mine.name}: pad {pad.number} differs from {mine.library}: "
                             f"{min(near, default=9):.2f} mm")
    return wrong


if __name__ == "__main__":
    problems = faults()
    print("\n".join(problems) or f"ok, {sum(bool(f.library) for f in footprints.ALL.values())} "
          "footprints agree with KiCad's library")
    sys.exit(bool(problems))
