// SPDX-License-Identifier: BSD-3-Clause
// The judge, a process of its own that knows the contracts and nothing else of us.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace versavis::liar {

class JudgeProcess {
 public:
    /// `arguments`: those of tests/liar/judge. Throws when it cannot be started.
    explicit JudgeProcess(std::vector<std::string> arguments);
    ~JudgeProcess();
    JudgeProcess(const JudgeProcess&) = delete;
    JudgeProcess& operator=(const JudgeProcess&) = delete;

    /// See the judge's own list of commands. Throws when it has ended.
    void command(const nlohmann::json& command);
    nlohmann::json report();

 private:
    int pid_ = -1;
    int to_judge_ = -1;
    int from_judge_ = -1;
    std::string received_;
};

}  // namespace versavis::liar
