// SPDX-License-Identifier: BSD-3-Clause
// `versavis verify --live` beside writers that run in step with it: its question whether to stop is
// their turn.
#include "commands/live_verification.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "camera_view.hpp"
#include "engine/ring/writer.hpp"
#include "pixel_formats.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_path.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;
using Catch::Contains;
using Catch::StartsWith;

namespace {

constexpr std::uint32_t live_width = 160;
constexpr std::uint32_t live_height = 120;
constexpr Duration frame_period = milliseconds(100);
constexpr Duration sample_period = milliseconds(5);
constexpr HostTime live_begin{1'000'000'000};

rig::CameraScenario scenario_of_camera() {
    rig::CameraScenario camera;
    camera.width = live_width;
    camera.height = live_height;
    camera.blur_steps = 1;
    camera.noise = 2;
    return camera;
}

rig::Scenario scenario_of_rig() {
    rig::Scenario scenario;
    scenario.motion.nods = false;
    scenario.motion.rate_rad_s = {0.1, 0.1, 0.3};
    scenario.cameras = {scenario_of_camera()};
    return scenario;
}

/// An instance that no service owns: two cameras that see the same, and an IMU.
class MovingInstance {
 public:
    MovingInstance() { std::filesystem::create_directories(instance_directory(name)); }
    ~MovingInstance() {
        for (auto& camera : cameras) camera.reset();
        imu.reset();
        std::filesystem::remove_all(instance_directory(name));
    }
    MovingInstance(const MovingInstance&) = delete;
    MovingInstance& operator=(const MovingInstance&) = delete;

    void open() {
        for (std::size_t i = 0; i < 2; ++i)
            cameras[i] = make({fmt::format("cam{}", i), ring::StreamKind::frames, 16, 8,
                               std::uint64_t{live_width} * live_height});
        imu = make({"imu0", ring::StreamKind::imu, 1024});
    }
    void restart() {
        for (auto& camera : cameras) camera.reset();
        imu.reset();
        ++epoch;
        open();
    }

    /// The next frames, and the samples until then and some after, as they come late.
    void publish() {
        if (!imu) return;
        now = now + frame_period;
        for (; sampled < now + frame_period; sampled = sampled + sample_period) {
            ImuMetadata sample{};
            sample.number = ++samples;
            sample.epoch = epoch;
            const Eigen::Vector3d rate = surroundings.motion.rate_rad_s(sampled);
            for (int i = 0; i < 3; ++i) sample.gyro[i] = static_cast<float>(rate[i]);
            imu->publish({sampled.ns}, pack(sample));
        }
        const Duration half = milliseconds(1);
        view.paint(now - half, now + half, ++serial, picture);
        for (std::size_t i = 0; i < 2; ++i) {
            FrameMetadata frame{};
            frame.width = frame.stride = live_width;
            frame.height = live_height;
            frame.pixel_format = mono8;
            frame.epoch = epoch;
            const std::uint32_t slot = cameras[i]->acquire().value();
            std::copy(picture.begin(), picture.end(),
                      reinterpret_cast<std::uint8_t*>(cameras[i]->slot_data(slot)));
            cameras[i]->publish(slot, live_width * live_height, {(now + late[i]).ns}, pack(frame));
        }
    }
    /// Publishes until the second `end`; `turn` comes before each frame, with its second.
    LiveVerificationSettings settings(
        double end, std::function<void(double s)> turn = [](double /*s*/) {}) {
        LiveVerificationSettings made;
        made.instance = name;
        made.focal = view.pinhole().focal_px;
        made.say = [this](const std::string& line, bool alarm) {
            lines.push_back(line);
            alarms += alarm ? 1 : 0;
        };
        made.stop = [this, end, turn = std::move(turn)] {
            const double s = static_cast<double>((now - live_begin).ns) * 1e-9;
            turn(s);
            publish();
            return s > end;
        };
        return made;
    }

    std::string name = fmt::format("verify-{}", ::getpid());
    std::array<std::optional<ring::Writer>, 2> cameras;
    std::optional<ring::Writer> imu;
    std::array<Duration, 2> late{};  ///< of the stamps
    std::uint32_t epoch = 1;
    HostTime now = live_begin + seconds(1);
    std::vector<std::string> lines;
    int alarms = 0;

 private:
    std::optional<ring::Writer> make(const ring::Shape& shape) const {
        return *ring::Writer::create(instance_directory(name), shape);
    }

    rig::Scenario scenario = scenario_of_rig();
    rig::Surroundings surroundings{live_begin, scenario};
    rig::CameraView view{scenario, scenario.cameras.front(), surroundings};
    std::vector<std::uint8_t> picture =
        std::vector<std::uint8_t>(std::size_t{live_width} * live_height);
    HostTime sampled = live_begin;
    std::uint64_t samples = 0;
    std::uint64_t serial = 0;
};

}  // namespace

TEST_CASE("live_verification: a camera whose stamps step by 1 ms is named, and its return",
          "[statistics]") {
    MovingInstance instance;
    instance.open();
    const auto settings = instance.settings(155, [&](double s) {
        instance.late[1] = s > 65 && s < 110 ? milliseconds(1) : Duration{};
    });
    CHECK(verify_live(settings).value_or(Grade::plausible) == Grade::untrusted);
    CAPTURE(instance.lines);
    REQUIRE(instance.lines.size() == 5);
    CHECK_THAT(instance.lines[0], Contains("cam0, cam1 against imu0: learning"));
    CHECK_THAT(instance.lines[1], Contains("cam0: time of imu0 = time of cam0"));
    CHECK_THAT(instance.lines[2], Contains("cam1: time of imu0 = time of cam1"));
    // The stretch in which it began is between.
    CHECK_THAT(instance.lines[3],
               Contains("differ by -0.9 +- 0.1 ms") || Contains("differ by -1.0 +- 0.1 ms"));
    CHECK_THAT(instance.lines[3], StartsWith("cam1: ") && Contains("its stamps are wrong"));
    CHECK(instance.alarms == 1);
    CHECK(instance.lines[4] == "cam1: pictures and stamps belong together again");
}

TEST_CASE("live_verification: wrong stamps of the IMU are not laid to the cameras",
          "[statistics]") {
    MovingInstance instance;
    instance.open();
    const auto settings = instance.settings(112, [&](double s) {
        if (s > 65) instance.late = {-milliseconds(4), -milliseconds(4)};
    });
    CHECK(verify_live(settings).value_or(Grade::plausible) == Grade::untrusted);
    CAPTURE(instance.lines);
    REQUIRE(instance.lines.size() == 5);
    CHECK_THAT(instance.lines[4], Contains("all cameras do, so the stamps of imu0 are wrong"));
}

TEST_CASE("live_verification: streams that begin late, and begin anew, are followed") {
    MovingInstance instance;
    int turns = 0;
    bool restarted = false;
    auto settings = instance.settings(112, [&](double s) {
        if (++turns == 2) instance.open();  // it has looked once, and waits
        if (s > 45 && !std::exchange(restarted, true)) instance.restart();
    });
    settings.json = true;
    settings.cameras = {"cam1"};
    CHECK(verify_live(settings).value_or(Grade::plausible) == Grade::proved);
    REQUIRE(instance.lines.size() >= 5);
    for (const std::string& line : instance.lines) {
        const auto stretch = nlohmann::json::parse(line);
        CHECK(stretch["camera"] == "cam1");
        CHECK(stretch["state"] != "differs");
        CHECK(std::abs(stretch["offset_ns"].get<double>()) < 2e5);
    }
    CHECK(nlohmann::json::parse(instance.lines.back())["state"] == "agrees");
}

TEST_CASE("live_verification: what it cannot compare is an error, or not claimed") {
    MovingInstance instance;
    instance.open();
    auto settings = instance.settings(3);
    CHECK(verify_live(settings).value_or(Grade::untrusted) == Grade::plausible);
    settings.focal = 0;
    const auto blind = verify_live(settings);
    REQUIRE_FALSE(blind);
    CHECK_THAT(blind.error().message(), Contains("--calibration"));
    settings.calibration = "/nowhere/camchain.yaml";
    const auto unread = verify_live(settings);
    REQUIRE_FALSE(unread);
    CHECK_THAT(unread.error().message(), Contains("/nowhere/camchain.yaml"));
}
