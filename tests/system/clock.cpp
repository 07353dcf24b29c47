// SPDX-License-Identifier: BSD-3-Clause
// The `versavis clock` command as a user runs it, on time stamps from a real exchange.
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "../support/process.hpp"
#include "../support/temporary_directory.hpp"
#include "versavis/time.hpp"

using namespace versavis;
using namespace versavis::test;
using Catch::Contains;

namespace {

const std::string trace = VERSAVIS_SOURCE_DIR "/tests/data/clock/pty_idle_excerpt.csv";

struct Command {
    TemporaryDirectory directory;

    std::string path(const std::string& name) const { return (directory.path() / name).string(); }

    int run(std::vector<std::string> arguments, std::string* output) const {
        arguments.insert(arguments.begin(), {program("versavis"), "clock"});
        return test::run(arguments, path("log"), output);
    }
};

std::vector<std::string> lines(const std::string& path) {
    std::ifstream file(path);
    std::vector<std::string> all;
    for (std::string line; std::getline(file, line);) all.push_back(line);
    return all;
}

std::vector<std::string> fields(const std::string& line) {
    std::vector<std::string> all;
    std::istringstream in(line);
    for (std::string field; std::getline(in, field, ',');) all.push_back(field);
    return all;
}

/// One query after each exchange of the trace, the newest first: what is the host time of this
/// board time? Both clocks were the same.
std::string questions() {
    std::string text;
    const auto rows = lines(trace);
    for (std::size_t i = rows.size() - 1; i > 0; --i) {
        const std::string arrived = fields(rows[i]).back();
        text.append(arrived).append(",").append(arrived).append("\n");
    }
    return "available_ns,board_ns\n" + text;
}

}  // namespace

TEST_CASE("clock: a recorded trace is translated again") {
    const Command clock;
    const std::string query = clock.directory.write("q.csv", questions());
    std::string output;
    REQUIRE(
        clock.run({"replay", "--exchanges", trace, "--query", query, "--out", clock.path("r.csv")},
                  &output) == 0);
    CHECK_THAT(output, Contains("300 answers from 300 messages"));
    const auto answers = lines(clock.path("r.csv"));
    REQUIRE(answers.size() == 301);
    CHECK(answers[0] == "board_ns,host_ns,sigma_ns,state");
    std::size_t locked = 0;
    for (std::size_t i = 1; i < answers.size(); ++i) {
        const auto answer = fields(answers[i]);
        REQUIRE(answer.size() == 4);
        const double error =
            std::abs(static_cast<double>(std::stoll(answer[1]) - std::stoll(answer[0])));
        CHECK(error < 60e3);
        if (answer[3] != "locked") continue;
        ++locked;
        CHECK(error < 4.0 * std::stod(answer[2]));
    }
    CHECK(locked > 200);

    // The published filter with its own start values is still half a second off.
    const std::vector<std::string> ekf{
        "replay", "--exchanges",       trace,         "--query", query,
        "--out",  clock.path("e.csv"), "--estimator", "ekf"};
    REQUIRE(clock.run(ekf, &output) == 0);
    const auto newest = fields(lines(clock.path("e.csv"))[1]);
    CHECK(std::stoll(newest[1]) - std::stoll(newest[0]) > 500'000'000);
    CHECK(newest[3] == "converging");
}

TEST_CASE("clock: what is wrong is said, with the exit code for it") {
    const Command clock;
    const std::string query = clock.directory.write("q.csv", "available_ns,board_ns\n1,2\n");
    const std::string bad =
        clock.directory.write("bad.csv", "h1_ns,m2_ns,m3_ns,h4_ns\n1,2,three,4\n");
    const std::string out = clock.path("r.csv");
    std::string output;
    CHECK(clock.run({"replay", "--exchanges", bad, "--query", query, "--out", out}, &output) == 69);
    CHECK_THAT(output, Contains("bad.csv, line 2, column m3_ns: 'three' is not an integer"));
    CHECK(clock.run({"history", "--exchanges", "/nowhere.csv", "--out", out}, &output) == 69);
    CHECK_THAT(output, Contains("/nowhere.csv: cannot be read"));
    CHECK_FALSE(std::filesystem::exists(out));

    CHECK(clock.run({}, &output) == 64);
    CHECK(clock.run({"replay", "--exchanges", trace}, &output) == 64);
    CHECK_THAT(output, Contains("--query"));
    CHECK(clock.run({"replay", "--exchanges", trace, "--query", query, "--out", out, "--estimator",
                     "best"},
                    &output) == 64);
    CHECK(clock.run({"replay", "--exchanges", trace, "--query", query, "--out", out, "--estimator",
                     "ekf", "--smoothed"},
                    &output) == 64);
    for (const char* command : {"status", "replay", "history"})
        CHECK(clock.run({command, "--help"}, &output) == 0);
    CHECK(clock.run({"status", "--instance", "nobody"}, &output) == 69);
}
