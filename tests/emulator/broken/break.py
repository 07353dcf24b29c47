#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Copies the sources of the port, with one fault put in.

usage: break.py FAULTS.json NAME SOURCE TARGET

FAULTS.json: {NAME: {"edits": [{"file", "text", "becomes"}...], ...}...}. Each text must be in its
file once, so that a fault does not go unnoticed when the sources change.
"""
import json
import pathlib
import sys


def edited(fault, source):
    """The contents of each file that the fault changes."""
    contents = {}
    for edit in fault["edits"]:
        name, text = edit["file"], edit["text"]
        before = contents.get(name) or (source / name).read_text()
        count = before.count(text)
        if count != 1:
            sys.exit(f"break: {source / name} has the text {text!r} {count} times, not once; "
                     "adapt the edit to the sources")
        contents[name] = before.replace(text, edit["becomes"])
    return contents


def main(faults, name, source, target):
    source, target = pathlib.Path(source), pathlib.Path(target)
    contents = edited(json.loads(pathlib.Path(faults).read_text())[name], source)
    target.mkdir(parents=True, exist_ok=True)
    for path in source.iterdir():
        copy = target / path.name
        copy.write_text(contents.get(path.name) or path.read_text())
        copy.chmod(path.stat().st_mode)


main(*sys.argv[1:])
