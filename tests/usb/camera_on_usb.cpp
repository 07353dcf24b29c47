// SPDX-License-Identifier: BSD-3-Clause
// Board and USB3 Vision camera on one simulated bus: the unmodified service, through the real
// libusb and Aravis. Run under umockdev-wrapper.
#include <catch2/catch.hpp>
#include <thread>

#include "../support/judged.hpp"
#include "../support/stack.hpp"
#include "judge.hpp"
#include "usb_rig.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

UsbRig rig_of(const Stack& stack) {
    return {stack.scenario(), stack.socket_path(), stack.truth_path()};
}

void judge(const Stack& stack) {
    const rig::Verdict verdict = judged(stack, 3);
    INFO(rig::to_table(verdict));
    CHECK(verdict.streams.at("cam0").wrong_pairs == 0);
    CHECK(verdict.streams.at("cam0").items > 40);
}

}  // namespace

TEST_CASE("usb: a USB3 Vision camera streams, stalls, is unplugged and comes back") {
    StackSettings settings{"u3v", 32, 1, 20, "exposure_swing = 0.5", "", "", 320, 240, "usb"};
    settings.devices = {"RIGCAM-cam0"};  // its serial number
    Stack stack(settings);
    {
        UsbRig rig = rig_of(stack);
        stack.start_service();
        auto status = stack.wait_for_status(healthy);
        CHECK(status["cameras"][0]["serial"] == "RIGCAM-cam0");
        CHECK(status["cameras"][0]["packet_size"] == 0);
        CHECK(status["cameras"][0]["exposure_source"] == "chunk");
        judge(stack);

        rig.camera->stall_data();
        // It may be opened again before a status reports it.
        REQUIRE(stack.service().wait_for_output("cam0: silent", seconds(30)));
        stack.wait_for_status(
            [](const auto& s) { return healthy(s) && s["cameras"][0]["connections"] == 2; });
        judge(stack);

        rig.device.unplug();
        status = stack.wait_for_status(
            [](const auto& s) { return s["cameras"][0]["state"] == "absent"; });
        CHECK_THAT(status["cameras"][0]["hint"].get<std::string>(),
                   Catch::Contains("it answered before, and does not any more"));
        rig.device.plug();
        status = stack.wait_for_status(healthy);
        CHECK(status["cameras"][0]["connections"] == 3);
        judge(stack);
        CHECK(stack.service().terminate() == 0);
    }
}

TEST_CASE("usb: two entries for one camera beside a device that never answers end in time") {
    StackSettings settings{"u3vtwo", 33, 2, 20, "", "", "", 320, 240, "usb"};
    settings.devices = {"RIGCAM-cam0", "565673E09BCA"};  // its serial number, and its GUID
    Stack stack(settings);
    UsbRig rig = rig_of(stack);
    rig.add_mute(stack.scenario().cameras[0]);
    stack.start_service();
    stack.wait_for_status([](const auto& s) {
        unsigned streaming = 0;
        unsigned misconfigured = 0;
        for (const auto& camera : s["cameras"]) {
            streaming += camera["state"] == "streaming" ? 1U : 0U;
            misconfigured += camera["state"] == "misconfigured" ? 1U : 0U;
        }
        return streaming == 1 && misconfigured == 1;
    });
    const HostTime asked = host_now();
    CHECK(stack.service().terminate() == 0);
    CHECK(host_now() - asked < seconds(2));
}

namespace {

/// The one of this serial number: services of other tests are seen, too.
nlohmann::json of_serial(const nlohmann::json& devices, const std::string& serial) {
    for (const auto& device : devices)
        if (device["serial"] == serial) return device;
    return nlohmann::json::object();
}

}  // namespace

TEST_CASE("usb: discover lists board and cameras, and disturbs no service that uses them") {
    StackSettings settings{
        "u3vlist", 34,  1,   20,   "serial = \"LISTED\"", "[board]\nserial = \"LISTEDB\"\n",
        "",        320, 240, "usb"};
    settings.devices = {"LISTED"};
    Stack stack(settings);
    UsbRig rig = rig_of(stack);
    rig.add_mute(stack.scenario().cameras[0]);
    const auto discover = [&] {
        std::string said;
        CHECK(stack.tool({"discover", "--json"}, &said) == 0);
        return nlohmann::json::parse(said);
    };
    for (int i = 0; i < 2; ++i) {  // the first leaves all as it was
        const auto devices = discover();
        const auto board = of_serial(devices["boards"], "LISTEDB");
        CHECK(board["state"] == "running");
        CHECK(board["used_by"].is_null());
        const auto camera = of_serial(devices["cameras"], "LISTED");
        CHECK(camera["protocol"] == "USB3 Vision");
        CHECK(camera["device"] == "LISTED");
        CHECK(camera["port"] == "usb:1-2");
        CHECK(camera["preset"] == "generic");
        CHECK(camera["access"] == "free");
        CHECK(of_serial(devices["cameras"], "MUTE")["access"] == "free");
    }
    stack.start_service();
    stack.wait_for_status(healthy);
    const auto devices = discover();
    CHECK(of_serial(devices["boards"], "LISTEDB")["used_by"]["instance"] == "u3vlist");
    const auto camera = of_serial(devices["cameras"], "LISTED");
    CHECK(camera["access"] == "busy");
    CHECK(camera["used_by"]["name"] == "cam0");
    const auto status = stack.wait_for_status(healthy);
    CHECK(status["cameras"][0]["connections"] == 1);
}
