#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Tests of sensitivity.py: what it rewrites, what that does when it runs, and what it marks."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import sensitivity  # noqa: E402

SOURCE = """// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cstdint>
#include <cstdio>

#include "versavis/time.hpp"

namespace versavis {

namespace {

// A share. At half less, at twice more.
constexpr double share = 0.25;  // of a gap
constexpr std::int64_t long_one_ns =
    10'000'000'000;  // ten seconds
constexpr int few = 3;
constexpr int one = 1;
constexpr Duration wait = milliseconds(5);
constexpr double derived = 2 * share;
constexpr time_t never = 7;
constexpr double table[] = {1, 2};
constexpr std::size_t slots = 4;
constexpr int twice(int n) { return 2 * n; }

struct Ring {
    static constexpr int inner = 9;
    std::array<int, slots> values{};
};

}  // namespace

}  // namespace versavis

int main() {
    using namespace versavis;
    std::printf("%g %lld %d %d %lld %g %d %zu\\n", share, static_cast<long long>(long_one_ns), few,
                one, static_cast<long long>(wait.ns), derived, twice(Ring::inner),
                Ring{}.values.size());
}
"""


class Rewriting(unittest.TestCase):
    def rewrite(self, text, against=lambda key: None):
        return sensitivity.rewrite(text, "pairing", "a.cpp", against)

    def test_finds_constants_at_column_0_with_their_values(self):
        _, constants, _ = self.rewrite(SOURCE)
        self.assertEqual([(one.name, one.type, one.value) for one in constants], [
            ("share", "double", "0.25"), ("long_one_ns", "std::int64_t", "10'000'000'000"),
            ("few", "int", "3"), ("one", "int", "1"), ("wait", "Duration", "milliseconds(5)"),
            ("derived", "double", "2 * share"), ("slots", "std::size_t", "4")])

    def test_reports_what_it_cannot_scale(self):
        _, _, skipped = self.rewrite(SOURCE, lambda key: "fixed" if key == "a.cpp:few" else None)
        self.assertEqual({one.key: one.reason for one in skipped}, {
            "a.cpp:never": "of type time_t", "a.cpp:few": "fixed",
            "a.cpp:table": "not of the form `constexpr T name = value;`"})

    def test_keeps_inline_of_headers_and_leaves_functions_and_members_alone(self):
        text, constants, skipped = self.rewrite(
            "inline constexpr unsigned a = 2;\nconstexpr int f(int n) { return n; }\n"
            "struct S {\n    static constexpr int b = 1;\n};\n")
        self.assertIn('inline const unsigned a = versavis::sensitivity::scaled<unsigned>('
                      '"a.cpp:a", 2);', text)
        self.assertIn("constexpr int f(int n)", text)
        self.assertIn("    static constexpr int b = 1;", text)
        self.assertEqual([one.name for one in constants], ["a"])
        self.assertEqual(skipped, [])

    def test_a_file_without_constants_stays_as_it_is(self):
        text = "int f();\n"
        self.assertEqual(self.rewrite(text)[0], text)


class Running(unittest.TestCase):
    """Compiles what was rewritten, as the script does."""

    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.TemporaryDirectory()
        cls.program = pathlib.Path(cls.directory.name) / "program"
        cls.first_errors = cls.compile(lambda key: None)
        errors = cls.compile(lambda key: "needed" if key == "a.cpp:slots" else None)
        if errors:
            raise AssertionError(errors)

    @classmethod
    def tearDownClass(cls):
        cls.directory.cleanup()

    @classmethod
    def compile(cls, against):
        text = sensitivity.rewrite(SOURCE, "pairing", "a.cpp", against)[0]
        source = pathlib.Path(cls.directory.name) / "a.cpp"
        source.write_text(text.replace("{scale}", str(HERE / "scale.hpp"), 1))
        return subprocess.run(
            [os.environ.get("CXX", "g++"), "-std=c++20", "-I",
             str(HERE.parents[1] / "libversavis" / "include"), str(source), "-o", str(cls.program)],
            env=dict(os.environ, LC_ALL="C"), capture_output=True, text=True).stderr

    def run_with(self, setting):
        environment = {k: v for k, v in os.environ.items() if k != "VERSAVIS_SCALE"}
        if setting:
            environment["VERSAVIS_SCALE"] = setting
        return subprocess.run([self.program], env=environment, check=True, capture_output=True,
                              text=True).stdout.split()

    def test_the_compiler_names_the_constant_that_it_needs(self):
        names = {"share", "long_one_ns", "few", "one", "wait", "derived", "slots"}
        self.assertEqual(sensitivity.named_in(self.first_errors, names), {"slots"})

    def test_without_a_setting_nothing_changes(self):
        self.assertEqual(self.run_with(None),
                         ["0.25", "10000000000", "3", "1", "5000000", "0.5", "18", "4"])

    def test_scales_the_one_that_is_named_and_what_depends_on_it(self):
        self.assertEqual(self.run_with("a.cpp:share=2"),
                         ["0.5", "10000000000", "3", "1", "5000000", "1", "18", "4"])

    def test_integers_are_rounded_and_at_least_1(self):
        self.assertEqual(self.run_with("a.cpp:few=0.5")[2], "2")
        self.assertEqual(self.run_with("a.cpp:few=2")[2], "6")
        self.assertEqual(self.run_with("a.cpp:one=0.25")[3], "1")

    def test_durations_are_scaled_in_ns(self):
        self.assertEqual(self.run_with("a.cpp:wait=0.5")[4], "2500000")

    def test_the_same_name_in_another_file_is_another_constant(self):
        self.assertEqual(self.run_with("b.cpp:share=2")[0], "0.25")


class Judging(unittest.TestCase):
    BASE = {figure.key: 1.0 for figure in sensitivity.FIGURES["pairing"]} | {"wrong": 0}

    def test_equal_figures_are_no_edge(self):
        self.assertEqual(sensitivity.edges("pairing", self.BASE, self.BASE), set())

    def test_a_wrong_pair_is_an_edge_even_when_it_was_there_before(self):
        wrong = self.BASE | {"wrong": 1}
        self.assertEqual(sensitivity.edges("pairing", wrong, wrong), {"wrong"})

    def test_worse_by_more_than_the_factor_is_an_edge(self):
        self.assertEqual(sensitivity.edges("pairing", self.BASE, self.BASE | {"again": 1.49}),
                         set())
        self.assertEqual(sensitivity.edges("pairing", self.BASE, self.BASE | {"again": 1.51}),
                         {"again"})

    def test_a_sigma_too_wide_is_an_edge_like_one_too_narrow(self):
        base = {figure.key: 1.0 for figure in sensitivity.FIGURES["clock"]}
        self.assertEqual(sensitivity.edges("clock", base, base | {"usb_nees": 0.4}), {"usb_nees"})
        self.assertEqual(sensitivity.edges("clock", base, base | {"usb_nees": 2.1}), {"usb_nees"})

    def test_a_run_that_fails_is_an_edge(self):
        self.assertEqual(sensitivity.edges("pairing", self.BASE, None), {"run"})

    def test_a_summary_names_edges_and_what_nothing_depends_on(self):
        same = {"figures": self.BASE, "edges": []}
        slow = {"factor": 2, "figures": self.BASE | {"first": 2}, "edges": ["first"]}
        rows = [{"file": "a.cpp", "name": "felt", "runs": [same, slow]},
                {"file": "a.cpp", "name": "unfelt", "runs": [same, same]}]
        skipped = [sensitivity.Skipped("pairing", "b.cpp:second_ns", "a unit"),
                   sensitivity.Skipped("clock", "c.cpp:other", "a unit")]
        self.assertEqual(sensitivity.summary("pairing", self.BASE, rows, skipped),
                         "On an edge:\n\n- a.cpp:felt x 2: first 1 -> 2\n\n"
                         "No figure changes with:\n\n- a.cpp:unfelt\n\n"
                         "Not scaled:\n\n- b.cpp:second_ns: a unit")

    def test_tables_keep_to_100_columns_and_mark_edges(self):
        rows = [{"file": "a.cpp", "name": "n" * 60, "value": "milliseconds(100)" * 4, "runs": [
            {"factor": 0.5, "figures": self.BASE | {"first": 123.456}, "edges": ["first"]},
            {"factor": 2, "figures": None, "edges": ["run"]}]}]
        text = sensitivity.table("pairing", self.BASE, rows)
        self.assertLessEqual(max(map(len, text.splitlines())), 100)
        self.assertIn("123!", text)
        self.assertIn("does not end, or fails!", text)


class Choosing(unittest.TestCase):
    ONE = sensitivity.Constant("pairing", "relation.cpp", "outlier_ns", "double", "2e6")

    def test_by_folder_file_name_or_wildcard(self):
        for name in ("pairing", "relation.cpp", "outlier_ns", "outlier*", "relation.cpp:out*"):
            self.assertTrue(sensitivity.wanted(self.ONE, [name]), name)
        for name in ("clock", "pairing.cpp", "outlier", "pairing.cpp:outlier_ns"):
            self.assertFalse(sensitivity.wanted(self.ONE, [name]), name)

    def test_a_section_is_replaced_and_the_rest_is_kept(self):
        document = "# Sensitivity\nText.\n"
        document = sensitivity.with_section(document, "pairing", "old\n")
        document = sensitivity.with_section(document, "clock", "other\n")
        document = sensitivity.with_section(document, "pairing", "new\n")
        self.assertEqual(document, "# Sensitivity\nText.\n\n<!-- pairing: begin -->\nnew\n"
                         "<!-- pairing: end -->\n\n<!-- clock: begin -->\nother\n"
                         "<!-- clock: end -->\n")


if __name__ == "__main__":
    unittest.main()
