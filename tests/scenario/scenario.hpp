// SPDX-License-Identifier: BSD-3-Clause
// What every scenario starts with: a World that writes its trace to the directory $VERSAVIS_VCD,
// and what the host heard to the directory $VERSAVIS_LOG.
#pragma once

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "adis_device.hpp"
#include "byte_register_device.hpp"
#include "message_log.hpp"
#include "world.hpp"

namespace versavis::scenario {

class Scenario : public World {
 public:
    explicit Scenario(std::uint64_t seed = 1, std::optional<firmware::PortModel> model = {})
        : World(seed, model) {
        if (std::getenv("VERSAVIS_VCD") != nullptr) record_trace();
    }
    Scenario(const Scenario&) = delete;
    Scenario& operator=(const Scenario&) = delete;
    ~Scenario() {
        if (const char* directory = std::getenv("VERSAVIS_VCD"))
            std::ofstream(fmt::format("{}/{}.vcd", directory, name())) << trace().vcd();
        if (const char* directory = std::getenv("VERSAVIS_LOG"))
            std::ofstream(log_path(directory)) << message_log(inbox());
    }

 private:
    static std::string name() {
        const std::string test = Catch::getResultCapture().getCurrentTestName();
        return test.substr(0, test.find(':'));
    }

    /// Another one for each World of the same scenario.
    static std::string log_path(const char* directory) {
        for (unsigned number = 1;; ++number) {
            const std::string path = fmt::format("{}/{}-{}.log", directory, name(), number);
            if (!std::filesystem::exists(path)) return path;
        }
    }
};

inline std::size_t count(const std::vector<wire::Exposure>& records, wire::ExposureFlag flag) {
    return static_cast<std::size_t>(
        std::count_if(records.begin(), records.end(),
                      [flag](const auto& record) { return (record.flags & flag) != 0; }));
}

/// A part on the SPI bus.
inline std::unique_ptr<devices::SpiImuDevice> make_imu(
    wire::ImuKind kind, const devices::World& motion = &World::motion) {
    using Model = devices::AdisModel;
    switch (kind) {
        case wire::ImuKind::adis16445:
            return std::make_unique<devices::AdisDevice>(Model::adis16445, motion);
        case wire::ImuKind::adis16448a:
            return std::make_unique<devices::AdisDevice>(Model::adis16448a, motion);
        case wire::ImuKind::adis16448b:
            return std::make_unique<devices::AdisDevice>(Model::adis16448b, motion);
        case wire::ImuKind::adis16460:
            return std::make_unique<devices::AdisDevice>(Model::adis16460, motion);
        case wire::ImuKind::adis16470:
            return std::make_unique<devices::AdisDevice>(Model::adis16470, motion);
        case wire::ImuKind::icm42688p: return std::make_unique<devices::Icm42688pDevice>(motion);
        default: return std::make_unique<devices::Bmi088Device>(motion);
    }
}

/// World::motion() with a tremble, so that no two samples of a sensor are the same.
inline devices::Inertial trembling(Nanoseconds at) {
    devices::Inertial felt = World::motion(at);
    felt.gyro_deg_s[0] += 5 * std::sin(static_cast<double>(at) * 1e-6);
    felt.accel_g[0] += 0.1 * std::cos(static_cast<double>(at) * 1e-6);
    return felt;
}

inline constexpr wire::ImuKind spi_imu_kinds[] = {
    wire::ImuKind::adis16445, wire::ImuKind::adis16448a, wire::ImuKind::adis16448b,
    wire::ImuKind::adis16460, wire::ImuKind::adis16470,  wire::ImuKind::icm42688p,
    wire::ImuKind::bmi088};

}  // namespace versavis::scenario
