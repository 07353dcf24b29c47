// SPDX-License-Identifier: BSD-3-Clause
// The unmodified service finds the board through the real libusb, on a simulated bus. Run under
// umockdev-wrapper.
#include <umockdev.h>

#include <catch2/catch.hpp>

#include "../support/judged.hpp"
#include "../support/stack.hpp"
#include "judge.hpp"
#include "simulated_pico.hpp"
#include "usb_bridge.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

bool board_absent(const nlohmann::json& status) { return status["board"]["state"] == "absent"; }

}  // namespace

TEST_CASE("usb: the board is found, drives the cameras, is unplugged and comes back") {
    const GObjectPtr<UMockdevTestbed> testbed(umockdev_testbed_new());
    Stack stack({"usb", 30, 1, 20, "", "", "", 320, 240, "usb"});
    stack.start_rig();
    UsbBridge bridge(testbed.get(), stack.socket_path(), "RIG0001");
    stack.start_service();
    const auto status = stack.wait_for_status(healthy);
    CHECK(status["board"]["serial"] == "RIG0001");
    CHECK(bridge.line_state_set());

    const rig::Verdict verdict = judged(stack, 4);
    INFO(rig::to_table(verdict));
    CHECK(verdict.ok);

    bridge.unplug();
    const auto unplugged = stack.wait_for_status(board_absent);
    CHECK(unplugged["health"] == "degraded");
    CHECK_THAT(unplugged["board"]["hint"].get<std::string>(), Catch::Contains("plug"));
    bridge.plug();
    const auto again = stack.wait_for_status(healthy);
    CHECK(again["board"]["connections"] == 2);
    // The board kept running: its clock and numbers are still those of the first connection.
    CHECK(again["clock"]["epoch"] == status["clock"]["epoch"]);
    CHECK(stack.service().terminate() == 0);
}

TEST_CASE("usb: a board that hangs is reset, and comes back under another address") {
    const GObjectPtr<UMockdevTestbed> testbed(umockdev_testbed_new());
    Stack stack({"usbhang", 32, 1, 20, "", "", "", 320, 240, "usb"});
    stack.start_rig();
    UsbBridge bridge(testbed.get(), stack.socket_path(), "RIG0001");
    stack.start_service();
    const auto status = stack.wait_for_status(healthy);
    bridge.hang();
    stack.wait_for_status([&](const auto&) { return !bridge.hangs(); });
    bridge.unplug();
    bridge.plug();
    const auto again = stack.wait_for_status(healthy);
    CHECK(again["board"]["connections"] == 2);
    CHECK(again["clock"]["epoch"] == status["clock"]["epoch"]);
}

TEST_CASE("usb: a boot loader where the board should be is named, with what to do") {
    const GObjectPtr<UMockdevTestbed> testbed(umockdev_testbed_new());
    PicoSettings settings{"PICO0001", "1-2", ""};
    const char* words = "a board is in its boot loader at usb:1-2";
    const char* cure = "'versavis flash'";
    SECTION("of the board") {}
    SECTION("of a Pico 2") {
        settings.faults.product = 0x000F;
        words = "there is a Pico 2 (RP2350), which is not supported, at usb:1-2";
        cure = "use a board with an RP2040";
    }
    const SimulatedPico pico(testbed.get(), settings);
    Stack stack({"bootusb", 35, 1, 20, "", "", "", 320, 240, "usb"});
    stack.start_service();
    const auto status =
        stack.wait_for_status([](const auto& s) { return s["health"] == "degraded"; });
    CHECK_THAT(
        status["board"]["hint"].get<std::string>(),
        Catch::Contains("no device 1209:5653, but " + std::string(words)) && Catch::Contains(cure));
    CHECK(stack.service().terminate() == 0);
}

TEST_CASE("usb: no board, or the wrong one, is said with what to do") {
    const GObjectPtr<UMockdevTestbed> testbed(umockdev_testbed_new());
    Stack stack({"nousb", 31, 1, 20, "", "", "", 320, 240, "usb"});
    stack.start_service();
    const auto status =
        stack.wait_for_status([](const auto& s) { return s["health"] == "degraded"; });
    CHECK(status["board"]["state"] == "absent");
    CHECK_THAT(status["board"]["hint"].get<std::string>(),
               Catch::Contains("1209:5653") && Catch::Contains("lsusb"));
    CHECK(stack.service().terminate() == 0);
}
