// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <sstream>
#include <toml++/toml.h>

namespace versavis::rig {

namespace {

/// Reads the keys of one table; keys that nobody asked for are an error at the end.
class TableReader {
   public:
    TableReader(const std::string& path, const toml::table& table, Expected<>& result)
        : path_(path), table_(table), result_(result) {}

    template <class T>
    void read(std::string_view key, T& value) {
        known_.emplace_back(key);
        const toml::node* node = table_.get(key);
        if (node == nullptr) return;
        if (const auto found = node->value<T>())
            value = *found;
        else
            fail(*node, fmt::format("'{}' is not of the right type", key));
    }

    void allow(std::string_view key) { known_.emplace_back(key); }

    void refuse_unknown() {
        for (const auto& [key, node] : table_)
            if (std::find(known_.begin(), known_.end(), key.str()) == known_.end())
                fail(node, fmt::format("unknown key '{}'", key.str()));
    }

    void fail(const toml::node& node, const std::string& what) {
        if (!result_) return;
        const auto at = node.source().begin;
        result_ = failure(fmt::format("{}:{}:{}", path_, at.line, at.column), what, "docs/rig.md lists the keys");
    }

   private:
    const std::string& path_;
    const toml::table& table_;
    Expected<>& result_;
    std::vector<std::string> known_;
};

void read_clock(TableReader& reader, ClockErrors& clock) {
    double offset_s = static_cast<double>(clock.offset_ns) * 1e-9;
    reader.read("clock_offset_s", offset_s);
    reader.read("clock_skew_ppm", clock.skew_ppm);
    reader.read("clock_drift_ppm_per_s", clock.drift_ppm_per_s);
    clock.offset_ns = static_cast<std::int64_t>(offset_s * 1e9);
}

void read_camera(TableReader& reader, CameraScenario& camera) {
    reader.read("name", camera.name);
    reader.read("address", camera.address);
    reader.read("output", camera.output);
    camera.serial = "RIGCAM-" + camera.name;
    reader.read("serial", camera.serial);
    reader.read("width", camera.width);
    reader.read("height", camera.height);
    reader.read("exposure_us", camera.exposure_us);
    reader.read("exposure_swing", camera.exposure_swing);
    reader.read("exposure_swing_s", camera.exposure_swing_s);
    reader.read("trigger_latency_us", camera.trigger_latency_us);
    reader.read("readout_us", camera.readout_us);
    reader.read("link_mbps", camera.link_mbps);
    reader.read("packet_loss", camera.packet_loss);
    read_clock(reader, camera.clock);
}

void read_fault(TableReader& reader, const toml::table& table, Fault& fault) {
    static const std::map<std::string, FaultKind> kinds{{"drop_frame", FaultKind::drop_frame},
                                                        {"ignore_trigger", FaultKind::ignore_trigger},
                                                        {"camera_mute", FaultKind::camera_mute},
                                                        {"camera_reboot", FaultKind::camera_reboot},
                                                        {"board_reset", FaultKind::board_reset}};
    std::string kind;
    reader.read("kind", kind);
    reader.read("camera", fault.camera);
    reader.read("at_exposure", fault.at_exposure);
    reader.read("count", fault.count);
    reader.read("seconds", fault.seconds);
    const auto found = kinds.find(kind);
    if (found == kinds.end()) return reader.fail(table, fmt::format("unknown kind of fault '{}'", kind));
    fault.kind = found->second;
}

/// Calls read_one(reader, table) for each table of the array `key`.
template <class ReadOne>
void read_tables(const std::string& path, const toml::table& root, std::string_view key, Expected<>& result,
                 ReadOne&& read_one) {
    const toml::array* array = root[key].as_array();
    if (array == nullptr) return;
    for (const toml::node& node : *array) {
        const toml::table* table = node.as_table();
        if (table == nullptr) continue;
        TableReader reader(path, *table, result);
        read_one(reader, *table);
        reader.refuse_unknown();
    }
}

Expected<Scenario> read_scenario(const std::string& path, const toml::table& root) {
    Scenario scenario;
    Expected<> result;
    TableReader top(path, root, result);
    top.read("seed", scenario.seed);
    top.read("imu", scenario.imu);
    for (const auto* key : {"board", "camera", "fault"}) top.allow(key);
    top.refuse_unknown();
    if (const toml::table* table = root["board"].as_table()) {
        TableReader reader(path, *table, result);
        reader.read("serial", scenario.board.serial);
        read_clock(reader, scenario.board.clock);
        reader.refuse_unknown();
    }
    read_tables(path, root, "camera", result, [&](TableReader& reader, const toml::table& table) {
        CameraScenario camera;
        read_camera(reader, camera);
        if (camera.name.empty() || camera.address.empty()) reader.fail(table, "a camera needs 'name' and 'address'");
        if (camera.output > 3) reader.fail(table, "'output' is 0 to 3");
        if (camera.width < 16 || camera.height < 1) reader.fail(table, "a camera has at least 16 x 1 pixels");
        scenario.cameras.push_back(camera);
    });
    read_tables(path, root, "fault", result, [&](TableReader& reader, const toml::table& table) {
        Fault fault;
        read_fault(reader, table, fault);
        scenario.faults.push_back(fault);
    });
    if (!result) return tl::unexpected(result.error());
    return scenario;
}

}  // namespace

Expected<Scenario> load_scenario(const std::string& path) {
    try {
        return read_scenario(path, toml::parse_file(path));
    } catch (const toml::parse_error& error) {
        const auto at = error.source().begin;
        return failure(fmt::format("{}:{}:{}", path, at.line, at.column), std::string(error.description()));
    }
}

}  // namespace versavis::rig
