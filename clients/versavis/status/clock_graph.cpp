// SPDX-License-Identifier: BSD-3-Clause
#include "status/clock_graph.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>

#include "base/json_text.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

const std::string host_name = "host";

std::optional<std::int64_t> number(const json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_number() ? std::optional(found->get<std::int64_t>())
                                                       : std::nullopt;
}

/// A part of the status document; null, and what is missing: an empty one.
json part(const json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_object() ? *found : json::object();
}

std::vector<json> parts(const json& object, const char* key) {
    std::vector<json> all;
    const auto found = object.find(key);
    if (found == object.end() || !found->is_array()) return all;
    std::copy_if(found->begin(), found->end(), std::back_inserter(all),
                 [](const json& it) { return it.is_object(); });
    return all;
}

/// What a device says of itself.
ClockNode device(const json& object, std::string name, std::string kind, std::string parent) {
    ClockNode node;
    node.name = std::move(name);
    node.kind = std::move(kind);
    node.parent = std::move(parent);
    node.state = text(object, "state");
    node.good = text(object, "health") != "degraded";
    node.hint = text(object, "hint");
    return node;
}

ClockNode port_of(const PtpPort& port) {
    ClockNode node;
    node.name = port.name;
    node.kind = "port";
    node.parent = host_name;
    node.state = port.state;
    node.good = port.state == "SLAVE" || port.state == "MASTER" || port.state == "GRAND_MASTER" ||
                port.state == "PASSIVE";
    node.path = port.grandmaster.empty() ? "ptp4l" : "ptp4l, grandmaster " + port.grandmaster;
    node.offset_ns = port.offset_ns;
    return node;
}

/// What one service adds to the graph.
class Instance {
 public:
    Instance(const std::string& name, const json& status, std::vector<ClockNode>& clocks)
        : name_(name), status_(status), clocks_(clocks) {}

    void add() {
        add_board();
        add_ptp();
        for (const json& camera : parts(status_, "cameras")) add_camera(camera);
        for (const json& imu : parts(status_, "imus")) {
            ClockNode node = device(imu, path_of(text(imu, "name")), "imu", own("board"));
            node.path = "sampled by the board";
            clocks_.push_back(std::move(node));
        }
        for (const json& output : parts(status_, "time_outputs")) {
            ClockNode node = device(output, path_of(text(output, "name")), "lidar", own("board"));
            node.path = "pulses and sentences of the board";
            node.offset_ns = number(output, "error_ns");
            clocks_.push_back(std::move(node));
        }
        for (const json& lidar : parts(status_, "lidars")) {
            ClockNode node = device(lidar, path_of(text(lidar, "name")), "lidar", host_name);
            node.path = "packets of the LiDAR";
            if (const auto behind = number(lidar, "behind_ns"))
                node.bound_ns = std::max(*behind, number(lidar, "ahead_ns").value_or(0));
            clocks_.push_back(std::move(node));
        }
    }

 private:
    std::string path_of(const std::string& device) const { return name_ + "/" + device; }

    /// No camera can have such a name.
    std::string own(const char* clock) const { return name_ + ":" + clock; }

    void add_board() {
        const json board = part(status_, "board");
        if (text(board, "state") == "unused") return;
        const json clock = part(status_, "clock");
        ClockNode node = device(clock, own("board"), "board", host_name);
        node.path = "exchanges with the board";
        const bool lost = text(board, "health") == "degraded";
        if (lost) node.state = text(board, "state");
        if (lost) node.hint = text(board, "hint");
        node.good = node.good && !lost;
        node.bound_ns = number(clock, "bound_ns");
        clocks_.push_back(std::move(node));
        const std::string pps = text(clock, "pps");
        if (pps == "off" || pps.empty()) return;
        ClockNode receiver;
        receiver.name = own("pps");
        receiver.kind = "receiver";
        receiver.parent = own("board");
        receiver.path = "pulses at the board";
        receiver.state = pps;
        receiver.good = pps == "used" && number(clock, "second_difference_s").value_or(0) == 0;
        receiver.offset_ns = number(clock, "pps_residual_ns");
        clocks_.push_back(std::move(receiver));
    }

    void add_ptp() {
        const json ptp = part(status_, "ptp");
        if (ptp.empty()) return;
        ClockNode node;
        node.name = own("ptp");
        node.kind = "ptp";
        node.parent = host_name;
        node.path = "readings of cameras' clocks";
        node.state = text(ptp, "state");
        node.good = node.state == "locked" && text(ptp, "master").empty() &&
                    text(ptp, "contradicted").empty();
        node.bound_ns = number(ptp, "bound_ns");
        const auto ahead_ns = number(ptp, "minus_utc_ns");
        if (ahead_ns)
            node.path +=
                fmt::format(", {:.3f} s ahead of UTC", static_cast<double>(*ahead_ns) * 1e-9);
        clocks_.push_back(std::move(node));
    }

    void add_camera(const json& camera) {
        const std::string trigger = text(camera, "trigger");
        ClockNode node =
            device(camera, path_of(text(camera, "name")), "camera",
                   trigger == "free" ? host_name : own(trigger == "ptp" ? "ptp" : "board"));
        if (node.state == "streaming") node.state = text(camera, "pairing");
        if (trigger == "ptp") {
            const json port = part(camera, "ptp");
            node.path = text(port, "port").empty() ? "PTP" : "PTP " + text(port, "port");
            node.offset_ns = number(port, "offset_ns");
        } else {
            node.path = trigger == "free" ? "arrival of its frames" : "triggered by the board";
        }
        clocks_.push_back(std::move(node));
    }

    const std::string& name_;
    const json& status_;
    std::vector<ClockNode>& clocks_;
};

std::string in_us(std::int64_t ns) {
    return std::llabs(ns) < 1'000'000'000 ? fmt::format("{:.1f} us", static_cast<double>(ns) * 1e-3)
                                          : fmt::format("{:.3f} s", static_cast<double>(ns) * 1e-9);
}

/// Below its parent, with lines as `tree` draws them.
void draw(const std::vector<ClockNode>& clocks, const std::string& parent,
          const std::string& indent, std::string& out) {
    std::vector<const ClockNode*> below;
    for (const ClockNode& clock : clocks)
        if (clock.parent == parent) below.push_back(&clock);
    for (const ClockNode* clock : below) {
        const bool root = parent.empty();
        const bool last = clock == below.back();
        const std::string branch = root ? "" : last ? "`- " : "|- ";
        std::string line =
            fmt::format("{}{}{}  {}: {}", indent, branch, clock->name, clock->path, clock->state);
        if (clock->bound_ns) line += ", within " + in_us(*clock->bound_ns);
        if (clock->offset_ns) line += ", off by " + in_us(*clock->offset_ns);
        out += line + (clock->good ? "\n" : "  <- not good\n");
        const std::string further = root ? indent : indent + (last ? "   " : "|  ");
        if (!clock->good && !clock->hint.empty()) out += further + "   " + clock->hint + "\n";
        draw(clocks, clock->name, further, out);
    }
}

}  // namespace

std::vector<ClockNode> clock_graph(const HostClock& host, const std::vector<PtpPort>& ports,
                                   const std::vector<InstanceStatus>& services) {
    std::vector<ClockNode> clocks;
    ClockNode root;
    root.name = root.kind = host_name;
    root.path = "CLOCK_REALTIME";
    root.state = host.synchronised ? "synchronised" : "not synchronised";
    if (host.synchronised) root.bound_ns = host.max_error_ns;
    clocks.push_back(std::move(root));
    for (const PtpPort& port : ports) clocks.push_back(port_of(port));
    for (const auto& [name, status] : services) Instance(name, status, clocks).add();
    // What an unused board or PTP would be the parent of.
    for (ClockNode& clock : clocks) {
        const bool there = std::any_of(clocks.begin(), clocks.end(), [&](const ClockNode& other) {
            return other.name == clock.parent;
        });
        if (!there && !clock.parent.empty()) clock.parent = host_name;
    }
    return clocks;
}

std::string graph_text(const std::vector<ClockNode>& clocks) {
    std::string out;
    draw(clocks, "", "", out);
    return out;
}

json graph_json(const std::vector<ClockNode>& clocks) {
    json all = json::array();
    const auto or_null = [](const auto& value) { return value ? json(*value) : json(); };
    for (const ClockNode& clock : clocks)
        all.push_back({{"name", clock.name},
                       {"kind", clock.kind},
                       {"parent", clock.parent.empty() ? json() : json(clock.parent)},
                       {"path", clock.path},
                       {"state", clock.state},
                       {"good", clock.good},
                       {"bound_ns", or_null(clock.bound_ns)},
                       {"offset_ns", or_null(clock.offset_ns)},
                       {"hint", clock.hint}});
    return {{"clocks", all}};
}

}  // namespace versavis::client
