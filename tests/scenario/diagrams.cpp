// SPDX-License-Identifier: BSD-3-Clause
// diagrams [--check] DIRECTORY: draws the diagrams of docs/design/firmware.md from traces of the
// firmware at work, or checks that those in DIRECTORY are what it would draw.
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>

#include "world.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

struct Diagram {
    std::string name;
    std::string svg;
};

std::vector<std::int64_t> grid_points(const World& world, unsigned camera, std::uint64_t count) {
    std::vector<std::int64_t> points;
    for (std::uint64_t tick = 0; tick < count; ++tick)
        points.push_back(world.grid_time(camera, tick));
    return points;
}

void run(World& world, std::uint8_t flags, Nanoseconds duration) {
    world.record_trace();
    if (!world.begin(flags)) throw std::runtime_error("the board refused the configuration");
    world.run(duration);
}

Diagram compensation() {
    World world;
    CameraSettings settings;
    settings.exposure = [](std::uint64_t pulse, auto) { return pulse < 4 ? 8 * ms : 24 * ms; };
    world.add_camera(0, settings);
    run(world, 0, second);
    const Nanoseconds from = world.grid_time(0, 2);
    return {"exposure-compensation",
            world.trace().svg(
                {"An exposure that triples: one middle off the grid (red) by half the change, the "
                 "next on it",
                 from,
                 from + 200 * ms,
                 20 * ms,
                 {"trigger0", "exposure0"},
                 grid_points(world, 0, 20)})};
}

Diagram announced() {
    World world;
    CameraSettings settings;
    settings.exposure = [](std::uint64_t pulse, auto) { return pulse < 4 ? 8 * ms : 24 * ms; };
    world.add_camera(0, settings);
    world.record_trace();
    world.connect();
    world.configure();
    world.send(wire::ExpectedExposure{0, {}, 1, 8 * ms});
    world.send(wire::ExpectedExposure{0, {}, 4, 24 * ms});
    world.start();
    world.run(second);
    const Nanoseconds from = world.grid_time(0, 2);
    return {"announced",
            world.trace().svg({"The same, announced by the host: every middle on the grid",
                               from,
                               from + 200 * ms,
                               20 * ms,
                               {"trigger0", "exposure0"},
                               grid_points(world, 0, 20)})};
}

Diagram overlong() {
    World world;
    CameraSettings settings;
    settings.exposure = [](std::uint64_t pulse, auto) { return pulse == 3 ? 70 * ms : 10 * ms; };
    world.add_camera(0, settings);
    world.configuration.cameras[0].max_exposure_ns = 100 * ms;
    run(world, 0, second);
    const Nanoseconds from = world.grid_time(0, 2);
    return {"overlong",
            world.trace().svg(
                {"Longer than the period: triggers are skipped and reported, the grid stays",
                 from,
                 from + 300 * ms,
                 50 * ms,
                 {"trigger0", "exposure0"},
                 grid_points(world, 0, 20)})};
}

Diagram master_slave() {
    World world;
    CameraSettings master;
    master.exposure = [](std::uint64_t pulse, auto) {
        return (4 + 4 * static_cast<Nanoseconds>(pulse % 3)) * ms;
    };
    world.add_camera(0, master);
    CameraSettings slave;
    slave.trigger_width = true;
    slave.latency = 100 * us;
    world.add_camera(1, slave);
    world.configuration.cameras[1].flags |= wire::camera_slave;
    run(world, 0, second);
    const Nanoseconds from = world.grid_time(0, 2);
    return {"master-slave",
            world.trace().svg({"A slave (1) is triggered by its master's exposure line (0)",
                               from,
                               from + 150 * ms,
                               25 * ms,
                               {"trigger0", "exposure0", "trigger1", "exposure1"},
                               grid_points(world, 0, 20)})};
}

Diagram illumination() {
    World world;
    for (unsigned camera = 0; camera < 2; ++camera) {
        CameraSettings settings;
        settings.exposure = [camera](auto, auto) { return (5 + 5 * camera) * ms; };
        if (camera == 1)
            settings.fault = [](std::uint64_t pulse) {
                return pulse == 5 ? Fault::end_lost : Fault::none;
            };
        world.add_camera(camera, settings);
        world.configuration.cameras[camera].phase_ns = camera * 12'000'000;
    }
    world.configuration.illumination = {3, 0, 0, 1'000'000, 15'000'000, 900'000};
    run(world, 0, second);
    const Nanoseconds from = world.grid_time(0, 2);
    return {"illumination",
            world.trace().svg(
                {"Light leads the union of the exposures; when a line sticks, it ends at its limit",
                 from,
                 from + 200 * ms,
                 25 * ms,
                 {"exposure0", "exposure1", "light"},
                 {}})};
}

Diagram start_pattern() {
    World world;
    world.add_camera(0);
    run(world, wire::start_pattern, 2 * second);
    const Nanoseconds from = world.camera(0).pulses()[0].at - 25 * ms;
    return {"start-pattern",
            world.trace().svg(
                {"The start pattern at 20 Hz: gaps of 1 2 1 3 2 2 3 3 1 1 periods, then every one",
                 from,
                 from + 1250 * ms,
                 250 * ms,
                 {"trigger0"},
                 grid_points(world, 0, 60)})};
}

bool same_as_file(const std::string& path, const std::string& text) {
    std::ifstream file(path);
    return std::string(std::istreambuf_iterator<char>(file), {}) == text;
}

}  // namespace

int main(int argc, char** argv) {
    const bool check = argc == 3 && std::strcmp(argv[1], "--check") == 0;
    if (argc != 2 && !check) {
        std::cerr << "usage: diagrams [--check] DIRECTORY\n";
        return 64;
    }
    int outdated = 0;
    for (const Diagram& diagram : {compensation(), announced(), overlong(), master_slave(),
                                   illumination(), start_pattern()}) {
        const std::string path = std::string(argv[argc - 1]) + "/" + diagram.name + ".svg";
        if (!check) {
            std::ofstream(path) << diagram.svg;
        } else if (!same_as_file(path, diagram.svg)) {
            std::cerr << path << " does not show what the firmware does now: run ./dev diagrams\n";
            ++outdated;
        }
    }
    return outdated == 0 ? 0 : 1;
}
