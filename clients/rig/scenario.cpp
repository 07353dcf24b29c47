// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

#include "base/hal.hpp"
#include "engine/toml/table_reader.hpp"

namespace versavis::rig {

namespace {

void read_clock(TableReader& reader, ClockErrors& clock) {
    double offset_s = static_cast<double>(clock.offset_ns) * 1e-9;
    reader.read("clock_offset_s", offset_s, 0, 1e6);
    reader.read("clock_skew_ppm", clock.skew_ppm, -1000, 1000);
    reader.read("clock_drift_ppm_per_s", clock.drift_ppm_per_s, -1, 1);
    clock.offset_ns = static_cast<std::int64_t>(offset_s * 1e9);
}

MotionScenario read_motion(TableReader& reader) {
    MotionScenario motion;
    motion.nods = false;
    reader.read("rate_rad_s", motion.rate_rad_s, 3, 0, 20);
    reader.read("acceleration_m_s2", motion.acceleration_m_s2, 3, 0, 100);
    reader.read("lowest_hz", motion.lowest_hz, 0.001, 100);
    reader.read("highest_hz", motion.highest_hz, 0.001, 100);
    reader.read("tones", motion.tones, 1, 1000);
    if (motion.highest_hz < motion.lowest_hz)
        reader.fail("highest_hz", "'highest_hz' is below 'lowest_hz'");
    return motion;
}

LedScenario read_leds(TableReader& reader) {
    LedScenario leds;
    leds.present = true;
    reader.choose<unsigned>("output", leds.output,
                            {{"test", firmware::output_test},
                             {"sync", firmware::output_sync},
                             {"trigger0", 0},
                             {"trigger1", 1},
                             {"trigger2", 2},
                             {"trigger3", 3}});
    reader.read("high_bit_first", leds.high_bit_first);
    reader.read("backward", leds.backward);
    return leds;
}

CameraScenario read_camera(TableReader& reader) {
    CameraScenario camera;
    reader.read("name", camera.name);
    reader.read("address", camera.address);
    reader.read("output", camera.output, 0, 3);
    reader.read("input", camera.input, -1, 3);
    reader.read("second_input", camera.second_input, -1, 3);
    reader.read("aux_input", camera.aux_input, -1, 1);
    reader.choose<LineShows>("line", camera.line,
                             {{"exposure", LineShows::exposure},
                              {"trigger", LineShows::trigger},
                              {"fixed", LineShows::fixed},
                              {"readout", LineShows::readout}});
    reader.read("line_inverted", camera.line_inverted);
    reader.read("trigger_inverted", camera.trigger_inverted);
    reader.read("free_runs", camera.free_runs);
    camera.serial = "RIGCAM-" + camera.name;
    reader.read("serial", camera.serial);
    reader.read("width", camera.width, 16, 10000);
    reader.read("height", camera.height, 1, 10000);
    reader.read("exposure_us", camera.exposure_us, 10, 1e7);
    reader.read("exposure_swing", camera.exposure_swing, 0, 0.99);
    reader.read("exposure_swing_s", camera.exposure_swing_s, 0.1, 1e4);
    reader.read("trigger_latency_us", camera.trigger_latency_us, 0, 1e5);
    reader.choose<Stamped>("stamps", camera.stamps,
                           {{"start", Stamped::start},
                            {"middle", Stamped::middle},
                            {"end", Stamped::end},
                            {"readout", Stamped::readout}});
    reader.read("line_rising_us", camera.line_rising_us, 0, 1e3);
    reader.read("line_falling_us", camera.line_falling_us, 0, 1e3);
    reader.read("readout_us", camera.readout_us, 0, 1e6);
    reader.read("link_mbps", camera.link_mbps, 0, 1e5);
    reader.read("packet_loss", camera.packet_loss, 0, 1);
    reader.read("answer_ms", camera.answer_ms, 0, 1e4);
    reader.read("extended_ids", camera.extended_ids);
    reader.read("ids_count_ignored", camera.ids_count_ignored);
    reader.read("events", camera.events);
    reader.read("early_leader", camera.early_leader);
    reader.read("shortest_period_us", camera.shortest_period_us, 0, 1e7);
    reader.read("ignored", camera.ignored, 0, 1);
    reader.read("double_every", camera.double_every, 0, INT64_MAX);
    reader.read("clock_rate", camera.clock_rate, 0.01, 100);
    reader.read("light", camera.light, 0, 1000);
    reader.read("focal_px", camera.focal_px, 0, 1e5);
    reader.read("blur_steps", camera.blur_steps, 1, 16);
    reader.read("noise", camera.noise, 0, 100);
    reader.read("imu_rotation_deg", camera.imu_rotation_deg, 3, -180, 180);
    reader.read("leds", camera.leds, 4, -1e4, 2e4);
    reader.read("led_level", camera.led_level, 0, 1000);
    reader.read("temperature_c", camera.temperature_c, -40, 150);
    reader.read("auto_gain", camera.auto_gain);
    reader.read("ptp_lock_s", camera.ptp_lock_s, 0, 1e3);
    reader.read("ptp_error_ns", camera.ptp_error_ns, -1e9, 1e9);
    reader.read("ptp_swing_ns", camera.ptp_swing_ns, 0, 1e9);
    reader.read("action_jitter_us", camera.action_jitter_us, 0, 1e5);
    reader.choose<Hostility>("hostile", camera.hostility,
                             {{"none", Hostility::none},
                              {"value_loop", Hostility::value_loop},
                              {"formula_loop", Hostility::formula_loop},
                              {"offset_loop", Hostility::offset_loop},
                              {"many_paths", Hostility::many_paths},
                              {"size_64_bit", Hostility::size_64_bit},
                              {"size_2_gib", Hostility::size_2_gib},
                              {"zip_bomb", Hostility::zip_bomb},
                              {"truncated", Hostility::truncated},
                              {"long_register", Hostility::long_register},
                              {"local_file", Hostility::local_file},
                              {"huge_frames", Hostility::huge_frames},
                              {"no_numbers", Hostility::no_numbers},
                              {"pending", Hostility::pending},
                              {"pending_at_all", Hostility::pending_at_all}});
    reader.read("model", camera.model);
    read_clock(reader, camera.clock);
    if (camera.name.empty()) reader.fail("name", "a camera needs a 'name'");
    if (!camera.model.empty() && camera.hostility != Hostility::none)
        reader.fail("hostile", "only the rig's own camera is hostile", "leave out 'model'");
    if (camera.address.empty())
        reader.fail("address", "a camera needs an 'address', such as 127.0.0.2");
    return camera;
}

Fault read_fault(TableReader& reader) {
    Fault fault;
    reader.choose<FaultKind>("kind", fault.kind,
                             {{"drop_frame", FaultKind::drop_frame},
                              {"drop_leader", FaultKind::drop_leader},
                              {"drop_last", FaultKind::drop_last},
                              {"half_frame", FaultKind::half_frame},
                              {"swap_frames", FaultKind::swap_frames},
                              {"repeat_id", FaultKind::repeat_id},
                              {"restart_ids", FaultKind::restart_ids},
                              {"jump_clock", FaultKind::jump_clock},
                              {"change_size", FaultKind::change_size},
                              {"stop_clock", FaultKind::stop_clock},
                              {"lose_ptp", FaultKind::lose_ptp},
                              {"ptp_master", FaultKind::ptp_master},
                              {"ptp_foreign", FaultKind::ptp_foreign},
                              {"utc_stamps", FaultKind::utc_stamps},
                              {"double_frame", FaultKind::double_frame},
                              {"double_exposure", FaultKind::double_exposure},
                              {"ignore_trigger", FaultKind::ignore_trigger},
                              {"camera_mute", FaultKind::camera_mute},
                              {"camera_reboot", FaultKind::camera_reboot},
                              {"lose_packets", FaultKind::lose_packets},
                              {"block_large", FaultKind::block_large},
                              {"cut_strobe", FaultKind::cut_strobe},
                              {"board_reset", FaultKind::board_reset},
                              {"board_gone", FaultKind::board_gone},
                              {"board_mute", FaultKind::board_mute},
                              {"late_records", FaultKind::late_records},
                              {"imu_missing", FaultKind::imu_missing},
                              {"imu_noisy", FaultKind::imu_noisy},
                              {"imu_stuck", FaultKind::imu_stuck}});
    reader.read("camera", fault.camera);
    reader.read("at_exposure", fault.at_exposure, 1, INT64_MAX);
    reader.read("count", fault.count, 1, INT64_MAX);
    reader.read("seconds", fault.seconds, -1e6, 1e6);
    reader.read("share", fault.share, 0, 1);
    reader.read("delay_ms", fault.delay_ms, 0, 1e4);
    return fault;
}

}  // namespace

Expected<Scenario> load_scenario(const std::string& path) {
    const auto root = parse_toml(path);
    if (!root) return Unexpected(root.error());
    TomlFile file{path, "man versavis-rig"};
    Scenario scenario;
    TableReader top(file, *root);
    top.read("seed", scenario.seed, 0, INT64_MAX);
    top.read("imu", scenario.imu);
    if (const toml::table* table = top.table("board")) {
        TableReader reader(file, *table);
        reader.read("serial", scenario.board.serial);
        reader.read("gnss", scenario.board.gnss);
        reader.read("sync_hz", scenario.board.sync_hz, 0, 10);
        reader.read("sync_skew_ppm", scenario.board.sync_skew_ppm, -1e3, 1e3);
        reader.read("link_ms", scenario.board.link_ms, 0, 1000);
        read_clock(reader, scenario.board.clock);
        reader.finish();
    }
    if (const toml::table* table = top.table("ptp")) {
        TableReader reader(file, *table);
        reader.read("ahead_of_utc_s", scenario.ptp.ahead_of_utc_s, -1e9, 1e9);
        reader.read("skew_ppm", scenario.ptp.skew_ppm, -1e3, 1e3);
        reader.finish();
    }
    if (const toml::table* table = top.table("motion")) {
        TableReader reader(file, *table);
        scenario.motion = read_motion(reader);
        reader.finish();
    }
    if (const toml::table* table = top.table("leds")) {
        TableReader reader(file, *table);
        scenario.leds = read_leds(reader);
        reader.finish();
    }
    for (const toml::table* table : top.tables("camera")) {
        TableReader reader(file, *table);
        scenario.cameras.push_back(read_camera(reader));
        if (!scenario.leds.present && !scenario.cameras.back().leds.empty())
            reader.fail("leds", "there is no LED board to be seen", "add a table [leds]");
        reader.finish();
    }
    for (const toml::table* table : top.tables("fault")) {
        TableReader reader(file, *table);
        scenario.faults.push_back(read_fault(reader));
        reader.finish();
    }
    top.finish();
    if (auto read = file.result(); !read) return Unexpected(read.error());
    return scenario;
}

}  // namespace versavis::rig
