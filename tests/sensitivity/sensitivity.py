#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Halves and doubles each constant of pairing and clock, and reports what that does.

The tracked files are copied to build/sensitivity/source. There each `constexpr T name = value;`
becomes a variable that an environment variable scales, so that one build serves all runs.
"""
import argparse
import concurrent.futures
import dataclasses
import fnmatch
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import textwrap
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "tests" / "support"))

import source_copy  # noqa: E402

HERE = "tests/sensitivity"
FACTORS = (0.5, 2)
TYPES = {"double", "float", "int", "unsigned", "long", "std::size_t", "std::int32_t",
         "std::int64_t", "std::uint32_t", "std::uint64_t", "Duration", "versavis::Duration"}
# A run that takes so much longer than one with all constants as they are will not end.
PATIENCE = 10

# Any constexpr at column 0, and those of them that can be rewritten.
DECLARATION = re.compile(r"^(?:inline )?constexpr (?P<head>[^=;{(]+?)\s*(?P<rest>[=;{(])", re.M)
CONSTANT = re.compile(
    r"^(?P<inline>inline )?constexpr (?P<type>[\w:]+) (?P<name>\w+) =\s*(?P<value>[^;]+?);", re.M)


@dataclasses.dataclass(frozen=True)
class Figure:
    """One column, and how much worse than with all constants as they are is an edge."""
    key: str
    heading: str
    meaning: str
    limit: object  # of the figure as it is: the highest value that is no edge
    lowest: object = lambda base: -math.inf


def times(factor, slack):
    return lambda base: base * factor + slack


def nees(key, heading, meaning):
    """Too wide a sigma is as wrong as too narrow a one."""
    return Figure(key, heading, meaning, lambda base: max(2.0, 1.3 * base),
                  lambda base: min(0.5, base / 1.3))


def error(key, heading, meaning):
    return Figure(key, heading, meaning, times(1.25, 0.2))


FIGURES = {
    "pairing": [
        Figure("wrong", "wrong", "frames published with a wrong trigger: none allowed",
               lambda base: 0),
        Figure("needless", "need", "frames withheld needlessly, %: twice as many and 0.05",
               times(2, 0.05)),
        Figure("first", "first", "longest time to the first frame, s: half as much again",
               times(1.5, 0)),
        Figure("again", "again", "recovery, p99, s: half as much again", times(1.5, 0)),
        Figure("needless_no_clock", "need-", "the same three without a camera's clock",
               times(2, 0.05)),
        Figure("first_no_clock", "first-", "", times(1.5, 0)),
        Figure("again_no_clock", "again-", "", times(1.5, 0)),
        Figure("withheld_of_queues", "queue", "frames withheld when frames queue in the camera, %:"
               " a quarter more and 1", times(1.25, 1)),
        Figure("withheld_when_harsh", "harsh", "the same when faults are close and arrivals jitter"
               " by 10 to 40 % of a period", times(1.25, 1)),
        Figure("not_locked", "never", "worlds that never locked again: one more",
               lambda base: base)],
    "clock": [
        error("jittery_p99", "noisy", "error, p99, us, on links with jitter of milliseconds:"
              " a quarter more and 0.2"),
        nees("jittery_nees", "nees", "mean square of error over sigma: 1.3 times more (or less)"
             " and beyond 2 (0.5)"),
        error("usb_p99", "usb", "the same two on USB, ..."), nees("usb_nees", "nees", ""),
        error("imu_p99", "imu", "... with an IMU, before, during and after 30 s of load, ..."),
        nees("imu_nees", "nees", ""),
        error("silent_p99", "mute", "... after 5 to 30 s without contact, ..."),
        nees("silent_nees", "nees", ""),
        error("start_p99", "start", "... in the first 20 s ..."), nees("start_nees", "nees", ""),
        error("smooth_p99", "after", "... and smoothed"), nees("smooth_nees", "nees", ""),
        Figure("pps_p99", "pps", "error, p99, us, of stamps by PPS: a quarter more and 0.05",
               times(1.25, 0.05)),
        Figure("beyond", "bound", "errors beyond their bound, %: three times as many and 0.1",
               times(3, 0.1)),
        Figure("off", "off", "worlds with troubles that end off or locked out: one more",
               lambda base: base)],
}


class Failure(Exception):
    """Says what is wrong and what to do."""


@dataclasses.dataclass(frozen=True)
class Constant:
    folder: str
    file: str
    name: str
    type: str
    value: str

    @property
    def key(self):
        return f"{self.file}:{self.name}"


@dataclasses.dataclass(frozen=True)
class Skipped:
    folder: str
    key: str
    reason: str


def without_comments(text):
    return re.sub(r"//[^\n]*", "", text)


def rewrite(text, folder, file, reason_against=lambda key: None):
    """The text with its constants as variables, those constants, and those left as they are."""
    constants, skipped = [], []
    for match in DECLARATION.finditer(text):
        name = match["head"].split()[-1]
        if match["rest"] != "(" and not CONSTANT.match(text, match.start()):
            skipped.append(Skipped(folder, f"{file}:{name.split('[')[0]}",
                                   "not of the form `constexpr T name = value;`"))

    def variable(match):
        constant = Constant(folder, file, match["name"], match["type"],
                            " ".join(without_comments(match["value"]).split()))
        reason = reason_against(constant.key)
        if reason is None and constant.type not in TYPES:
            reason = f"of type {constant.type}"
        if reason is not None:
            skipped.append(Skipped(folder, constant.key, reason))
            return match[0]
        constants.append(constant)
        return (f"{match['inline'] or ''}const {match['type']} {match['name']} = "
                f"versavis::sensitivity::scaled<{match['type']}>(\"{constant.key}\", "
                f"{match['value']});")

    rewritten = CONSTANT.sub(variable, text)
    if constants:
        rewritten = f'#include "{{scale}}"\n{rewritten}'
    return rewritten, constants, skipped


def named_in(output, names):
    """Those of the names that the compiler's errors are about."""
    lines = [line for line in output.splitlines() if "error:" in line or "note:" in line]
    quoted = {word for line in lines for part in re.findall(r"'([^']*)'", line)
              for word in re.findall(r"\w+", part)}
    shown = {word for line in re.findall(r"^\s*\d+ \|(.*)$", output, re.M)
             for word in re.findall(r"\w+", line)}
    return quoted & names or shown & names


def read_fixed(text):
    entries = []
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            pattern, _, reason = line.partition(" ")
            entries.append((pattern, reason.strip()))
    return entries


def wanted(constant, names):
    return not names or any(
        name in (constant.folder, constant.file) or
        fnmatch.fnmatch(constant.name, name) or fnmatch.fnmatch(constant.key, name)
        for name in names)


class Copy:
    """The copy of the sources, with variables, and its two programs."""

    def __init__(self, directory):
        self.source = directory / "source"
        self.build = directory / "build"
        self.fixed = read_fixed((ROOT / HERE / "fixed.txt").read_text())
        self.needed = {}  # by key: why the compiler cannot do without this constant
        self.constants = []
        self.skipped = []

    def reason_against(self, key):
        if key in self.needed:
            return self.needed[key]
        return next((reason for pattern, reason in self.fixed if fnmatch.fnmatch(key, pattern)),
                    None)

    def write(self):
        self.constants, self.skipped = [], []
        source_copy.copy(ROOT, self.source, self.with_variables)

    def with_variables(self, path, content):
        match = re.fullmatch(r"libversavis/engine/(pairing|clock)/([^/]+\.[ch]pp)", path)
        if not match:
            return content
        text, constants, skipped = rewrite(content.decode(), *match.groups(), self.reason_against)
        self.constants += constants
        self.skipped += skipped
        return text.replace("{scale}", str(self.source / HERE / "scale.hpp"), 1).encode()

    def make(self, folders):
        """Compiles; what the compiler needs as a constant becomes one again."""
        environment = dict(os.environ, LC_ALL="C")
        while True:
            self.write()
            if not (self.build / "build.ninja").is_file():
                self.run(["cmake", "-S", self.source, "-B", self.build, "-G", "Ninja",
                          "-DCMAKE_BUILD_TYPE=RelWithDebInfo", "-DVERSAVIS_UNITY=OFF",
                          "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O2"], environment)
            built = subprocess.run(["ninja", "-k", "0", "-C", self.build,
                                    *(f"sensitivity_{folder}" for folder in folders)],
                                   env=environment, capture_output=True, text=True)
            if built.returncode == 0:
                return
            by_name = {constant.name: constant for constant in self.constants}
            found = named_in(built.stdout, set(by_name))
            if not found:
                raise Failure("the rewritten sources do not compile, and no constant is to blame:\n"
                              + built.stdout[-4000:])
            for name in found:
                self.needed[by_name[name].key] = "the compiler needs it as a constant"
            print(f"constants that the compiler needs: {', '.join(sorted(self.needed))}",
                  file=sys.stderr)

    @staticmethod
    def run(command, environment):
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        if done.returncode != 0:
            raise Failure(f"{command[0]} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")

    def figures(self, folder, effort, setting=None, time_limit=None):
        """None when the program crashes or does not end."""
        environment = {k: v for k, v in os.environ.items() if k != "VERSAVIS_SCALE"}
        if setting is not None:
            environment["VERSAVIS_SCALE"] = setting
        program = self.build / "bin" / f"sensitivity_{folder}"
        try:
            done = subprocess.run([program, str(effort)], env=environment, timeout=time_limit,
                                  capture_output=True, text=True)
        except subprocess.TimeoutExpired:
            print(f"{setting}: no end after {time_limit:.0f} s", file=sys.stderr)
            return None
        if done.returncode != 0:
            print(f"{setting}: exit code {done.returncode}: {done.stderr[-500:]}", file=sys.stderr)
            return None
        return json.loads(done.stdout)


def edges(folder, base, figures):
    """The columns in which these figures are too much worse."""
    if figures is None:
        return {"run"}
    return {figure.key for figure in FIGURES[folder]
            if not figure.lowest(base[figure.key]) <= figures[figure.key]
            <= figure.limit(base[figure.key])}


def measure(copy, folder, constants, effort, jobs):
    """The figures as it is, and for each constant those at each factor."""
    begin = time.monotonic()
    base = copy.figures(folder, effort)
    if base is None:
        raise Failure(f"sensitivity_{folder} fails with all constants as they are")
    limit = PATIENCE * jobs * (time.monotonic() - begin) + 60
    tasks = [(constant, factor) for constant in constants for factor in FACTORS]
    results = {}
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        futures = {pool.submit(copy.figures, folder, effort, f"{task[0].key}={task[1]}", limit):
                   task for task in tasks}
        for future in concurrent.futures.as_completed(futures):
            results[futures[future]] = future.result()
            constant, factor = futures[future]
            print(f"{len(results)} of {len(tasks)}: {constant.key} x {factor}", file=sys.stderr)
    return base, [{"name": constant.name, "file": constant.file, "type": constant.type,
                   "value": constant.value,
                   "runs": [{"factor": factor, "figures": results[constant, factor],
                             "edges": sorted(edges(folder, base, results[constant, factor]))}
                            for factor in FACTORS]} for constant in constants]


def number(value):
    if float(value).is_integer():
        return str(int(value))
    return f"{value:.2f}" if abs(value) < 100 else f"{value:.0f}"


def table(folder, base, rows):
    """Lines of at most 100 columns. `!` marks an edge."""
    columns = FIGURES[folder]
    cell = min(8, (100 - 8) // len(columns))

    def line(label, figures, marks):
        if figures is None:
            return f"{label:>6}  does not end, or fails!"
        return f"{label:>6}" + "".join(
            f"{number(figures[c.key]) + ('!' if c.key in marks else ''):>{cell}}" for c in columns)

    lines = [" " * 6 + "".join(f"{column.heading[:cell - 1]:>{cell}}" for column in columns),
             line("as is", base, edges(folder, base, base))]
    file = None
    for row in rows:
        if row["file"] != file:
            file = row["file"]
            lines += ["", file]
        lines.append(f"{row['name']} = {row['value']}"[:100])
        lines += [line(f"x {run['factor']}", run["figures"], run["edges"]) for run in row["runs"]]
    return "\n".join(lines)


def summary(folder, base, rows, skipped):
    """What is on an edge, what no figure depends on, what was left out."""
    headings = {figure.key: figure.key.replace("_", " ") for figure in FIGURES[folder]}
    on_edge = [f"{row['file']}:{row['name']} x {run['factor']}: "
               + ("the run does not end, or fails" if run["figures"] is None else ", ".join(
                   f"{headings[key]} {number(base[key])} -> {number(run['figures'][key])}"
                   for key in run["edges"]))
               for row in rows for run in row["runs"] if run["edges"]]
    unfelt = [f"{row['file']}:{row['name']}" for row in rows
              if all(run["figures"] == base for run in row["runs"])]
    left_out = [f"{one.key}: {one.reason}" for one in skipped if one.folder == folder]
    parts = [("On an edge", on_edge), ("No figure changes with", unfelt), ("Not scaled", left_out)]
    return "\n\n".join(f"{title}: none." if not lines else
                       f"{title}:\n\n" + "\n".join(bullet(line) for line in lines)
                       for title, lines in parts)


def bullet(text):
    return textwrap.fill(text, 100, initial_indent="- ", subsequent_indent="  ",
                         break_long_words=False, break_on_hyphens=False)


def legend(folder):
    return "\n".join(bullet(f"`{figure.heading}`: {figure.meaning}") for figure in FIGURES[folder]
                     if figure.meaning)


def to_markdown(folder, result):
    return (f"## {folder.capitalize()}\n\nColumns, and how much worse than `as is` counts as"
            f" an edge (`!`):\n\n{legend(folder)}\n\n```\n"
            f"{table(folder, result['base'], result['constants'])}\n```\n\n"
            f"{summary(folder, result['base'], result['constants'], result['skipped'])}\n")


def with_section(document, folder, section):
    """The document with the section of this folder replaced, or appended."""
    begin, end = f"<!-- {folder}: begin -->", f"<!-- {folder}: end -->"
    block = f"{begin}\n{section}{end}"
    if begin in document and end in document:
        before, _, rest = document.partition(begin)
        return before + block + rest.partition(end)[2]
    return document.rstrip("\n") + f"\n\n{block}\n"


def parse(arguments):
    parser = argparse.ArgumentParser(
        prog="dev sensitivity",
        description="Runs short campaigns with each constant of pairing and clock halved and "
                    "doubled, and marks what sits on an edge.")
    parser.add_argument("names", nargs="*", metavar="NAME",
                        help="pairing, clock, a file or a constant, wildcards allowed; default all")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="figures of all runs")
    parser.add_argument("--markdown", type=pathlib.Path, metavar="FILE",
                        help="replaces the sections of pairing or clock in this document")
    parser.add_argument("--effort", type=int, default=1, metavar="N",
                        help="N times as many worlds (default 1)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N",
                        help="runs at a time (default 2)")
    options = parser.parse_args(arguments)
    if options.effort < 1 or options.jobs < 1:
        parser.error("--effort and --jobs must be at least 1")
    if options.markdown and set(options.names) - set(FIGURES):
        parser.error("--markdown needs whole folders: pairing, clock or both")
    return options


def main(arguments):
    options = parse(arguments)
    copy = Copy(ROOT / "build" / "sensitivity")
    copy.write()
    folders = [folder for folder in FIGURES
               if any(wanted(one, options.names) for one in copy.constants if one.folder == folder)]
    if not folders:
        raise Failure(f"no constant is named {' or '.join(options.names)}")
    copy.make(folders)
    document = {}
    for folder in folders:
        chosen = [one for one in copy.constants
                  if one.folder == folder and wanted(one, options.names)]
        base, rows = measure(copy, folder, chosen, options.effort, options.jobs)
        skipped = [one for one in copy.skipped if one.folder == folder]
        document[folder] = {"base": base, "constants": rows, "skipped": skipped}
        print(f"{folder}\n\n{table(folder, base, rows)}\n\n"
              f"{summary(folder, base, rows, skipped)}\n\n{legend(folder)}\n", flush=True)
        if options.markdown:
            old = options.markdown.read_text() if options.markdown.is_file() else "# Sensitivity\n"
            options.markdown.write_text(with_section(old, folder,
                                                     to_markdown(folder, document[folder])))
    if options.json:
        options.json.write_text(json.dumps(document, indent=2, default=dataclasses.asdict) + "\n")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except Failure as failure:
        sys.exit(f"dev sensitivity: {failure}")
