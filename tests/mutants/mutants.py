#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes mutants of the sources and lists those that no test notices.

The tracked files are copied to build/mutants/source and built once. Each worker has a copy of the
sources of its own, in which one mutant at a time replaces a file. Only objects that depend on that
file are compiled, beside those of the build, and linked in front of its archives.
"""
import argparse
import concurrent.futures
import dataclasses
import fcntl
import hashlib
import json
import math
import os
import pathlib
import queue
import random
import re
import resource
import select
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "tests" / "support"))

import source_copy  # noqa: E402
import source_mutants  # noqa: E402

EQUIVALENT = "tests/mutants/equivalent.txt"
USAGE, BROKEN_TOOL, INTERRUPTED = 64, 70, 130

# A mutant that takes so many times as long as the program without one, and so many seconds more,
# will not end. That one counts lines, and takes about three times as long as without.
PATIENCE, SLACK_S = 3, 2
COMPILE_LIMIT_S = 120
MEMORY_LIMIT = 1 << 30
OUTPUT_LIMIT = 128 << 20
# Tests that are done soonest run first, as many at once as take so long.
AT_ONCE_S = 0.25
# When tests are to be compiled too: so many files at a time.
CASES_AT_A_TIME = 8


@dataclasses.dataclass(frozen=True, eq=False)
class Area:
    """A folder, and the program whose test cases its mutants must get past."""
    folder: str
    program: str
    # A file of test cases that takes long, and the only modules for which it runs.
    only_for: dict = dataclasses.field(default_factory=dict)
    # Its named constants are none of ours: ./dev sensitivity halves and doubles them, and shows
    # what that costs.
    is_tuned: bool = False


AREAS = [
    Area("firmware/core", "firmware_tests", {"011-no-drift": {"grid"}}),
    Area("libversavis/engine/pairing", "pairing_tests", is_tuned=True),
    Area("libversavis/engine/ring", "ring_tests"),
    Area("libversavis/client", "ring_tests"),
    Area("libversavis/include/versavis/ring", "ring_tests"),
]

STATUSES = {
    "killed": "a test failed, crashed, or did not end",
    "survived": "no test noticed",
    "listed": f"survived, and {EQUIVALENT} says why",
    "same": "the compiler makes the same code of it",
    "invalid": "does not compile",
    "not run": "the time was over",
}


class Failure(Exception):
    """Says what is wrong and what to do."""


class WrongUse(Exception):
    """The same, of the arguments."""


class Stopped(Exception):
    """Time is over, or the user wants no more."""


@dataclasses.dataclass
class Result:
    mutant: source_mutants.Mutant
    status: str = "not run"
    by: str = ""            # what killed it
    unreached: bool = False  # no test gets to its line
    seconds: float = 0.0


# Processes

class Processes:
    """Those that run now. All end together."""

    def __init__(self):
        self.lock = threading.Lock()
        self.running = set()
        self.stopped = False

    def run(self, command, output, limit_s=None, memory=None, **options):
        """The exit code; limits are the processor's time, and some more on the clock."""
        limits = ["--core=0", f"--fsize={OUTPUT_LIMIT}"] if memory else []
        limits += [f"--cpu={math.ceil(limit_s)}"] if limit_s else []
        limits += [f"--as={memory}"] if memory else []
        with self.lock:
            if self.stopped:
                raise Stopped
            process = subprocess.Popen(
                [*(["prlimit", *limits] if limits else []), *map(str, command)],
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                # A file that would become too large is an error, and does not end the program.
                start_new_session=True, restore_signals=False, **options)
            self.running.add(process)
        try:
            ended = self.ends_within(process, 5 * limit_s if limit_s else math.inf)
            with self.lock:
                self.kill(process)  # also what it left behind, while its number is still its own
            code = process.wait() if ended else -signal.SIGXCPU
        finally:
            with self.lock:
                self.running.discard(process)
                self.kill(process)
            process.wait()
        if self.stopped:
            raise Stopped
        return code

    @staticmethod
    def ends_within(process, seconds):
        """A pause of the whole machine, or of this tool with all it started, hardly counts."""
        file = os.pidfd_open(process.pid)
        try:
            while seconds > 0 and not select.select([file], [], [], min(seconds, 1))[0]:
                seconds -= 1
            return seconds > 0
        finally:
            os.close(file)

    @staticmethod
    def kill(process):
        """With what it started. One that has ended may no longer be what has its number."""
        if process.returncode is None:
            os.killpg(process.pid, signal.SIGKILL)

    def stop(self):
        with self.lock:
            self.stopped = True
            for process in self.running:
                self.kill(process)

    def output_of(self, command, **options):
        """Of a command that must succeed."""
        with tempfile.TemporaryFile("w+") as output:
            code = self.run(command, output, **options)
            output.seek(0)
            text = output.read()
        if code != 0:
            raise Failure(f"{command[0]} failed:\n{text[-4000:]}")
        return text


class Progress:
    """On standard error: in place in a terminal, else a line for each tenth."""

    def __init__(self):
        self.stream = sys.stderr
        self.in_place = self.stream.isatty()
        self.tenth = 0
        self.open = False

    def show(self, done, total, text):
        if self.in_place:
            self.stream.write(f"\r{text[:99]}\033[K")
            self.open = True
        elif 10 * done // total > self.tenth:
            self.stream.write(f"{text}\n")
        self.tenth = 10 * done // total
        self.stream.flush()

    def say(self, text):
        self.end()
        print(text, file=self.stream, flush=True)

    def end(self):
        if self.open:
            self.stream.write("\n")
        self.open, self.tenth = False, 0


# The build

@dataclasses.dataclass(frozen=True)
class Object:
    path: str          # in the build directory
    command: tuple
    source: str        # from the top of the tree
    depends: frozenset
    is_case: bool      # test cases: linked by its name, and not from an archive


def stem(path):
    return pathlib.PurePath(path).stem


def spec(files):
    """Catch has the names of files as tags."""
    return ",".join(f"[#{file}]" for file in files)


class Build:
    """What the mutants of one area are compared with."""

    def __init__(self, root, directory, area, jobs, processes):
        self.root, self.area, self.jobs, self.processes = root, area, jobs, processes
        self.source, self.directory = directory / "source", directory / "build"
        self.program = f"bin/{area.program}"
        self.files = set()
        self.objects, self.link = [], []
        self.layouts, self.layout_lock = {}, threading.Lock()
        self.durations = {}  # of each file of test cases: processor time, s
        self.reached = {}    # of each source, by line: the files of test cases that get there
        self.code = {}       # of each library's object, by header: the lines of which it has code
        self.environment = {name: value for name, value in os.environ.items() if not
                            name.startswith("VERSAVIS_")} | {"LC_ALL": "C", "RC_PARAMS": "seed=1"}

    def make(self, progress):
        self.files = source_copy.copy(self.root, self.source)
        if not (self.directory / "build.ninja").is_file():
            self.processes.output_of(
                ["cmake", "-S", self.source, "-B", self.directory, "-G", "Ninja",
                 "-DCMAKE_BUILD_TYPE=None", "-DCMAKE_CXX_FLAGS=-O1", "-DVERSAVIS_WERROR=OFF",
                 "-DVERSAVIS_UNITY=OFF"])
        progress.say("mutants: builds what they are compared with (1 to 3 minutes, if new)")
        self.ninja(f"-j{self.jobs}", self.area.program)
        self.read()

    def ninja(self, *arguments):
        return self.processes.output_of(["ninja", "-C", self.directory, *arguments])

    def relative(self, path):
        """From the top of the tree; None: a header of the system."""
        path = os.path.normpath(os.path.join(self.directory, path))
        inside = path.startswith(f"{self.source}/")
        return path[len(str(self.source)) + 1:] if inside else None

    def read(self):
        """What is compiled and linked, how, and from what."""
        link = self.ninja("-t", "commands", "-s", self.program).splitlines()[-1]
        self.link = shlex.split(re.search(r"(?:^|&& )(\S*\+\+\S* .*? -o .*?)(?: &&|$)", link)[1])
        depends, current = {}, None
        for line in self.ninja("-t", "deps").splitlines():
            if line.startswith("    "):
                path = self.relative(line.strip())
                if path:
                    depends[current].add(path)
            elif ": #deps" in line:
                current = line.partition(": #deps")[0]
                depends[current] = set()
        inputs = set(self.ninja("-t", "inputs", self.program).splitlines())
        self.objects = []
        for entry in json.loads((self.directory / "compile_commands.json").read_text()):
            command = shlex.split(entry["command"])
            output = command[command.index("-o") + 1]
            if output in inputs and self.relative(entry["file"]):
                self.objects.append(Object(
                    output, tuple(command), self.relative(entry["file"]),
                    frozenset(depends.get(output, ())), output in self.link))

    def in_area(self, one):
        return one.source.startswith(f"{self.area.folder}/")

    def cases(self, module=None):
        """Files of test cases that judge this module; without one: every module."""
        files = {stem(one.source) for one in self.objects if one.is_case}
        return {file for file in files if module in self.area.only_for.get(file, {module})}

    def digest(self, objects):
        """Of these objects and of the area's sources, since an object does not show its lines."""
        digest = hashlib.sha256()
        for path in [self.directory / one.path for one in objects] + [
                self.source / path for path in sorted(self.files)
                if path.startswith(f"{self.area.folder}/")]:
            digest.update(path.read_bytes())
        return digest.hexdigest()

    def measure(self, mutants, progress):
        """How long each file of test cases takes, which lines it gets to, and of which lines of
        headers there is code in which object."""
        libraries = [one for one in self.objects if not one.is_case]
        cases = set().union(*(self.cases(stem(mutant.file)) for mutant in mutants))
        wanted = {one.path: self.digest([one]) for one in libraries if any(
            mutant.file in one.depends and mutant.file != one.source for mutant in mutants)}
        wanted |= {stem(one.source): self.digest([*libraries, one]) for one in self.objects
                   if one.is_case and stem(one.source) in cases}
        cache = self.directory / f"{self.area.program}.measured"
        known = json.loads(cache.read_text()) if cache.is_file() else {}
        known = {key: one for key, one in known.items() if one["of"] == wanted.get(key, one["of"])}
        missing = sorted(wanted.keys() - known.keys())
        if missing:
            coverage = Coverage(self)
            for done, key in enumerate(missing, 1):
                known[key] = {"of": wanted[key]} | (
                    coverage.measure(key) if key in cases else coverage.code_of(key))
                progress.show(done, len(missing), f"mutants: looks at what the tests get to: {done}"
                              f" of {len(missing)}")
            progress.end()
            cache.write_text(json.dumps(known))
        for key in wanted:
            one = known[key]
            if key not in cases:
                self.code[key] = {file: set(lines) for file, lines in one["code"].items()}
                continue
            self.durations[key] = one["seconds"]
            for file, lines in one["lines"].items():
                reached = self.reached.setdefault(file, {})
                for line, count in lines:
                    reached.setdefault(line, set()).update({key} if count else ())

    def having_code(self, mutant):
        """Objects of libraries with code of a mutant of a header."""
        lines = range(mutant.line, mutant.last_line + 1)
        return [one for one in self.objects
                if not self.code.get(one.path, {}).get(mutant.file, set()).isdisjoint(lines)]

    def naming(self, mutant):
        """Test cases that include the mutant's header by name."""
        return [one for one in self.objects if one.is_case and self.includes(one, mutant.file)]

    def reaching(self, mutant):
        """The files of test cases that get to a mutant. If it has no code of its own, as a constant
        has not: those that get anywhere in its module."""
        reached = self.reached.get(mutant.file, {})
        lines = [reached[line] for line in range(mutant.line, mutant.last_line + 1)
                 if line in reached]
        lines = lines or [
            those for file, lines in self.reached.items()
            if file == mutant.file or
            not mutant.file.endswith(".cpp") and stem(file) == stem(mutant.file)
            for those in lines.values()]
        return {stem(one.source) for one in self.naming(mutant)}.union(*lines)

    def stages(self, mutant):
        """Files of test cases that may get to a mutant, in groups: first those named after the
        module, then what is done soonest. If none does, all: perhaps it is computed at compile
        time."""
        module = stem(mutant.file)
        cases = self.cases(module)
        cases = cases & self.reaching(mutant) or cases
        own = {file for file in cases if file == module or file.startswith(f"{module}_")}
        files = sorted(cases - own, key=lambda file: (self.durations[file], file))
        stages, last_s = [sorted(own)] if own else [], math.inf
        for file in files:
            if last_s + self.durations[file] > AT_ONCE_S:
                stages.append([])
                last_s = 0
            stages[-1].append(file)
            last_s += self.durations[file]
        return stages

    def includes(self, one, file):
        """Whether an object's source names this header."""
        name = re.escape(pathlib.PurePath(file).name)
        return re.search(rf'^\s*#\s*include\s+"(?:[^"]*/)?{name}"',
                         (self.source / one.source).read_text(), re.M) is not None

    def limit(self, files):
        return PATIENCE * sum(self.durations[file] for file in files) + SLACK_S

    def link_command(self, program, objects, cases):
        """Objects stand in front of the archives that have the old ones."""
        of_cases = {one.path for one in self.objects if one.is_case}
        rest = [part for part in self.link if part not in of_cases]
        at = rest.index("-o")
        return [*rest[:at], "-o", program, *objects, *cases, *rest[at + 2:]]

    def layout(self, one):
        """The sizes of all classes that an object knows, as it is."""
        with self.layout_lock:
            if one.path not in self.layouts:
                with tempfile.TemporaryDirectory() as directory:
                    dump = pathlib.Path(directory) / "classes"
                    self.processes.output_of(
                        [*with_output(one.command, f"{directory}/object"), dump_to(dump)],
                        cwd=self.directory)
                    self.layouts[one.path] = sizes(dump)
            return self.layouts[one.path]


class Coverage:
    """The program with counters in the sources of the area."""

    def __init__(self, build):
        self.build = build
        self.directory = build.directory.parent / "coverage"
        shutil.rmtree(self.directory, ignore_errors=True)
        self.directory.mkdir()
        # Beside the other one, where it finds its data.
        self.program = build.directory / f"{build.program}.coverage"
        of_area = [one for one in build.objects if build.in_area(one)]
        with concurrent.futures.ThreadPoolExecutor(build.jobs) as pool:
            list(pool.map(self.compile, of_area))
        cases = [one.path for one in build.objects if one.is_case]
        self.run([*build.link_command(self.program, map(self.object, of_area), cases),
                  "--coverage"])

    def object(self, one):
        return self.directory / one.path.replace("/", "_")

    def run(self, command, **limits):
        return self.build.processes.output_of(command, env=self.build.environment,
                                              cwd=self.build.directory, **limits)

    def compile(self, one):
        self.run([*with_output(one.command, str(self.object(one))), "-O0", "--coverage"])

    def lines(self, counts):
        """Of sources of the area: file, line and how often it ran."""
        if not counts:
            return
        for text in self.run(["gcov", "-r", "--json-format", "--stdout", *counts]).splitlines():
            for source in json.loads(text)["files"] if text.startswith("{") else ():
                file = os.path.normpath(source["file"])
                if file.startswith(f"{self.build.area.folder}/"):
                    for line in source["lines"]:
                        yield file, line["line_number"], line["count"]

    def code_of(self, path):
        """The lines of which an object of a library has code, by file."""
        one = next(one for one in self.build.objects if one.path == path)
        if not self.object(one).is_file():
            self.compile(one)
        code = {}
        for file, line, _ in self.lines([self.object(one).with_suffix(".gcno")]):
            code.setdefault(file, []).append(line)
        return {"code": code}

    def measure(self, file):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        try:
            self.run([self.program, "-#", "-w", "NoTests", "-r", "compact", spec([file])],
                     memory=MEMORY_LIMIT)
        except Failure as failure:
            raise Failure(f"{file} fails without any mutant: {failure}") from None
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        counts = sorted(self.directory.glob("*.gcda"))
        lines = {}
        for source, line, count in self.lines(counts):
            lines.setdefault(source, []).append((line, count))
        for path in counts:
            path.unlink()
        return {"seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
                "lines": lines}


def with_output(command, path):
    at = command.index("-o")
    return [*command[:at + 1], path, *command[at + 2:]]


def dump_to(path):
    return f"-fdump-lang-class={path}"


def sizes(dump):
    return set(re.findall(r"^Class (.*)\n\s+(size=\d+ align=\d+)", dump.read_text(), re.M))


# One mutant

class Worker:
    """A copy of the sources, of which one file at a time is a mutant."""

    def __init__(self, build, directory, verdicts):
        self.build, self.verdicts = build, verdicts
        self.source, self.objects = directory / "source", directory / "objects"
        self.program = build.directory / f"{build.program}.{directory.name}"
        source_copy.copy(build.source, self.source, files=build.files)
        shutil.rmtree(self.objects, ignore_errors=True)
        self.objects.mkdir(parents=True)
        self.output = self.objects / "output"

    def run(self, command, **options):
        with self.output.open("wb") as output:
            return self.build.processes.run(command, output, cwd=self.build.directory,
                                            env=self.build.environment, **options)

    def judge(self, mutant):
        begin = time.monotonic()
        file = self.source / mutant.file
        original = file.read_text()
        try:
            file.write_text(mutant.apply(original))
            status, by = self.verdict(mutant)
        finally:
            file.write_text(original)
        return Result(mutant, status, by, not self.build.reaching(mutant),
                      round(time.monotonic() - begin, 2))

    def verdict(self, mutant):
        """Compiles the objects that have code of the mutant. If none has, as of a constant: those
        of the area that depend on it, and those that name its header. What is on trial is the
        module, not what others expect of it. All, if classes have another size now."""
        dependents = [one for one in self.build.objects if mutant.file in one.depends]
        of_area = [one for one in dependents if self.build.in_area(one)]
        first = self.build.having_code(mutant) or [
            one for one in dependents if not one.is_case and (
                one in of_area or self.build.includes(one, mutant.file))]
        first += self.build.naming(mutant)
        if of_area and not any(one in of_area for one in first):
            first.append(of_area[0])  # to know the sizes
        first.sort(key=lambda one: (one not in of_area, one.is_case))
        changed, layout_changed = {}, False
        for one in first:
            dumps = one in of_area and one.source != mutant.file
            if not self.compile(one, changed, dumps):
                return "invalid", ""
            if dumps and sizes(self.objects / "classes") != self.build.layout(one):
                layout_changed = True
        if layout_changed:
            return self.try_widely(mutant, dependents, set(first))
        return self.try_tests(mutant, changed)

    def try_tests(self, mutant, changed):
        """With the objects that changed. The same code has the same verdict."""
        if not changed:
            return "same", ""
        key = mutant.file, tuple(sorted((one.path, digest) for one, digest in changed.items()))
        if key not in self.verdicts:
            if not self.link(changed, [one for one in self.build.objects if one.is_case]):
                return "invalid", ""
            stages = self.build.stages(mutant)
            by = next((by for by in map(self.killed_by, stages) if by), "")
            self.verdicts[key] = ("killed", by) if by else ("survived", "")
        return self.verdicts[key]

    def try_widely(self, mutant, dependents, compiled):
        """Compiles all that depends, and the test cases some at a time."""
        cases = []
        libraries = {one for one in dependents if not one.is_case}
        if not all(self.compile(one) for one in libraries - compiled):
            return "invalid", ""
        compiled |= libraries
        for stage in self.build.stages(mutant):
            for begin in range(0, len(stage), CASES_AT_A_TIME):
                files = stage[begin:begin + CASES_AT_A_TIME]
                wanted = [one for one in self.build.objects
                          if one.is_case and stem(one.source) in files]
                new = set(wanted) & set(dependents) - compiled
                if not all(self.compile(one) for one in new):
                    return "invalid", ""
                compiled |= new
                cases += wanted
                if not self.link(compiled, cases):
                    return "invalid", ""
                by = self.killed_by(files)
                if by:
                    return "killed", by
        return "survived", ""

    def compiled(self, one):
        return self.objects / one.path.replace("/", "_")

    def compile(self, one, changed=None, dumps=False):
        """False: that failed. Adds it to those that changed, with its digest, if so."""
        command = with_output(
            [part.replace(str(self.build.source), str(self.source)) for part in one.command],
            str(self.compiled(one)))
        # A function that ends without a value does anything.
        command.append("-Werror=return-type")
        if dumps:
            command.append(dump_to(self.objects / "classes"))
        if self.run(command, limit_s=COMPILE_LIMIT_S) != 0:
            return False
        content = self.compiled(one).read_bytes()
        if changed is not None and content != (self.build.directory / one.path).read_bytes():
            changed[one] = hashlib.sha256(content).hexdigest()
        return True

    def link(self, compiled, cases):
        """These test cases, with the objects that were compiled in place of the old ones."""
        new = [self.compiled(one) for one in compiled if not one.is_case or one in cases]
        kept = [one.path for one in cases if one not in compiled]
        return self.run(self.build.link_command(self.program, new, kept),
                        limit_s=COMPILE_LIMIT_S) == 0

    def killed_by(self, files):
        """What failed; empty: nothing."""
        limit = self.build.limit(files)
        code = self.run([self.program, "-#", "-a", "-r", "compact", spec(files)],
                        limit_s=limit, memory=MEMORY_LIMIT)
        if code == 0:
            return ""
        if code == -signal.SIGXCPU or code == -signal.SIGKILL:
            return f"no end after {math.ceil(limit)} s"
        failed = re.search(r"^(\S+:\d+): failed", self.output.read_text(errors="replace"), re.M)
        if failed:
            return failed[1].removeprefix("./")
        return f"signal {-code}" if code < 0 else f"exit code {code}"


class Run:
    """All mutants of one area, by several workers."""

    def __init__(self, build, directory, deadline, progress):
        self.build, self.progress, self.deadline = build, progress, deadline
        verdicts = {}
        self.workers = [Worker(build, directory / f"worker-{number}", verdicts)
                        for number in range(1, build.jobs + 1)]
        self.results, self.errors = [], []
        self.waiting = queue.SimpleQueue()

    def work(self, worker):
        try:
            while True:
                mutant = self.waiting.get_nowait()
                self.results.append(worker.judge(mutant))
        except (queue.Empty, Stopped):
            pass
        except Exception as error:  # shown by the main thread
            self.errors.append(error)

    def all(self, mutants):
        """Adds a result for each. Returns early when it is stopped."""
        for mutant in mutants:
            self.waiting.put(mutant)
        begin = time.monotonic()
        threads = [threading.Thread(target=self.work, args=[worker]) for worker in self.workers]
        for thread in threads:
            thread.start()
        try:
            while any(thread.is_alive() for thread in threads):
                if self.errors:
                    self.build.processes.stop()
                for thread in threads:
                    thread.join(0.2)
                self.show(len(mutants), begin)
        finally:
            self.build.processes.stop()
            for thread in threads:
                thread.join()
            self.progress.end()
        if self.errors:
            raise self.errors[0]

    def show(self, total, begin):
        done = len(self.results)
        survivors = sum(result.status == "survived" for result in self.results)
        elapsed = time.monotonic() - begin
        left = (total - done) * elapsed / done if done else 0
        left = min(left, max(0, self.deadline - time.monotonic()))
        self.progress.show(done, total, f"mutants: {done} of {total}, {survivors} survived, "
                           f"{math.ceil(left / 60)} minutes left")


# Which mutants

def sources(root, area):
    return sorted(path for path in source_copy.tracked_files(root)
                  if path.startswith(f"{area.folder}/") and path.endswith((".cpp", ".hpp")))


def named(file, names):
    """By module, file or folder."""
    path = pathlib.PurePath(file)
    return any(name.rstrip("/") in (path.stem, path.name, file) or
               f"/{file}".find(f"/{name.strip('/')}/") >= 0 for name in names)


def git(root, *arguments):
    return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True)


def changed_lines(root, base):
    """By file, the numbers of lines that are not as in base; None: there is no base."""
    if git(root, "rev-parse", "--verify", "-q", f"{base}^{{commit}}").returncode != 0:
        return None
    changed, file = {}, None
    difference = git(root, "diff", "-U0", "--no-color", "--no-ext-diff", "--no-renames",
                     "--src-prefix=a/", "--dst-prefix=b/", base)
    if difference.returncode != 0:
        raise Failure(f"git diff failed: {difference.stderr.strip()}")
    for line in difference.stdout.splitlines():
        if line.startswith("+++ "):
            file = line[6:]
        hunk = re.match(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@", line)
        if hunk:
            first, count = int(hunk[1]), int(hunk[2] or 1)
            changed.setdefault(file, set()).update(range(first, first + count))
    for file in git(root, "ls-files", "-o", "--exclude-standard").stdout.splitlines():
        if (root / file).is_file():
            changed[file] = range(1, 1 << 30)
    return changed


def in_order(mutants, seed):
    """At random, so that those of any part of the time represent all of them."""
    return random.Random(seed).sample(mutants, len(mutants))


def on_lines(mutant, changed):
    lines = changed.get(mutant.file, ())
    return any(line in lines for line in range(mutant.line, mutant.last_line + 1))


# Equivalent mutants

@dataclasses.dataclass(frozen=True)
class Entry:
    line: int
    key: tuple
    reason: str


def read_entries(text):
    """`file: source line`, then indented the mutation, then the reason."""
    entries, block = [], []

    def finish():
        if not block:
            return
        number, head = block[0]
        file, separator, source = head.partition(": ")
        mutation = block[1][1].strip() if len(block) > 1 else ""
        reason = " ".join(line.strip() for _, line in block[2:])
        if not separator or not mutation or not reason:
            raise Failure(f"{EQUIVALENT}:{number}: an entry has a line `file: source line`, then, "
                          "indented, the mutation, then the reason")
        entries.append(Entry(number, (file, source.strip(), mutation), reason))
        block.clear()

    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        if not line[0].isspace():
            finish()
        elif not block:
            raise Failure(f"{EQUIVALENT}:{number}: is indented, but belongs to no entry")
        block.append((number, line))
    finish()
    keys = [entry.key for entry in entries]
    for entry in entries:
        if keys.count(entry.key) > 1:
            raise Failure(f"{EQUIVALENT}:{entry.line}: there are two entries of this mutant")
    return entries


# Report

def survivors_text(results):
    lines = []
    for result in results:
        if result.status == "survived":
            mutant = result.mutant
            unreached = "  (no test gets there)" if result.unreached else ""
            lines += [f"{mutant.file}:{mutant.line}: {mutant.mutation}{unreached}",
                      f"  - {mutant.source}", f"  + {mutant.mutated}", ""]
    return "\n".join(lines)


def table(results):
    headings = ["mutants", *STATUSES]
    files = sorted({result.mutant.file for result in results})
    rows = [(file, [result for result in results if result.mutant.file == file]) for file in files]
    if len(rows) > 1:
        rows.append(("all", results))
    width = max(len(name) for name, _ in rows)
    lines = [" " * width + "".join(f"{heading:>9}" for heading in headings)]
    for name, those in rows:
        counts = [len(those), *(sum(one.status == status for one in those) for status in STATUSES)]
        lines.append(f"{name:<{width}}" + "".join(f"{count:>9}" for count in counts))
    return "\n".join(lines)


def to_json(results):
    return json.dumps({
        "counts": {status: sum(result.status == status for result in results)
                   for status in STATUSES},
        "mutants": [{
            "file": result.mutant.file, "line": result.mutant.line,
            "source": result.mutant.source, "mutated": result.mutant.mutated,
            "mutation": result.mutant.mutation, "status": result.status, "by": result.by,
            "unreached": result.unreached, "seconds": result.seconds}
            for result in results]}, indent=2) + "\n"


def minutes(seconds):
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} minutes"


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise WrongUse(message)


def parse(arguments):
    parser = Parser(
        prog="dev mutants",
        description="Makes small mistakes in the sources, one at a time, and lists those that no "
                    "test notices.")
    parser.add_argument("modules", nargs="*", metavar="MODULE",
                        help="a module, file or folder; default: " + AREAS[0].folder)
    parser.add_argument("--changed", nargs="?", const="", metavar="BASE",
                        help="only on lines that differ from this commit (default HEAD~1)")
    parser.add_argument("--limit", type=float, metavar="MINUTES",
                        help="stop in time, and report how many were not run")
    parser.add_argument("--seed", type=int, default=1, metavar="N",
                        help="of the order in which they run (default 1)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N",
                        help="mutants at a time (default 2)")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="all verdicts")
    parser.add_argument("--list", action="store_true", help="show the mutants, and run none")
    options = parser.parse_args(arguments)
    if options.jobs < 1:
        parser.error("--jobs must be at least 1")
    if options.limit is not None and not 0 < options.limit < math.inf:
        parser.error("--limit must be more than 0")
    return options


class Tool:
    def __init__(self, root, areas, options):
        self.root, self.areas, self.options = root, areas, options
        self.progress = Progress()
        limit = math.inf if options.limit is None else 60 * options.limit
        self.deadline = time.monotonic() + limit
        self.processes = Processes()
        self.texts = {}  # of the sources, as the mutants were found in them
        self.begin = time.monotonic()

    def find(self, file):
        if file not in self.texts:
            self.texts[file] = (self.root / file).read_text()
        return source_mutants.find(file, self.texts[file])

    def chosen(self):
        """The mutants by area."""
        names = self.options.modules
        files = {area: [file for file in sources(self.root, area)
                        if named(file, names) or not names and area is self.areas[0]]
                 for area in self.areas}
        for name in names:
            if not any(named(file, [name]) for those in files.values() for file in those):
                raise WrongUse(f"no source in {' or '.join(area.folder for area in self.areas)} "
                               f"is named {name}")
        return {area: [mutant for file in those for mutant in self.find(file)
                       if not (area.is_tuned and self.is_constant(mutant))]
                for area, those in files.items() if those}

    def is_constant(self, mutant):
        """Of a named one of its file."""
        line = self.texts[mutant.file].splitlines()[mutant.line - 1]
        return mutant.kind == "constant" and line.startswith(("constexpr ", "inline constexpr "))

    def only_changed(self, chosen):
        """None: there is nothing to compare with."""
        base = self.options.changed or "HEAD~1"
        changed = changed_lines(self.root, base)
        if changed is None:
            shallow = git(self.root, "rev-parse", "--is-shallow-repository").stdout.strip()
            if self.options.changed and shallow != "true":
                raise WrongUse(f"there is no commit {base}")
            return None
        return {area: [mutant for mutant in mutants if on_lines(mutant, changed)]
                for area, mutants in chosen.items()}

    def main(self):
        """The exit code."""
        chosen = self.chosen()
        if self.options.changed is not None:
            chosen = self.only_changed(chosen)
            if chosen is None:
                print("mutants: this checkout has no earlier commit to compare with: none was run")
                return 0
        if self.options.list:
            for mutants in chosen.values():
                for mutant in mutants:
                    print(f"{mutant.file}:{mutant.line}: {mutant.mutation}\n"
                          f"  - {mutant.source}\n  + {mutant.mutated}")
            return 0
        path = self.root / EQUIVALENT
        entries = read_entries(path.read_text() if path.is_file() else "")
        old = self.stale(entries)
        for entry in old:
            print(f"{EQUIVALENT}:{entry.line}: there is no such mutant any more: remove the entry, "
                  "or correct it")
        results, interrupted = [], False
        for area, mutants in chosen.items():
            if mutants and not interrupted:
                interrupted = not self.run(area, mutants, results)
        wrong = self.judge_entries(entries, results)
        self.report(results)
        if self.options.json:
            self.options.json.write_text(to_json(results))
        if interrupted:
            return INTERRUPTED
        return int(bool(old or wrong or any(one.status == "survived" for one in results)))

    def stale(self, entries):
        """Entries of which there is no mutant any more."""
        keys = {file: {mutant.key for mutant in self.find(file)} if (self.root / file).is_file()
                else set() for file in {entry.key[0] for entry in entries}}
        return [entry for entry in entries if entry.key not in keys[entry.key[0]]]

    def run(self, area, mutants, results):
        """Adds one result for each mutant. False: the user interrupted it."""
        directory = self.root / "build" / "mutants"
        directory.mkdir(parents=True, exist_ok=True)
        run, interrupted = None, False
        with (directory / "lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Failure("another run has build/mutants: wait for its end") from None
            timer = None
            try:
                build = Build(self.root, directory, area, self.options.jobs, self.processes)
                if self.deadline < math.inf:
                    timer = threading.Timer(self.deadline - time.monotonic(), self.processes.stop)
                    timer.daemon = True
                    timer.start()
                build.make(self.progress)
                if any((build.source / file).read_text() != self.texts[file]
                       for file in {mutant.file for mutant in mutants}):
                    raise Failure("the sources were changed in the meantime: run it again")
                build.measure(mutants, self.progress)
                run = Run(build, directory, self.deadline, self.progress)
                run.all(in_order(mutants, self.options.seed))
            except KeyboardInterrupt:
                interrupted = True
            except Stopped:
                pass
            finally:
                if timer:
                    timer.cancel()
                self.processes.stop()
        self.processes = Processes()
        judged = {result.mutant: result for result in run.results} if run else {}
        results += [judged.get(mutant, Result(mutant)) for mutant in mutants]
        return not interrupted

    @staticmethod
    def judge_entries(entries, results):
        """Survivors with an entry are listed ones. Entries of mutants that are killed are wrong."""
        by_key = {entry.key: entry for entry in entries}
        wrong = []
        for result in results:
            entry = by_key.get(result.mutant.key)
            if entry and result.status == "survived":
                result.status = "listed"
            elif entry and result.status == "killed":
                print(f"{EQUIVALENT}:{entry.line}: this mutant is not equivalent: {result.by} "
                      "kills it")
                wrong.append(entry)
        return wrong

    def report(self, results):
        if not results:
            print("mutants: there are none" if self.options.changed is None else
                  "mutants: there are none on lines that changed")
            return
        print(survivors_text(results))
        print(table(results))
        not_run = sum(result.status == "not run" for result in results)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        print(f"\n{len(results) - not_run} mutants took {minutes(time.monotonic() - self.begin)},"
              f" and {minutes(used.ru_utime + used.ru_stime)} of processor time.")
        if not_run:
            print(f"{not_run} of {len(results)} were not run.")


def main(arguments, root=ROOT, areas=None):
    def interrupt(*_):
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    try:
        return Tool(root, areas or AREAS, parse(arguments)).main()
    except WrongUse as wrong:
        print(f"dev mutants: {wrong}", file=sys.stderr)
        return USAGE
    except Failure as failure:
        print(f"dev mutants: {failure}", file=sys.stderr)
        return BROKEN_TOOL


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
