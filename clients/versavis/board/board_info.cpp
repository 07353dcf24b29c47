// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_info.hpp"

#include <fmt/format.h>

#include <array>
#include <string_view>

#include "base/json_text.hpp"
#include "board/board_access.hpp"
#include "engine/board/board_words.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// The board reports its health once a second.
constexpr Duration health_patience = milliseconds(1500);

/// What a board counts from its boot.
struct Counter {
    const char* key;
    const char* name;
};
constexpr std::array counters{
    Counter{"late_outputs", "late outputs"},
    Counter{"lost_edges", "lost edges"},
    Counter{"stray_edges", "stray edges"},
    Counter{"glitches", "glitches"},
    Counter{"noisy_inputs", "noisy inputs"},
    Counter{"skipped_triggers", "skipped triggers"},
    Counter{"imu_errors", "IMU errors"},
    Counter{"imu_restarts", "IMU restarts"},
    Counter{"dropped_by_board", "dropped messages"},
};

constexpr std::array other_keys{"state",       "port",        "serial",        "firmware",
                                "present",     "nonce",       "pps",           "sync",
                                "reset_cause", "loop_max_ns", "fastest_imu_hz"};

json from_service(const json& board) {
    json info{{"source", "service"}};
    for (const char* key : other_keys)
        if (board.contains(key)) info[key] = board[key];
    for (const Counter& counter : counters)
        if (board.contains(counter.key)) info[counter.key] = board[counter.key];
    return info;
}

json from_hello(const device::Greeting& greeting) {
    const wire::BoardHello& hello = greeting.hello;
    json info{{"state", greeting.understood ? "running" : "incompatible"},
              {"protocol", fmt::format("{}.{}", hello.major, hello.minor)},
              {"nonce", greeting.nonce}};
    if (!greeting.understood) return info;
    info["firmware"] = greeting.firmware();
    info["present"] = board::part_names(hello.present);
    info["fastest_imu_hz"] = hello.fastest_imu_millihertz * 1e-3;
    info["reset_cause"] = board::to_string(hello.reset_cause);
    return info;
}

void add_health(json& info, const wire::Health& health) {
    info["pps"] = board::to_string(health.pps_state);
    info["sync"] = board::to_string(health.sync_state);
    info["stamp_test"] = board::to_string(health.stamp_test);
    info["loop_max_ns"] = health.loop_max_ns;
    info["late_outputs"] = health.late_outputs;
    info["lost_edges"] = health.lost_edges;
    info["stray_edges"] = health.stray_edges;
    info["glitches"] = health.glitches;
    info["noisy_inputs"] = health.noisy_inputs;
    info["skipped_triggers"] = health.skipped_triggers;
    info["imu_errors"] = health.imu_errors[0] + health.imu_errors[1];
    info["imu_restarts"] = health.imu_restarts;
    info["dropped_by_board"] = health.dropped_exposures + health.dropped_clock_answers +
                               health.dropped_events + health.dropped_imu_samples +
                               health.dropped_logs;
}

Expected<json> from_board(const FoundBoard& found, const std::string& instance) {
    json info{{"source", "usb"}, {"port", found.device.port()}, {"serial", found.serial}};
    if (found.in_boot_loader) {
        info["state"] = "boot_loader";
        return info;
    }
    auto conversation = open_board(found, instance);
    if (!conversation) return Unexpected(conversation.error());
    const auto greeting = conversation->greet();
    if (!greeting) return Unexpected(greeting.error());
    info.update(from_hello(*greeting));
    if (!greeting->understood) return info;
    wire::Health health{};
    const auto heard = conversation->listen(
        [&](const wire::Packet& packet) { return packet.read(health); }, health_patience);
    if (!heard) return Unexpected(heard.error());
    if (*heard) add_health(info, health);
    return info;
}

}  // namespace

Expected<json> board_info(const BoardChoice& choice, const std::string& instance) {
    const auto served = board_of_service(instance, choice.port);
    if (served && (choice.serial.empty() || choice.serial == text(*served, "serial")))
        return from_service(*served);
    const auto bus = device::UsbBus::open();
    if (!bus) return Unexpected(bus.error());
    const auto found = find_board(*bus, choice);
    if (!found) return Unexpected(found.error());
    return from_board(*found, instance);
}

std::string board_text(const json& info) {
    const std::string state = text(info, "state");
    if (state == "boot_loader")
        return fmt::format(
            "board    at {}, in its boot loader: flash it with 'versavis flash', or "
            "start its current firmware with 'versavis board reset'\n",
            text(info, "port"));
    std::string out = fmt::format(
        "board    {} at {}, {}\n", text(info, "serial"), text(info, "port"),
        text(info, "source") == "service" ? "as reported by the service" : "queried directly");
    if (state == "incompatible")
        return out + fmt::format(
                         "firmware of protocol {}, which this program does not speak: "
                         "install the same release of both with 'versavis flash'\n",
                         text(info, "protocol"));
    out += fmt::format("firmware {}, started by {}\n", text(info, "firmware"),
                       text(info, "reset_cause"));
    std::string parts;
    for (const json& part : info.value("present", json::array()))
        parts += (parts.empty() ? "" : ", ") + part.get<std::string>();
    out +=
        fmt::format("has      {}; IMUs up to {:g} Hz\n", parts, info.value("fastest_imu_hz", 0.0));
    if (!info.contains("pps")) return out + "health   it sends no report\n";
    out += fmt::format("inputs   PPS {}, sync {}\n", text(info, "pps"), text(info, "sync"));
    out += fmt::format("delays   up to {:.1f} us in the last second\n",
                       info.value("loop_max_ns", 0.0) * 1e-3);
    out += "counted ";
    for (const Counter& counter : counters)
        out += fmt::format("{} {} {}", &counter == counters.data() ? "" : ",", counter.name,
                           info.value(counter.key, std::uint64_t{0}));
    return out + "\n";
}

}  // namespace versavis::client
