// SPDX-License-Identifier: BSD-3-Clause
#include "base/library_log.hpp"

#include <fcntl.h>
#include <glib.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("library_log: some lines pass in each window, the others are counted") {
    LineLimit limit;
    HostTime now{seconds(100).ns};
    unsigned passed = 0;
    for (int i = 0; i < 6200; ++i) passed += limit.take(now = now + milliseconds(1)) ? 1 : 0;
    CHECK(passed == LineLimit::lines);
    CHECK(limit.collect(now) == 0);  // reported once the window is over
    now = now + LineLimit::window;
    CHECK(limit.collect(now) == 6200 - LineLimit::lines);
    CHECK(limit.collect(now) == 0);
    CHECK(limit.take(now));
}

TEST_CASE("library_log: a flood of GLib's is some lines of ours and one that sums it up") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.write("log", "");
    const int own = ::dup(STDERR_FILENO);
    const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
    ::unsetenv("JOURNAL_STREAM");
    ::dup2(file, STDERR_FILENO);
    route_library_log();
    for (int i = 0; i < 1000; ++i) g_log("Rig", G_LOG_LEVEL_CRITICAL, "odd\x1b[31m number %d", i);
    report_suppressed_library_lines(host_now() + LineLimit::window);
    ::dup2(own, STDERR_FILENO);
    ::close(own);
    ::close(file);
    std::ifstream lines(path);
    unsigned count = 0;
    std::string line;
    for (std::string next; std::getline(lines, next); ++count) {
        line = next;
        CHECK(line.find('\x1b') == std::string::npos);
    }
    CHECK(count == LineLimit::lines + 1);
    CHECK_THAT(line, Catch::Contains("library: 990 more lines like these"));
}
