// SPDX-License-Identifier: BSD-3-Clause
#include "problem_report.hpp"

#include <nlohmann/json.hpp>

namespace versavis::daemon {

using nlohmann::json;

std::string to_json(const std::vector<std::string>& files, const TomlProblems& problems) {
    json list = json::array();
    for (const TomlProblem& problem : problems) {
        json entry{{"file", problem.place.path}, {"what", problem.what}, {"cure", problem.cure}};
        if (problem.place.line != 0) {
            entry["line"] = problem.place.line;
            entry["column"] = problem.place.column;
        }
        if (!problem.table.empty()) entry["table"] = problem.table;
        if (!problem.key.empty()) entry["key"] = problem.key;
        if (const auto unit = unit_of(problem.key); !unit.empty()) entry["unit"] = unit;
        if (problem.range.minimum) entry["minimum"] = *problem.range.minimum;
        if (problem.range.maximum) entry["maximum"] = *problem.range.maximum;
        list.push_back(std::move(entry));
    }
    // A name in the file system may hold any bytes.
    return json{{"file", files.front()}, {"files", files}, {"problems", list}}.dump(
        2, ' ', false, json::error_handler_t::replace);
}

}  // namespace versavis::daemon
