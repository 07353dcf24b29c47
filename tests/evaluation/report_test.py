#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Tests of what the evaluation is judged by, and of what it writes: good findings pass, and each
kind of bad ones fails. The figures are made up. Without Debian's matplotlib no diagram is drawn."""
import copy
import importlib.util
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import report  # noqa: E402

RUNS = 2


def leds(offset_us):
    camera = {"wrong_increments": 0}
    return {"cameras": [camera, dict(camera)],
            "pairs": [{"pairs": 410, "matches": 408, "mismatches": 0, "ambiguous": 2,
                       "offset_us": offset_us, "interval_us": 0.9}]}


def offset(mode, key, run):
    """As far off as its sigma says, to either side."""
    expected_s = report.expected_ms(mode, int(key.split("/")[0])) * 1e-3
    return {"timeshift_cam_imu_s": expected_s + (20e-6 if run % 2 else -20e-6),
            "timeshift_cam_imu_sigma_s": 20e-6}


def spread(rms_ns):
    return {"count": 100, "rms_ns": rms_ns, "p99_ns": 2.5 * rms_ns}


def findings():
    return {"runs": RUNS, "seconds": 30.0, "parts": list(report.PARTS), "failed": [],
            "leds": {name: leds(expected or 0.4) for name, expected in report.LED_CASES.items()},
            "imu": {mode: {key: [offset(mode, key, run) for run in range(RUNS)]
                           for key in report.imu_keys()} for mode in report.MODES},
            "clock": {"duration_s": 120.0, "innovation": spread(5e3), "residual": spread(30e3),
                      "live_against_smoothed": spread(2e3), "pps_published": spread(4e3),
                      "pps_by_all_messages": spread(1e3)}}


def shift(found, mode, by_s):
    for runs in found["imu"][mode].values():
        for run in runs:
            run["timeshift_cam_imu_s"] += by_s


class Judging(unittest.TestCase):
    def setUp(self):
        self.found = findings()

    def fails(self, *words):
        faults = "\n".join(report.faults(self.found))
        self.assertFalse(report.passed(self.found))
        for word in words:
            self.assertIn(word, faults)
        self.assertIn(words[0], report.summary(self.found))
        self.legible()

    def legible(self):
        for text in (report.summary(self.found), report.text(self.found)):
            for word in ("None", "nan", "inf"):
                self.assertNotRegex(text, rf"\b{word}\b")
            # Tables are whole: each of their lines has the cells of the line above it.
            lines = text.splitlines()
            for above, line in zip(lines, lines[1:]):
                if above.startswith("|") and line.startswith("|"):
                    self.assertEqual(above.count("|"), line.count("|"), line)

    def pair(self, name="fine"):
        return self.found["leds"][name]["pairs"][0]

    def test_good_findings_pass(self):
        self.assertEqual(report.faults(self.found), [])
        self.assertTrue(report.summary(self.found).endswith("\nok"))
        self.legible()

    def test_too_few_pairs(self):
        self.pair().update(pairs=399, matches=399, ambiguous=0)
        self.fails("LED board, fine: 399 pairs match")

    def test_no_pair(self):
        self.pair().update(pairs=0, matches=0, ambiguous=0, offset_us=None, interval_us=None)
        self.fails("LED board, fine: 0 pairs match")

    def test_one_camera_only(self):
        self.found["leds"]["published"]["pairs"] = []
        self.fails("LED board, published: no pairs")

    def test_mismatches(self):
        self.pair("published")["mismatches"] = 1
        self.fails("1 pairs do not match")

    def test_ambiguous_pairs(self):
        self.pair("published").update(pairs=500, matches=480, ambiguous=20)
        self.fails("20 pairs are ambiguous")

    def test_increments_against_stamps(self):
        self.found["leds"]["published"]["cameras"][1]["wrong_increments"] = 2
        self.fails("2 increments contradict")

    def test_offset_between_cameras(self):
        self.pair()["offset_us"] = -6.1
        self.fails("LED board, fine: the offset is -6.1 ± 0.9 us, not 0 us")

    def test_offset_not_seen(self):
        for name in ("fine", "late line", "late line, configured"):
            for unseen in ({"offset_us": None, "interval_us": None}, {"interval_us": None},
                           {"interval_us": 5.1}):
                with self.subTest(name=name, unseen=unseen):
                    self.found = findings()
                    self.pair(name).update(unseen)
                    self.fails(f"LED board, {name}: the offset is not seen")

    def test_late_line_not_found(self):
        for wrong in (0, 27, -33.1, -21):
            with self.subTest(wrong=wrong):
                self.pair("late line")["offset_us"] = wrong
                self.fails("not -27 us")

    def test_late_line_not_removed(self):
        self.pair("late line, configured")["offset_us"] = -27
        self.fails("late line, configured: the offset is -27.0")

    def test_error_between_camera_and_imu(self):
        shift(self.found, "on", 70e-6)
        for runs in self.found["imu"]["on"].values():
            for run in runs:
                run["timeshift_cam_imu_sigma_s"] = 70e-6
        self.fails("camera and IMU, corrected, read on the board's grid: rms error 73 us, above")

    def test_filter_delay_not_as_in_theory(self):
        shift(self.found, "off", -report.AGE_MS * 1e-3)
        self.fails("camera and IMU, nothing corrected: rms error 611 us")

    def test_sigma_that_promises_too_much(self):
        for runs in self.found["imu"]["paced"].values():
            for run in runs:
                run["timeshift_cam_imu_sigma_s"] = 13e-6
        self.fails("camera and IMU, corrected, paced by data-ready: rms error 20 us, but sigma")

    def test_offset_refused(self):
        self.found["imu"]["off"]["2/0"].pop()
        self.fails("23 offsets, not 24")

    def test_offset_of_nothing(self):
        for run in self.found["imu"]["off"]["2/0"]:
            run["timeshift_cam_imu_s"] = None
        self.fails("22 offsets, not 24")
        self.assertIn("not seen", report.imu_rows(self.found, "off"))

    def test_clock(self):
        self.found["clock"]["pps_published"] = spread(20.5e3)
        self.fails("clock: true error 20.5 us")

    def test_clock_without_pps(self):
        for unseen in ({"count": 0, "rms_ns": 0, "p99_ns": 0},
                       {"count": 9, "rms_ns": None, "p99_ns": None}):
            with self.subTest(unseen=unseen):
                self.found["clock"]["pps_published"] = unseen
                self.fails("clock: the true error is not seen")

    def test_what_failed(self):
        self.found["failed"] = ["camera and IMU, filter 4, on, run 2, cam0: refused"]
        self.fails("filter 4, on, run 2")

    def test_nothing_was_found(self):
        self.found = {"runs": 1, "seconds": 30.0}
        self.fails("LED board, published: no pairs", "0 offsets, not 12", "clock: the true error")

    def test_only_what_was_measured_is_judged(self):
        self.found = {"runs": 1, "seconds": 30.0, "parts": ["clock"],
                      "clock": findings()["clock"]}
        self.assertEqual(report.faults(self.found), [])

    def test_number_of_offsets(self):
        rows = report.imu_rows(self.found, "off").splitlines()
        self.assertEqual([row.split("|")[3].strip() for row in rows], ["8", "8", "8"])


class Writing(unittest.TestCase):
    @unittest.skipUnless(importlib.util.find_spec("matplotlib"), "apt install python3-matplotlib")
    def test_document_and_diagram_from_saved_figures(self):
        found = findings()
        found["imu"]["paced"]["4/5"] = []
        with tempfile.TemporaryDirectory() as directory:
            docs = pathlib.Path(directory)
            before = copy.deepcopy(found)
            report.write(found, docs)
            self.assertEqual(found, before)
            self.assertEqual((docs / "results.md").read_text(), report.text(found))
            self.assertIn("<svg", (docs / "images" / "camera-imu.svg").read_text())


class Options(unittest.TestCase):
    def test_saved_figures_that_are_none(self):
        with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
            file.write("{")
            file.flush()
            done = subprocess.run([HERE / "evaluate.py", "--report-only", file.name],
                                  capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertTrue(done.stderr.startswith("evaluate: "), done.stderr)


if __name__ == "__main__":
    unittest.main()
