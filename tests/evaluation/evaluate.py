#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs the published evaluation on the virtual rig, and writes docs/results.md and its pictures.

Each measurement is what a user would do: start the rig's hardware and the service, record, and let
`versavis evaluate` look at the recording. Debian's own Python runs this: it is the one that has
Debian's PIL and matplotlib.
"""
import argparse
import contextlib
import dataclasses
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True

import report  # noqa: E402

# As published.
LED_FPS = 10
# Of the LED board, beyond the pairs that must match. Half: some ambiguous pictures make a run bad.
# Twice: it takes a second longer.
SPARE_S = 1.5
# Until cameras are paired and the clock is settled. Half: some frames of the beginning are
# suspect. Twice: only time is lost.
SETTLING_S = 8
# Until the service says that all is well, on a busy host.
PATIENCE_S = 60


class Failure(Exception):
    pass


def camera(index, rig, service):
    """A camera on the rig, and what the service is configured with."""
    name, address = f"cam{index}", f"127.0.0.{index + 2}"
    scenario = {"name": name, "address": address, "output": index, "width": 640, "height": 480,
                "noise": 2.0} | rig
    configuration = {"name": name, "device": address, "output": index, "latency_us": 20.0,
                     "strobe_rising_us": [0.0, 0.0], "strobe_falling_us": [0.0, 0.0],
                     "packet_size": 9000} | service
    return scenario, configuration


def table(name, entries):
    lines = [name]
    lines += [f"{key} = {json.dumps(value)}" for key, value in entries.items()]
    return "\n".join(lines) + "\n\n"


@dataclasses.dataclass
class Setup:
    """What is on the rig, and how the service is configured; both are files in TOML."""
    cameras: list
    imu: dict = dataclasses.field(default_factory=dict)
    rig: str = ""
    service: str = ""
    seed: int = 1

    def scenario(self):
        text = f"seed = {self.seed}\nimu = \"imu0\"\n\n{self.rig}\n"
        return text + "".join(table("[[camera]]", rig) for rig, _ in self.cameras)

    def configuration(self, socket):
        text = "instance = \"evaluation\"\n\n"
        text += table("[board]", {"link": f"unix:{socket}"}) + self.service + "\n"
        text += "".join(table("[[camera]]", service) for _, service in self.cameras)
        imu = {"name": "imu0", "model": "adis16448b", "rate_hz": 200.0} | self.imu
        return text + table("[[imu]]", imu)


class Bench:
    """Rig and service in a directory of their own, while they run."""

    def __init__(self, programs, directory):
        self.programs, self.directory, self.running = programs, directory, []

    def start(self, name, arguments):
        log = self.directory / f"{name}.log"
        with log.open("w") as file:
            process = subprocess.Popen([self.programs / name, *map(str, arguments)],
                                       stdout=file, stderr=subprocess.STDOUT)
        self.running.append((process, log))

    def tool(self, *arguments):
        return subprocess.run([self.programs / "versavis", *map(str, arguments)],
                              capture_output=True, text=True)

    def check(self):
        for process, log in self.running:
            if process.poll() is not None:
                raise Failure(f"{process.args[0]} ended with {process.returncode}:\n"
                              f"{log.read_text()[-2000:]}")

    def await_health(self):
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            self.check()
            status = self.tool("--instance", "evaluation", "status", "--json")
            if status.returncode == 0:
                return
            time.sleep(0.5)
        raise Failure("the service is not well:\n" + status.stdout[-2000:] + status.stderr)

    def record(self, setup, seconds):
        """Path of a recording of so many seconds."""
        scenario, configuration = self.directory / "rig.toml", self.directory / "service.toml"
        socket, recording = self.directory / "board.socket", self.directory / "recording.mcap"
        scenario.write_text(setup.scenario())
        configuration.write_text(setup.configuration(socket))
        self.start("versavis-rig", ["run", scenario, "--socket", socket])
        self.start("versavisd", ["--config", configuration])
        try:
            self.await_health()
            time.sleep(SETTLING_S)
            recorded = self.tool("--instance", "evaluation", "record", "-o", recording,
                                 "--seconds", seconds, "--json")
            self.check()
        finally:
            self.stop()
        if recorded.returncode != 0:
            raise Failure(f"versavis record: {recorded.stderr}{recorded.stdout}")
        return recording

    def stop(self):
        for process, _ in reversed(self.running):
            process.terminate()
        for process, _ in self.running:
            process.wait()
        self.running.clear()

    def evaluate(self, what, recording, *options):
        """The report of `versavis evaluate`; 1 only says that not all is as it should be."""
        done = self.tool("evaluate", what, recording, "--json", *options)
        if done.returncode not in (0, 1):
            raise Failure(f"versavis evaluate {what}: {done.stderr}")
        return json.loads(done.stdout)


class Evaluation:
    def __init__(self, options):
        self.options = options
        self.found = {"runs": options.runs, "seconds": options.seconds, "parts": options.parts,
                      "failed": []}
        self.total = self.done = 0
        self.what = ""

    @contextlib.contextmanager
    def reported(self, detail=""):
        """What cannot be measured is reported, and the rest goes on."""
        try:
            yield
        except Failure as failure:
            what = ", ".join(filter(None, (self.what, detail)))
            self.found["failed"].append(f"{what}: {str(failure).strip()}")
            print(f"evaluate: {self.found['failed'][-1]}", file=sys.stderr, flush=True)

    @contextlib.contextmanager
    def bench(self, what):
        self.done += 1
        self.what = what
        print(f"evaluate: {self.done} of {self.total}: {what}", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory(prefix="versavis-evaluation-") as directory:
            bench = Bench(self.options.programs, pathlib.Path(directory))
            try:
                yield bench
            finally:
                bench.stop()

    def save(self):
        """As a whole, whatever happens meanwhile."""
        new = self.options.json.with_name(self.options.json.name + ".new")
        new.write_text(json.dumps(self.found, indent=1) + "\n")
        new.replace(self.options.json)

    def run(self):
        parts = [getattr(self, part)() for part in self.options.parts]
        self.total = sum(len(part) for part in parts)
        for part in parts:
            for measure in part:
                with self.reported():
                    measure()
                self.save()
        return self.found

    # LED board: two cameras, one of which sees it upside down.
    def leds(self):
        fast = {"rate_hz": 1000.0, "exposure_us": 1000.0}
        fine = {"rate_hz": 970.0, "exposure_us": 1100.0}
        rising, falling = map(float, report.LINE_DELAY_US)
        late = {"line_rising_us": rising, "line_falling_us": falling}
        known = {"strobe_rising_us": [rising, 0.0], "strobe_falling_us": [falling, 0.0]}
        cases = [("published", fast, {}, {}), ("fine", fine, {}, {}),
                 ("late line", fine, late, {}), ("late line, configured", fine, late, known)]
        return [lambda case=case: self.measure_leds(*case) for case in cases]

    def measure_leds(self, name, light, rig, service):
        boards = ([95.0, 300.0, 545.0, 330.0], [480.0, 140.0, 160.0, 120.0])
        triggered = {"rate_hz": float(LED_FPS), "exposure_us": light["exposure_us"]}
        cameras = [camera(i, {"exposure_us": light["exposure_us"], "leds": leds}
                          | (rig if i == 1 else {}), triggered | (service if i == 1 else {}))
                   for i, leds in enumerate(boards)]
        setup = Setup(cameras, rig="[motion]\nrate_rad_s = [0.3, 0.3, 0.3]\n[leds]\n",
                      service=f"[ports]\ntest_rate_hz = {light['rate_hz']}\n")
        with self.bench(f"LED board, {name}") as bench:
            recording = bench.record(setup, report.LED_PAIRS / LED_FPS + SPARE_S)
            # A line whose edges are late by different times also misstates how long it was.
            true = ("--exposure", f"cam1={light['exposure_us']}") if rig else ()
            self.found.setdefault("leds", {})[name] = bench.evaluate("leds", recording, *true)
            if name == "fine":
                self.keep_pictures(bench, recording)

    def keep_pictures(self, bench, recording):
        exported = bench.directory / "export"
        done = bench.tool("export", recording, exported, "--to", "euroc")
        if done.returncode != 0:
            raise Failure(f"versavis export: {done.stderr}")
        pictures = [sorted((exported / "mav0" / name / "data").glob("*.png"))[50]
                    for name in ("cam0", "cam1")]
        report.write_led_picture(pictures, self.options.images)

    # Camera against IMU: four cameras, one for each exposure time.
    def imu(self):
        # The service corrects nothing; what it knows of the part; the same with data-ready.
        modes = {"off": {"filter_delay_us": 0.0}, "on": {}, "paced": {"data_ready": True}}
        return [lambda m=mode, s=settings, f=strength, r=run: self.measure_imu(m, s, f, r)
                for run in range(self.options.runs)
                for mode, settings in modes.items() for strength in report.FILTERS]

    def measure_imu(self, mode, settings, strength, run):
        cameras = []
        for index, exposure_ms in enumerate(report.EXPOSURES_MS):
            us = exposure_ms * 1000.0 or 3000.0
            swing = {} if exposure_ms else {"exposure_swing": 0.6}
            cameras.append(camera(index, {"width": 320, "height": 240, "focal_px": 200.0,
                                          "exposure_us": us} | swing,
                                  {"rate_hz": 20.0, "exposure_us": us}))
        motion = "[motion]\nrate_rad_s = [0.6, 0.6, 0.6]\nhighest_hz = 2.0\n"
        setup = Setup(cameras, settings | {"filter": strength}, motion, seed=run + 1)
        with self.bench(f"camera and IMU, filter {strength}, {mode}, run {run + 1}") as bench:
            recording = bench.record(setup, self.options.seconds)
            for index, exposure_ms in enumerate(report.EXPOSURES_MS):
                with self.reported(f"cam{index}"):
                    seen = bench.evaluate("imu", recording, "--camera", f"cam{index}",
                                          "--focal", 200)
                    self.found.setdefault("imu", {}).setdefault(mode, {}).setdefault(
                        f"{strength}/{exposure_ms}", []).append(
                            {key: seen[key] for key in ("timeshift_cam_imu_s",
                                                        "timeshift_cam_imu_sigma_s")})

    # Clock: whole seconds of a GNSS receiver show the true error.
    def clock(self):
        return [self.measure_clock]

    def measure_clock(self):
        setup = Setup([camera(0, {"width": 320, "height": 240}, {"rate_hz": 20.0,
                                                                 "exposure_us": 3000.0})],
                      rig="[board]\ngnss = true\n",
                      service="[ports]\ninputs = [\"pps\"]\nnmea = true\n")
        with self.bench("clock") as bench:
            recording = bench.record(setup, self.options.clock_seconds)
            self.found["clock"] = bench.evaluate("clock", recording)


def options():
    parser = argparse.ArgumentParser(
        prog="./dev evaluate", description=__doc__.split("\n")[0],
        epilog="It takes 45 s for each recording: 25 minutes with three runs.")
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[*report.PARTS, []],
                        help=f"only these: {', '.join(report.PARTS)} (then docs/ stays as it is)")
    parser.add_argument("--runs", type=int, default=3, metavar="N",
                        help="recordings for each strength of the IMU's filter (default 3)")
    parser.add_argument("--seconds", type=float, default=30, metavar="S",
                        help="length of a recording of camera and IMU (default 30)")
    parser.add_argument("--clock-seconds", type=float, default=120, metavar="S",
                        help="length of the recording of the clock (default 120)")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE",
                        help="all figures, saved after each recording (default "
                             "build/evaluation.json, of parts build/evaluation-PART.json)")
    parser.add_argument("--report-only", type=pathlib.Path, metavar="FILE",
                        help="measure nothing: write docs/results.md and its diagram anew from "
                             "such a file; the picture of the LED board stays")
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build" / "bin",
                        help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.runs < 1 or not chosen.seconds >= 10 or not chosen.clock_seconds >= 30:
        parser.error("at least 1 run, 10 s for camera and IMU, and 30 s for the clock")
    chosen.whole = not chosen.parts
    if not chosen.json:
        name = "-".join(["evaluation", *chosen.parts]) + ".json"
        chosen.json = chosen.programs.parent / name
    chosen.parts = chosen.parts or list(report.PARTS)
    chosen.images = ROOT / "docs" / "images" if chosen.whole else None
    return chosen


def measure(chosen):
    print(f"evaluate: figures go to {chosen.json}", file=sys.stderr)
    found = Evaluation(chosen).run()
    if chosen.whole and not found["failed"]:
        report.write(found, ROOT / "docs")
    elif chosen.whole:
        print("evaluate: docs/results.md is left as it is; --report-only writes it all the same",
              file=sys.stderr)
    return found


def main():
    chosen = options()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        if chosen.report_only:
            found = json.loads(chosen.report_only.read_text())
            report.write(found, ROOT / "docs")
        else:
            found = measure(chosen)
    except KeyboardInterrupt:
        return 130
    except (OSError, ValueError) as error:
        print(f"evaluate: {error}", file=sys.stderr)
        return 1
    print(report.summary(found))
    return 0 if report.passed(found) else 1


if __name__ == "__main__":
    sys.exit(main())
