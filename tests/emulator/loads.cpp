// SPDX-License-Identifier: BSD-3-Clause
#include "loads.hpp"

#include <algorithm>
#include <stdexcept>

#include "adis_device.hpp"
#include "byte_register_device.hpp"

namespace versavis::emulator {

namespace {

using firmware::replay::Recorder;
using scenario::CameraSettings;
using scenario::ms;
using scenario::us;
using scenario::World;

// Until an IMU is set up and the cameras have a rhythm.
constexpr Nanoseconds settling = 900 * ms;
// The host asks for the time: as often as it does while a link is new.
constexpr Nanoseconds clock_interval = 100 * ms;
// Between two looks at the idle board; no multiple of anything.
constexpr Nanoseconds idle_interval = 1'037'013;
constexpr int idle_polls = 100;
// Edges of four lines 1.3 ms apart, for as long as the code stalls, are more than a ring holds.
constexpr Nanoseconds stall = 100 * ms;
constexpr Nanoseconds edge_interval = 1'300'000;
// Long enough for everything that a message sets off.
constexpr Nanoseconds aftermath = 50 * ms;

/// Each exposes a little longer than the one before, as their exposure controls would have it: no
/// two edges come at once.
void add_cameras(World& world, std::uint32_t rate_uhz, Nanoseconds shortest) {
    for (unsigned camera = 0; camera < firmware::camera_count; ++camera) {
        const Nanoseconds exposure = shortest + camera * shortest / 5;
        CameraSettings settings;
        settings.exposure = [exposure](auto, auto) { return exposure; };
        world.add_camera(camera, settings, rate_uhz);
        world.configuration.cameras[camera].exposure_ns = static_cast<std::uint64_t>(exposure);
    }
}

void add_light(World& world) {
    world.configuration.illumination = {15, 0, 0, 100'000, 4'000'000, 900'000};
}

void add_adis(World& world) {
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
        wire::ImuKind::adis16448b, 819.2, true);
}

void begin(World& world) {
    if (!world.begin()) throw std::runtime_error("the board refuses the configuration of a load");
}

void run_with_clock(World& world, Nanoseconds duration) {
    const Nanoseconds end = world.now() + duration;
    for (std::uint32_t id = 1; world.now() < end; ++id) {
        world.send(wire::ClockRequest{id, 0});
        world.run(std::min(clock_interval, end - world.now()));
    }
}

void measure(World& world, Recorder& recorder, Nanoseconds duration) {
    begin(world);
    run_with_clock(world, settling);
    recorder.set_measured(true);
    run_with_clock(world, duration);
}

void idle(World& world, Recorder& recorder, Nanoseconds) {
    add_cameras(world, 50'000'000, 3 * ms);
    add_adis(world);
    begin(world);
    run_with_clock(world, settling);
    for (int i = 0; i < idle_polls; ++i) {
        world.run(idle_interval);
        recorder.set_measured(true);
        world.send_bytes({});  // wakes the code, and brings nothing
        recorder.set_measured(false);
    }
}

void adis_alone(World& world, Recorder& recorder, Nanoseconds duration) {
    add_adis(world);
    measure(world, recorder, duration);
}

void adis(World& world, Recorder& recorder, Nanoseconds duration) {
    add_cameras(world, 50'000'000, 3 * ms);
    add_adis(world);
    measure(world, recorder, duration);
}

void adis_light(World& world, Recorder& recorder, Nanoseconds duration) {
    add_light(world);
    adis(world, recorder, duration);
}

void vn100(World& world, Recorder& recorder, Nanoseconds duration) {
    add_cameras(world, 50'000'000, 3 * ms);
    world.add_vn100(800, true);
    measure(world, recorder, duration);
}

void fastest(World& world, Recorder& recorder, Nanoseconds duration) {
    add_cameras(world, 200'000'000, 2 * ms);
    add_light(world);
    world.add_imu(std::make_unique<devices::Icm42688pDevice>(&World::motion),
                  wire::ImuKind::icm42688p, 8000, true);
    // A packet of USB at a time, and thirteen of the nineteen that a millisecond carries.
    world.set_link(76'923, 64, 128);
    measure(world, recorder, duration);
}

void configuration(World& world, Recorder& recorder, Nanoseconds) {
    add_cameras(world, 50'000'000, 3 * ms);
    add_adis(world);
    add_light(world);
    begin(world);
    world.run(settling);
    world.stop();
    world.run(aftermath);
    recorder.set_measured(true);
    begin(world);
    world.run(aftermath);
}

void edge_ring(World& world, Recorder& recorder, Nanoseconds) {
    add_cameras(world, 50'000'000, 3 * ms);
    add_adis(world);
    begin(world);
    world.run(settling);
    for (unsigned camera = 0; camera < firmware::camera_count; ++camera)
        world.add_noise(static_cast<std::uint8_t>(camera), edge_interval, world.now() + ms,
                        world.now() + stall);
    world.stall_board(stall);
    recorder.set_measured(true);
    world.run(aftermath);
}

void add_fast_cameras(World& world, Nanoseconds expected) {
    add_cameras(world, 1'000'000'000, 300 * us);
    for (wire::CameraConfiguration& camera : world.configuration.cameras) {
        camera.exposure_ns = static_cast<std::uint64_t>(expected);
        camera.max_exposure_ns = 10 * scenario::second;
    }
}

void start_of_long(World& world, Recorder& recorder, Nanoseconds) {
    add_fast_cameras(world, 10 * scenario::second);
    world.connect();
    if (!world.configure()) throw std::runtime_error("the board refuses a long exposure");
    recorder.set_measured(true);
    world.start();
    world.run(aftermath);
}

void announcement_of_long(World& world, Recorder& recorder, Nanoseconds) {
    add_fast_cameras(world, 300 * us);
    begin(world);
    world.run(100 * ms);
    recorder.set_measured(true);
    for (std::uint8_t camera = 0; camera < firmware::camera_count; ++camera)
        world.send(wire::ExpectedExposure{
            camera, {}, world.camera(camera).pulses().size() + 4, 8 * scenario::second});
    world.run(aftermath);
}

}  // namespace

const std::vector<Load>& loads() {
    constexpr Nanoseconds second = scenario::second;
    static const std::vector<Load> all = {
        {"idle", "4 x 50 Hz + ADIS16448B, nothing due", false, 0, idle},
        {"adis_alone", "ADIS16448B 819 Hz", true, second, adis_alone},
        {"adis", "4 x 50 Hz + ADIS16448B 819 Hz", true, second, adis},
        {"adis_light", "the same with light", true, second, adis_light},
        {"vn100", "4 x 50 Hz + VN-100 800 Hz", true, second, vn100},
        {"fastest", "4 x 200 Hz + ICM-42688-P 8 kHz + light", true, 200 * ms, fastest},
        {"configuration", "a new configuration", false, 0, configuration},
        {"edge_ring", "a full ring of edges", false, 0, edge_ring},
        {"long_start", "start at 1 kHz, exposure 10 s", false, 0, start_of_long},
        {"long_announced", "8 s announced at 1 kHz", false, 0, announcement_of_long},
    };
    return all;
}

const Load& load(const std::string& name) {
    for (const Load& load : loads())
        if (name == load.name) return load;
    throw std::invalid_argument("there is no load " + name);
}

std::unique_ptr<Lived> live(const Load& load, Nanoseconds measured_for) {
    auto lived = std::make_unique<Lived>();
    lived->measured_for = measured_for;
    World world(1, firmware::PortModel{}, &lived->recorder);
    load.live(world, lived->recorder, measured_for);
    for (const auto& [port, samples] : world.inbox().samples)
        lived->samples.insert(lived->samples.end(), samples.begin(), samples.end());
    return lived;
}

}  // namespace versavis::emulator
