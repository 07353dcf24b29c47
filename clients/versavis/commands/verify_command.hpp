// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis verify`.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "evaluate/picture_offsets.hpp"

namespace versavis::client {

class VerifyCommand {
 public:
    /// Adds the command to the options of the program; `stop` returns true when it is to end.
    VerifyCommand(CLI::App& app, std::function<bool()> stop);
    VerifyCommand(const VerifyCommand&) = delete;  // options write to the members
    VerifyCommand& operator=(const VerifyCommand&) = delete;

    bool chosen() const;
    int run(const std::string& instance) const;

 private:
    int verify_files() const;
    int verify_instance(const std::string& instance) const;
    std::map<std::string, PictureEvidence> pictures_of(const std::string& file) const;
    int check_signatures() const;

    CLI::App* command_;
    std::function<bool()> stop_;
    std::vector<std::string> files_;
    std::string html_;
    ImuEvaluationSettings pictures_;
    bool compare_pictures_ = false;
    bool live_ = false;
    double seconds_ = 0;
    std::string key_;
    std::string public_key_;
    bool json_ = false;
};

}  // namespace versavis::client
