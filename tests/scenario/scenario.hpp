// SPDX-License-Identifier: BSD-3-Clause
// What every scenario begins with: a World that leaves its trace where VERSAVIS_VCD says.
#pragma once

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>

#include "adis_device.hpp"
#include "byte_register_device.hpp"
#include "world.hpp"

namespace versavis::scenario {

class Scenario : public World {
 public:
    using World::World;
    Scenario(const Scenario&) = delete;
    Scenario& operator=(const Scenario&) = delete;
    ~Scenario() {
        const char* directory = std::getenv("VERSAVIS_VCD");
        if (directory == nullptr) return;
        const std::string name = Catch::getResultCapture().getCurrentTestName();
        std::ofstream(std::string(directory) + "/" + name.substr(0, name.find(':')) + ".vcd")
            << trace().vcd();
    }
};

inline std::size_t count(const std::vector<wire::Exposure>& records, wire::ExposureFlag flag) {
    return static_cast<std::size_t>(std::count_if(
        records.begin(), records.end(), [flag](const auto& record) { return (record.flags & flag) != 0; }));
}

}  // namespace versavis::scenario
