// SPDX-License-Identifier: BSD-3-Clause
// Board and USB3 Vision camera of a scenario for tests/system/confined, until its input ends. Run
// under umockdev-wrapper; prints the testbed's directory once both are plugged in.
#include <cstdio>
#include <exception>

#include "usb_rig.hpp"

namespace {

int run(const std::string& scenario_path, const std::string& socket) {
    const auto scenario = versavis::rig::load_scenario(scenario_path);
    if (!scenario) throw std::runtime_error(scenario.error().message());
    const versavis::test::UsbRig rig(*scenario, socket, "");
    std::printf("%s\n", rig.directory().c_str());
    std::fflush(stdout);
    while (std::getchar() != EOF) {
    }
    return 0;
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 3) {
        std::fprintf(stderr, "usage: usb_rig SCENARIO SOCKET\n");
        return 64;
    }
    try {
        return run(arguments[1], arguments[2]);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "usb_rig: %s\n", error.what());
        return 1;
    }
}
