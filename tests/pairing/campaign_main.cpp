// SPDX-License-Identifier: BSD-3-Clause
// campaign: faults by the hundred thousand against the pairing; a table of what became of the
// frames.
#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>
#include <vector>

#include "campaign.hpp"

using namespace versavis::test;

int main(int argc, char** argv) {
    CLI::App app{
        "Faults of all kinds against the pairing, in virtual time; exit code 1: a frame got a "
        "wrong trigger"};
    std::uint64_t faults = 100'000;
    std::uint64_t seed = 1;
    unsigned variations = 20;
    std::string only;
    app.add_option("--faults", faults, "Faults at random, for each kind of camera clock")
        ->capture_default_str();
    app.add_option("--seed", seed, "First seed of the random faults")->capture_default_str();
    app.add_option("--variations", variations, "Worlds in each cell of the matrix")
        ->capture_default_str();
    app.add_option("--only", only,
                   "Random faults alone, in rows whose name contains this, as \"unevenly, good\"");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    const auto rows = only.empty() ? run_matrix(variations) : std::vector<Row>{};
    fmt::print("{}", to_table(rows));
    std::fflush(stdout);
    std::uint64_t wrong = 0;
    for (const Row& row : rows) wrong += row.totals.wrong;
    const bool terminal = isatty(STDOUT_FILENO) != 0;
    const auto progress = [&](const Totals& totals) {
        if (!terminal || totals.runs % 100 != 0) return;
        fmt::print("\r{} of {} faults ", totals.faults, faults);
        std::fflush(stdout);
    };
    for (const Answers answers : {Answers::each, Answers::unevenly})
        for (const WorldClock clock :
             {WorldClock::good, WorldClock::drifting, WorldClock::absent}) {
            const char* all = answers == Answers::each ? "all at random" : "answered unevenly";
            const std::string name = fmt::format("{}, {}", all, to_string(clock));
            if (name.find(only) == std::string::npos) continue;
            const Totals totals = run_random(faults, seed, clock, progress, answers);
            fmt::print("{}{}", terminal ? "\r" : "", to_text(name, totals));
            for (const std::uint64_t bad : totals.wrong_seeds)
                fmt::print("  wrong with seed {}\n", bad);
            std::fflush(stdout);
            wrong += totals.wrong;
        }
    fmt::print("{} frames were published with a wrong trigger\n", wrong);
    return wrong == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
