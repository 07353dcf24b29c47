// SPDX-License-Identifier: BSD-3-Clause
// Measures what the README claims, as ratios within one run where it can.
#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "metric.hpp"

namespace {

using versavis::bench::Metric;

using Benches = std::map<std::string, std::function<std::vector<Metric>()>>;

/// How long cameras run where nobody says. Half: figures scatter. Twice: `./dev bench` takes
/// longer.
constexpr double cameras_s = 30;
constexpr double record_s = 8;

struct Options {
    std::string only;
    std::string json_path;
    std::string directory;
    std::optional<double> seconds;
    bool profile = false;
};

Benches all_benches(const Options& options) {
    return {{"ring", versavis::bench::bench_ring},
            {"cameras",
             [&] { return versavis::bench::bench_cameras(options.seconds.value_or(cameras_s)); }},
            {"clock", versavis::bench::bench_clock},
            {"end_to_end", versavis::bench::bench_end_to_end},
            {"firmware", [&] { return versavis::bench::bench_firmware(options.profile); }},
            {"link", versavis::bench::bench_link},
            {"output_clock", versavis::bench::bench_output_clock},
            {"record",
             [&] {
                 return versavis::bench::bench_record(options.seconds.value_or(record_s),
                                                      options.directory);
             }},
            {"recovery", versavis::bench::bench_recovery}};
}

void print(const Metric& metric) {
    fmt::print("{:<36} {:>12.3f} ", metric.name, metric.value);
    if (metric.goal)
        fmt::print("{:<8} goal {:>10.3f}  {}\n", metric.unit, *metric.goal,
                   metric.met() ? "met" : "NOT MET");
    else
        fmt::print("{}\n", metric.unit);
    std::fflush(stdout);
}

nlohmann::json run(const Benches& benches, const std::string& only) {
    nlohmann::json document = nlohmann::json::object();
    for (const auto& [name, bench] : benches) {
        if (!only.empty() && only != name) continue;
        for (const Metric& metric : bench()) {
            print(metric);
            document[metric.name] = {{"value", metric.value}, {"unit", metric.unit}};
            if (!metric.goal) continue;
            document[metric.name]["goal"] = *metric.goal;
            document[metric.name]["met"] = metric.met();
        }
    }
    return document;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Benchmarks of VersaVIS"};
    Options options;
    const Benches benches = all_benches(options);
    app.add_option("name", options.only, "One of them; without it, all")
        ->check(CLI::IsMember(benches));
    app.add_option("--seconds", options.seconds,
                   fmt::format("How long three cameras run (default: cameras {}, record {}; 300 is "
                               "what record should bear)",
                               cameras_s, record_s))
        ->check(CLI::PositiveNumber);
    app.add_option("--directory", options.directory,
                   "Where record writes, and whose disk it measures (default: here; or /dev/shm "
                   "where the disk here is too slow for three cameras)")
        ->check(CLI::ExistingDirectory);
    app.add_flag("--profile", options.profile, "Which functions of the firmware take its cycles");
    app.add_option("--json", options.json_path, "File for the results");
    try {
        app.parse(argc, argv);
        const nlohmann::json document = run(benches, options.only);
        if (options.json_path.empty()) return EX_OK;
        std::ofstream file(options.json_path);
        file << document.dump(2) << '\n';
        if (!file.good()) throw std::runtime_error(options.json_path + " cannot be written");
        return EX_OK;
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench: {}\n", error.what());
        return EXIT_FAILURE;
    }
}
