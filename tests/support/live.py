# SPDX-License-Identifier: BSD-3-Clause
"""Virtual rig and service as processes of a test in Python, with addresses and names of their
own."""
import ctypes
import os
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

PR_SET_PDEATHSIG = 1

SCENARIO = 'imu = "imu0"\n'
CAMERA_SCENARIO = """[[camera]]
name = "cam{i}"
address = "127.0.{subnet}.{host}"
output = {i}
width = {width}
height = {height}
exposure_us = 3000
"""
CONFIGURATION = """instance = "{name}"
state_directory = "{directory}"
[board]
link = "unix:{directory}/board"
"""
CAMERA = """[[camera]]
name = "cam{i}"
device = "127.0.{subnet}.{host}"
output = {i}
latency_us = 20
packet_size = 9000
rate_hz = 20
exposure_us = 3000
strobe_rising_us = [0, 0]
strobe_falling_us = [0, 0]
"""
IMU = """[[imu]]
name = "imu0"
"""


def until(condition, seconds, what):
    """Looks again and again; returns what the condition gives once that is true."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.005)
    raise AssertionError(f"not in {seconds} s: {what}")


def die_with_parent():
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


class Live:
    """Two cameras and an IMU."""

    def __init__(self, programs, name, subnet, width=320, height=240):
        self.programs = Path(programs)
        self.name = name
        self.directory = Path(tempfile.mkdtemp(prefix="versavis-"))
        self.service = self.rig = None
        self._remove_rings()  # of a test that was killed
        values = {"name": name, "subnet": subnet, "width": width, "height": height,
                  "directory": self.directory}
        numbers = [{"i": i, "host": i + 2, **values} for i in range(2)]
        scenario = SCENARIO + "".join(CAMERA_SCENARIO.format(**n) for n in numbers)
        cameras = "".join(CAMERA.format(**n) for n in numbers)
        (self.directory / "scenario.toml").write_text(scenario)
        configuration = CONFIGURATION.format(**values) + cameras + IMU
        (self.directory / "versavis.toml").write_text(configuration)

    def start_rig(self):
        self.rig = self._start("rig ready", "versavis-rig", "run", self.directory / "scenario.toml",
                               "--socket", self.directory / "board",
                               "--truth", self.directory / "truth.jsonl")

    def start_service(self, environment=None):
        """environment: variables beside those of this process."""
        self.service = self._start("serving instance", "versavisd", "--config",
                                   self.directory / "versavis.toml", environment=environment)

    def kill_service(self):
        self.service.kill()
        self.service.wait(10)

    def stop(self):
        for process in (self.service, self.rig):
            if process is not None and process.poll() is None:
                process.terminate()
                process.wait(20)
        shutil.rmtree(self.directory, ignore_errors=True)
        self._remove_rings()

    def _remove_rings(self):
        shutil.rmtree(Path("/dev/shm/versavis") / self.name, ignore_errors=True)

    def _start(self, ready, program, *arguments, environment=None):
        log = self.directory / (program + ".log")
        with log.open("wb") as file:
            process = subprocess.Popen([self.programs / program, *arguments], stdout=file,
                                       stderr=subprocess.STDOUT, preexec_fn=die_with_parent,
                                       env={**os.environ, **(environment or {})})
        until(lambda: ready in log.read_text(), 20, f"{program} says '{ready}'; see {log}")
        return process
