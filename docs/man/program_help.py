# SPDX-License-Identifier: BSD-3-Clause
"""What the programs say of themselves, for manual pages and shells."""

import re
import subprocess
import typing


class Help(typing.NamedTuple):
    """What a program or command says of itself."""
    text: str
    usage: str
    groups: dict  # of entries, as pairs of spelling and meaning


def help_of(programs, *command):
    said = subprocess.run([programs / command[0], *command[1:], "--help"], check=True, text=True,
                          stdout=subprocess.PIPE).stdout
    # A default below the build directory is none of an installation.
    said = re.sub(rf"={re.escape(str(programs.parent))}\S*", "", said)
    text, usage, groups, entries = [], "", {}, None
    for line in said.splitlines():
        if line.startswith("Usage: "):
            usage = line.split(command[0], 1)[1].strip()
        elif re.fullmatch(r"[A-Z]\w*:", line):
            entries = groups.setdefault(line[:-1].upper(), [])
        elif entries is None:
            text.append(line)
        elif line.startswith(" " * 20):
            entries[-1][1] = line.strip()
        elif line:
            # A spelling that leaves no room is followed by one blank.
            spelling, _, meaning = line[2:].partition("  " if "  " in line[2:] else "\0")
            if not meaning and len(line) > 30 and line[29] == " ":
                spelling, meaning = line[2:29], line[30:]
            entries.append([spelling.strip(), meaning.strip()])
    return Help(" ".join(text).strip(), re.sub(r"^(\w[\w ]*?) ?(?=\[)", "", usage), groups)
