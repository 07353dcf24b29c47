// SPDX-License-Identifier: BSD-3-Clause
// versavis-dds: what the service publishes, as topics of ROS 2 on other hosts.
#include <fmt/format.h>
#include <signal.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "base/fail.hpp"
#include "bridge.hpp"
#include "versavis/ring_path.hpp"

namespace {

using namespace versavis;
using namespace versavis::dds;

volatile sig_atomic_t stop_requested = 0;

int serve(BridgeSettings settings, const NetworkSettings& network) {
    const auto participant = Participant::create(network);
    if (!participant) return client::fail(participant.error());
    fmt::print("publishing instance '{}' in domain {}\n", settings.instance, network.domain);
    Bridge bridge(*participant, std::move(settings));
    std::fflush(stdout);
    for (const int number : {SIGINT, SIGTERM}) signal(number, [](int) { stop_requested = 1; });
    while (stop_requested == 0)
        if (const auto done = bridge.turn(milliseconds(100)); !done)
            return client::fail(done.error());
    const BridgeCounts counts = bridge.counts();
    fmt::print("{} messages sent, {} frames overtaken, {} items lost\n", counts.sent,
               counts.overtaken, counts.lost);
    return EX_OK;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Publishes what the service publishes as topics of ROS 2, by DDS."};
    app.set_version_flag("--version", "versavis-dds " VERSAVIS_VERSION);
    BridgeSettings settings{default_instance(), ""};
    std::vector<std::string> calibrations;
    NetworkSettings network;
    app.add_option("--instance", settings.instance, "Of the service")->capture_default_str();
    app.add_option("--prefix", settings.prefix, "In front of all topics but /diagnostics, as /car");
    app.add_option("--calibration", calibrations,
                   "Kalibr's camchain.yaml, for the camera infos; may be repeated")
        ->allow_extra_args(false);
    app.add_option("--domain", network.domain, "Of DDS, as ROS 2 has it")
        ->capture_default_str()
        ->envname("ROS_DOMAIN_ID");
    app.add_option("--interface", network.interfaces,
                   "Network interface, by name or address; may be repeated")
        ->allow_extra_args(false);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    auto lenses = client::read_lenses(calibrations);
    if (!lenses) return client::fail(lenses.error(), EX_NOINPUT);
    for (const std::string& why : lenses->left_out) fmt::print(stderr, "{}\n", why);
    settings.lenses = std::move(*lenses);
    return serve(std::move(settings), network);
}
