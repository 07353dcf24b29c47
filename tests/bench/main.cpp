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

#include "metric.hpp"

namespace {

using versavis::bench::Metric;

using Benches = std::map<std::string, std::function<std::vector<Metric>()>>;

Benches all_benches(const double& seconds, const bool& profile) {
    return {{"ring", versavis::bench::bench_ring},
            {"cameras", [&] { return versavis::bench::bench_cameras(seconds); }},
            {"clock", versavis::bench::bench_clock},
            {"end_to_end", versavis::bench::bench_end_to_end},
            {"firmware", [&] { return versavis::bench::bench_firmware(profile); }},
            {"link", versavis::bench::bench_link},
            {"output_clock", versavis::bench::bench_output_clock},
            {"record", [&] { return versavis::bench::bench_record(seconds); }},
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
    std::string only;
    std::string json_path;
    double seconds = 30;
    bool profile = false;
    const Benches benches = all_benches(seconds, profile);
    app.add_option("name", only, "One of them; without it, all")->check(CLI::IsMember(benches));
    app.add_option("--seconds", seconds, "How long three cameras run")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_flag("--profile", profile, "Which functions of the firmware take its cycles");
    app.add_option("--json", json_path, "File for the results");
    try {
        app.parse(argc, argv);
        const nlohmann::json document = run(benches, only);
        if (json_path.empty()) return EX_OK;
        std::ofstream file(json_path);
        file << document.dump(2) << '\n';
        if (!file.good()) throw std::runtime_error(json_path + " cannot be written");
        return EX_OK;
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench: {}\n", error.what());
        return EXIT_FAILURE;
    }
}
