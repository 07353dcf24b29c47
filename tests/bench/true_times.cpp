// SPDX-License-Identifier: BSD-3-Clause
#include "true_times.hpp"

#include <fstream>
#include <nlohmann/json.hpp>

namespace versavis::bench {

TimesBySerial true_times(const std::string& truth_path, const std::string& camera,
                         const std::string& type, const std::string& key) {
    TimesBySerial times;
    std::ifstream file(truth_path);
    for (std::string line; std::getline(file, line);) {
        const auto record = nlohmann::json::parse(line, nullptr, false);
        if (!record.is_discarded() && record["type"] == type && record["camera"] == camera)
            times[record["serial"]] = HostTime{record[key]};
    }
    return times;
}

}  // namespace versavis::bench
