#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks dev mutants: which mutants it finds, and how it judges those of a small project."""
import contextlib
import io
import json
import os
import pathlib
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import mutants  # noqa: E402
import source_mutants  # noqa: E402


def found(text):
    return source_mutants.find("a.cpp", text)


def mutated(text, kind=None):
    return [one.mutated for one in found(text) if kind in (None, one.kind)]


def in_body(statements, kind=None):
    return mutated(f"int f() {{\n{statements}\nreturn end;\n}}\n", kind)


class OwnEntries(unittest.TestCase):
    def test_each_entry_of_the_project_is_of_a_mutant_that_there_is(self):
        tool = mutants.Tool(mutants.ROOT, [], mutants.parse([]))
        entries = mutants.read_entries((mutants.ROOT / mutants.EQUIVALENT).read_text())
        self.assertGreater(len(entries), 300)
        self.assertEqual([(entry.line, entry.key) for entry in tool.stale(entries)], [])


class Finding(unittest.TestCase):
    def test_comparisons_become_their_neighbours_and_their_opposites(self):
        self.assertEqual(mutated("bool b = x < y;"), ["bool b = x <= y;", "bool b = x >= y;"])
        self.assertEqual(mutated("bool b = x >= y;"), ["bool b = x < y;", "bool b = x > y;"])
        self.assertEqual(mutated("bool b = x == y;"), ["bool b = x != y;"])

    def test_templates_pointers_and_references_are_no_operators(self):
        self.assertEqual(mutated("std::array<A<B>, n>& f(T* t, U&& u, const V& v);"), [])
        self.assertEqual(mutated("template <class T, std::size_t N = 4>\nT f(T (&a)[N]);"), [])
        self.assertEqual(mutated("bool operator==(const A& a, const A& b);"), [])
        self.assertEqual(mutated("A& operator<<(A& a, int b);"), [])
        self.assertEqual(mutated("auto f() -> std::vector<A*>;"), [])

    def test_constants(self):
        def of(literal):
            return [one.removeprefix("int i = ").removesuffix(";")
                    for one in mutated(f"int i = {literal};")]
        self.assertEqual(of("0"), ["1"])
        self.assertEqual(of("1"), ["0", "2"])
        self.assertEqual(of("7U"), ["0U", "6U", "8U"])
        self.assertEqual(of("0x1F"), ["0x0", "0x1e", "0x20"])
        self.assertEqual(of("1'000'000"), ["0", "2000000"])
        self.assertEqual(of("true"), ["false"])
        for literal in ("0.5", "1e6", "017", "'1'", '"1"'):
            self.assertEqual(of(literal), [], literal)
        self.assertEqual(mutated("int i = x / 3;", "constant"),
                         ["int i = x / 2;", "int i = x / 4;"])

    def test_arithmetic_and_logic(self):
        self.assertEqual(mutated("int i = -a + b * c;"),
                         ["int i = a + b * c;", "int i = -a - b * c;", "int i = -a + b / c;"])
        self.assertEqual(mutated("bool b = !x && y;"), ["bool b = x && y;", "bool b = !x || y;"])
        self.assertEqual(mutated("int i = a & ~b;"), ["int i = a | ~b;", "int i = a & b;"])
        self.assertEqual(in_body("a += b;", "arithmetic"), ["a -= b;"])
        self.assertEqual(in_body("++a;", "arithmetic"), ["--a;"])
        self.assertEqual(in_body("for (; a;) f();"), ["for (; a;) ;"])
        self.assertEqual(in_body("for (; a; ++b) {\n}"), [])

    def test_statements_are_dropped_and_declarations_are_not(self):
        for kept in ("int i = a;", "const auto a = b;", "A::B<C> c(d);", "A& a = b;", "A* a = b;",
                     "auto [a, b] = c;", "std::lock_guard lock(a);", "using A = B;",
                     "static_assert(sizeof(A) == 4);"):
            self.assertEqual(in_body(kept), [], kept)
        for dropped in ("a = b;", "a.b = c;", "a[b] = c;", "f(a);", "A::f(b);", "*a = b;",
                        "a->f();", "a =\n    b;", "f<A>(b);"):
            self.assertEqual(in_body(dropped), [";"], dropped)

    def test_early_returns_are_dropped_and_the_last_is_not(self):
        self.assertEqual(mutated("int f() {\n    if (g()) return a;\n    return b;\n}"),
                         ["if (!(g())) return a;", "if (g()) ;"])
        self.assertEqual(in_body("for (;;) {\ncontinue;\nbreak;\n}"), [";", ";"])

    def test_branches(self):
        self.assertEqual(in_body("if (a && b) {\n}", "branch"), ["if (!(a && b)) {"])
        self.assertEqual(in_body("if (a < b) {\n}", "branch"), [], "the comparison says the same")
        self.assertEqual(in_body("if (!a) {\n}", "branch"), [])
        self.assertEqual(in_body("if (const A* a = f(); a) {\n}"),
                         ["if (const A* a = f(); !(a)) {"])
        self.assertEqual(in_body("if (const A* a = f()) {\n}"), [])
        self.assertEqual(mutated("int i = a ? f(b, c) : d ? e : g;"),
                         ["int i = a ? d ? e : g : f(b, c);", "int i = a ? f(b, c) : d ? g : e;"])

    def test_lambdas_have_bodies_and_initialisers_have_none(self):
        self.assertEqual(in_body("const auto f = [&](int i) {\na = i;\n};"), [";"])
        self.assertEqual(in_body("const auto f = [] { g(); };"), ["const auto f = [] { ; };"])
        self.assertEqual(in_body("const A a{b, c};"), [])
        self.assertEqual(in_body("a = {b, c};"), [";"])

    def test_classes(self):
        self.assertEqual(mutated(
            "class A : public B {\n public:\n    A(int a) : a_(a), b_{a + 1} { f(); }\n"
            "    ~A();\n    virtual int f() const = 0;\n    A(const A&) = delete;\n"
            "    bool operator()() const { return !a_; }\n"
            " private:\n    enum class E { x = 4 };\n    int a_ = 0;\n};"),
            ["A(int a) : a_(a), b_{a - 1} { f(); }", "A(int a) : a_(a), b_{a + 0} { f(); }",
             "A(int a) : a_(a), b_{a + 2} { f(); }", "A(int a) : a_(a), b_{a + 1} { ; }",
             "bool operator()() const { return a_; }",
             "enum class E { x = 0 };", "enum class E { x = 3 };", "enum class E { x = 5 };",
             "int a_ = 1;"])

    def test_nothing_in_comments_directives_and_the_like(self):
        self.assertEqual(mutated('// a < 1\n/* b + 1\n */\n#include "a1.hpp"\n#if A < 1 && \\\n'
                                 '    B < 2\n#endif\nnamespace a::b {\nusing A = B<3>;\n'
                                 'static_assert(1 < 2);\nconst char* s = "1 < 2";\n'
                                 'const char* r = R"(1 < "2")";\n}'), [])

    def test_a_mutant_changes_one_place_and_keeps_the_lines(self):
        text = "void f() {\n    g(a,\n      b);\n    h(1);\n}\n"
        self.assertEqual(found(text)[0].apply(text), "void f() {\n    ;\n\n    h(1);\n}\n")
        self.assertEqual((found(text)[0].line, found(text)[0].last_line), (2, 3))

    def test_names_survive_shifted_lines_and_other_comments(self):
        text = "void f() {\n    a = 1;  // one\n    b = 2;\n    a = 1;\n}\n"
        keys = [one.key for one in found(text)]
        self.assertEqual(len(keys), len(set(keys)))
        self.assertIn(("a.cpp", "a = 1;", "constant: 1 -> 2 (2)"), keys)
        self.assertEqual(keys, [one.key for one in found("\n// more\n" + text.replace("one", "1"))])


SOURCES = {
    "CMakeLists.txt": """cmake_minimum_required(VERSION 3.20)
project(small CXX)
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
add_compile_options(-ffile-prefix-map=${PROJECT_SOURCE_DIR}=.)
find_package(Catch2 REQUIRED)
add_library(core STATIC core/gate.cpp)
target_include_directories(core PUBLIC core)
add_executable(core_tests tests/gate.cpp tests/other.cpp)
target_link_libraries(core_tests PRIVATE core Catch2::Catch2WithMain)
""",
    "core/gate.hpp": """#pragma once
struct Gate {
    static constexpr int slots = 3;
    int values[slots] = {};
    int level = 7;
    int twice() const { return 2 * level; }
    void fill(int value);
    static_assert(slots > 0);
};
int unused(int value);
""",
    "core/gate.cpp": """#include "gate.hpp"

void Gate::fill(int value) {
    for (int i = 0; i < slots; i += 1) values[i] = value;
    level = value;
    level = value;
}

int unused(int value) {
    const int twice = 2 * value;
    return twice > 10 ? twice : 10;
}
""",
    "tests/gate.cpp": """#include "gate.hpp"

#include <catch2/catch.hpp>

TEST_CASE("gate: all slots are filled") {
    Gate gate;
    CHECK(gate.level == 7);
    gate.fill(5);
    for (int value : gate.values) CHECK(value == 5);
    CHECK(gate.twice() == 10);
}
""",
    "tests/other.cpp": """#include <catch2/catch.hpp>

#include "gate.hpp"

TEST_CASE("other: a gate knows its level") {
    Gate gate;
    gate.fill(2);
    CHECK(gate.level == 2);
    CHECK(sizeof(Gate) == 4 * sizeof(int));
}
""",
}
AREA = mutants.Area("core", "core_tests")


class Project(unittest.TestCase):
    """Runs the tool on a small project."""

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.temporary.name)
        for file, text in SOURCES.items():
            (cls.root / file).parent.mkdir(exist_ok=True)
            (cls.root / file).write_text(text)
        (cls.root / ".gitignore").write_text("build/\n")
        cls.git("init", "-q")
        cls.commit()
        cls.code, cls.output = cls.run_tool("--json", str(cls.root / "build.json"))
        cls.results = {(one["line"], one["mutation"]): one for one in json.loads(
            (cls.root / "build.json").read_text())["mutants"]}
        (cls.root / "build.json").unlink()

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def tearDown(self):
        (self.root / mutants.EQUIVALENT).unlink(missing_ok=True)
        for file, text in SOURCES.items():
            (self.root / file).write_text(text)

    @classmethod
    def git(cls, *arguments):
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments],
                       cwd=cls.root, check=True)

    @classmethod
    def commit(cls):
        cls.git("add", "-A")
        cls.git("commit", "-q", "--allow-empty", "-m", "a")

    @classmethod
    def run_tool(cls, *arguments):
        """Exit code and output."""
        output = io.StringIO()
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            code = mutants.main(arguments, cls.root, [AREA])
        return code, output.getvalue()

    def write_entry(self, text):
        path = self.root / mutants.EQUIVALENT
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def status(self, line, mutation):
        return self.results[line, mutation]["status"]

    def test_what_a_test_notices_is_killed_by_it(self):
        self.assertEqual(self.code, 1, self.output)
        self.assertEqual(self.status(4, "constant: 0 -> 1"), "killed")
        self.assertEqual(self.results[4, "constant: 0 -> 1"]["by"], "tests/gate.cpp:9")
        self.assertEqual(self.status(4, "statement: dropped"), "killed")

    def test_named_constants_that_are_tuned_are_left_alone(self):
        (self.root / "core/gate.hpp").write_text(
            "constexpr int limit = 3;\nint f() {\n    constexpr int at = 5;\n}\n")

        def lines(is_tuned):
            area = mutants.Area("core", "core_tests", is_tuned=is_tuned)
            chosen = mutants.Tool(self.root, [area], mutants.parse(["gate.hpp"])).chosen()
            return {mutant.line for mutant in chosen[area]}
        self.assertEqual(lines(False), {1, 3})
        self.assertEqual(lines(True), {3})

    def test_what_does_not_end_is_killed(self):
        self.assertIn("no end", self.results[4, "constant: 1 -> 0"]["by"])

    def test_what_no_test_gets_to_survives_and_says_so(self):
        self.assertEqual(self.status(11, "comparison: > -> <="), "survived")
        self.assertIn("core/gate.cpp:11: comparison: > -> <=  (no test gets there)\n"
                      "  - return twice > 10 ? twice : 10;\n"
                      "  + return twice <= 10 ? twice : 10;\n", self.output)

    def test_the_same_code_is_known(self):
        self.assertEqual(self.status(5, "statement: dropped"), "same")

    def test_what_does_not_compile_is_not_killed(self):
        self.assertEqual(self.status(3, "constant: 3 -> 0"), "invalid")

    def test_headers(self):
        self.assertEqual(self.status(5, "constant: 7 -> 8"), "killed")
        self.assertEqual(self.status(6, "constant: 2 -> 3"), "killed")

    def test_classes_of_another_size_are_compiled_into_all_tests(self):
        self.assertEqual(self.results[3, "constant: 3 -> 4"]["by"], "tests/other.cpp:9")

    def test_listed_ones_need_a_reason_and_are_no_survivors(self):
        entry = "core/gate.cpp: return twice > 10 ? twice : 10;\n    comparison: > -> <=\n"
        self.write_entry(f"# Why\n{entry}    Nobody\n    asks.\n")
        code, output = self.run_tool("gate.cpp", "--json", str(self.root / "build" / "a.json"))
        self.assertEqual(code, 1, output)
        counts = json.loads((self.root / "build" / "a.json").read_text())["counts"]
        self.assertEqual(counts["listed"], 1)
        self.assertNotIn("comparison: > -> <=", output)
        self.write_entry(entry)
        code, output = self.run_tool("gate.cpp")
        self.assertEqual(code, mutants.BROKEN_TOOL)
        self.assertIn("equivalent.txt:1: an entry has", output)

    def test_entries_without_a_mutant_are_stale(self):
        self.write_entry("core/gate.cpp: return twice;\n    comparison: > -> >=\n    So it is.\n"
                         "core/gone.cpp: a = 1;\n    constant: 1 -> 2\n    So it is.\n")
        code, output = self.run_tool("--changed", "HEAD")
        self.assertEqual(code, 1)
        self.assertIn("equivalent.txt:1: there is no such mutant any more", output)
        self.assertIn("equivalent.txt:4: there is no such mutant any more", output)

    def test_entries_of_mutants_that_are_killed_are_wrong(self):
        self.write_entry("core/gate.cpp: for (int i = 0; i < slots; i += 1) values[i] = value;\n"
                         "    constant: 0 -> 1\n    It is said so.\n")
        code, output = self.run_tool("gate.cpp")
        self.assertEqual(code, 1)
        self.assertIn("equivalent.txt:1: this mutant is not equivalent: tests/gate.cpp:9", output)

    def test_only_changed_lines(self):
        path = self.root / "core/gate.cpp"
        path.write_text("\n" + path.read_text().replace("twice > 10 ?", "twice > 11 ?"))
        code, output = self.run_tool("--changed", "HEAD", "--list")
        self.assertEqual(code, 0)
        self.assertIn("core/gate.cpp:12: comparison: > -> >=", output)
        self.assertNotIn("core/gate.cpp:11", output)
        path.write_text(SOURCES["core/gate.cpp"])
        code, output = self.run_tool("--changed", "HEAD")
        self.assertEqual((code, output), (0, "mutants: there are none on lines that changed\n"))
        (self.root / "core/new.cpp").write_text("int n = 1;\n")
        self.addCleanup((self.root / "core/new.cpp").unlink)
        self.assertIn("core/new.cpp:1", self.run_tool("--changed", "HEAD", "--list")[1])

    def test_without_an_earlier_commit_it_passes(self):
        code, output = self.run_tool("--changed")
        self.assertEqual(code, 0)
        self.assertIn("no earlier commit", output)
        self.assertEqual(self.run_tool("--changed", "nowhere")[0], mutants.USAGE)

    def test_a_limit_stops_in_time(self):
        code, output = self.run_tool("--limit", "0.001")
        self.assertEqual(code, 0, output)
        total = len(self.results)
        left = re.search(rf"(\d+) of {total} were not run\.", output)
        # One may have begun before the time was over.
        self.assertGreaterEqual(int(left[1]), total - 1, output)

    def test_the_order_is_that_of_the_seed(self):
        some = found("int i = 1 + 2 + 3 + 4 + 5;")
        self.assertEqual(mutants.in_order(some, 1), mutants.in_order(some, 1))
        self.assertNotEqual(mutants.in_order(some, 1), mutants.in_order(some, 2))
        self.assertEqual(set(mutants.in_order(some, 1)), set(some))

    def test_what_only_waits_is_ended_too(self):
        begin = time.monotonic()
        code = mutants.Processes().run(["sleep", "60"], subprocess.DEVNULL, limit_s=0.1)
        self.assertEqual(code, -signal.SIGXCPU)
        self.assertLess(time.monotonic() - begin, 30)

    def test_what_it_leaves_behind_is_ended_too(self):
        with tempfile.TemporaryFile("w+") as output:
            code = mutants.Processes().run(["sh", "-c", "sleep 600 & echo $!; exit 3"], output)
            output.seek(0)
            left = int(output.read())
        self.assertEqual(code, 3)
        self.assertTrue(self.ends(left))

    def test_memory_is_limited(self):
        for size, fails in ((1 << 20, False), (2 * mutants.MEMORY_LIMIT, True)):
            code = mutants.Processes().run([sys.executable, "-c", f"bytearray({size})"],
                                           subprocess.DEVNULL, limit_s=10,
                                           memory=mutants.MEMORY_LIMIT)
            self.assertEqual(code != 0, fails, size)

    def test_wrong_use(self):
        for arguments in (["nowhere"], ["--limit", "0"], ["--jobs", "0"], ["--what"]):
            self.assertEqual(self.run_tool(*arguments)[0], mutants.USAGE, arguments)

    def test_an_interrupt_ends_all_processes_and_shows_what_is_known(self):
        program = ("import pathlib, sys; sys.dont_write_bytecode = True\n"
                   f"sys.path.insert(0, {str(HERE)!r}); import mutants\n"
                   f"area = mutants.Area('core', 'core_tests')\n"
                   f"sys.exit(mutants.main([], pathlib.Path({str(self.root)!r}), [area]))\n")
        tool = subprocess.Popen([sys.executable, "-c", program], text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for line in tool.stderr:
            if "mutants: " in line and "survived" in line:
                break
        tool.send_signal(signal.SIGINT)
        output, _ = tool.communicate(timeout=60)
        self.assertEqual(tool.returncode, mutants.INTERRUPTED, output)
        self.assertIn("were not run.", output)
        for path in pathlib.Path("/proc").glob("[0-9]*/cmdline"):
            process = int(path.parent.name)
            with contextlib.suppress(OSError):
                if process != os.getpid() and str(self.root) in path.read_text():
                    self.assertTrue(self.ends(process), path)

    @staticmethod
    def ends(process):
        """What is about to end may do so."""
        try:
            file = os.pidfd_open(process)
        except OSError:
            return True
        try:
            return bool(select.select([file], [], [], 10)[0])
        finally:
            os.close(file)


if __name__ == "__main__":
    unittest.main()
