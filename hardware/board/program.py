# SPDX-License-Identifier: BSD-3-Clause
"""The commands of hardware/make."""
from __future__ import annotations

import sys
import time

import cables
import checks
import documents
import kept
import layout_checks
import mistakes
import reread
from boards import BOARDS


def check(quick: bool) -> list[str]:
    faults = []
    for name in BOARDS:
        board, layout = kept.open_board(name)
        found = checks.circuit_faults(board) if name == "carrier" else checks.plain_faults(board)
        found += layout_checks.layout_faults(board, layout)
        found += kept.differences(board, layout)
        found += reread.faults(board, kept.files(board, layout))
        if name == "carrier" and not quick:
            found += mistakes.unnoticed(board, layout)
        faults += [f"{name}: {fault}" for fault in found]
    faults += [f"cables.json: {fault}" for fault in cables.faults(*cables.tables())]
    faults += documents.faults()
    return faults if quick else faults + mistakes.unnoticed_cables()


def files() -> list[str]:
    for name in BOARDS:
        kept.write(*kept.open_board(name))
    return []


def route(name: str) -> list[str]:
    import place_and_route
    place_and_route.run(name)
    return files()


def report(faults: list[str], what: str, begin: float) -> int:
    print("\n".join(faults) or f"hardware {what}: ok, {time.monotonic() - begin:.0f} s")
    return 1 if faults else 0


def main(words: list[str], usage: str) -> int:
    begin = time.monotonic()
    match words:
        case ["check"] | ["check", "--quick"]:
            return report(check(words[1:] == ["--quick"]), "check", begin)
        case ["files"]:
            return report(files(), "files", begin)
        case ["route", name] if name in BOARDS:
            return report(route(name), "route", begin)
        case ["kicad"] | ["kicad", "--write"]:
            import with_kicad
            return report(with_kicad.run(words[1:] == ["--write"]), "kicad", begin)
        case ["spice"]:
            import spice
            return report(spice.run(), "spice", begin)
    print(usage, file=sys.stderr)
    return 64
