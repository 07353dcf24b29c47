// SPDX-License-Identifier: BSD-3-Clause
#include "recording_process.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <filesystem>

#include "base/shallow_json.hpp"

namespace versavis::web {

namespace {

/// What it printed until its end.
std::string output_of(const ChildProcess& process) {
    std::string text;
    std::array<char, 4096> piece{};
    for (ssize_t size = 0; (size = ::read(process.socket(), piece.data(), piece.size())) > 0;)
        text.append(piece.data(), static_cast<std::size_t>(size));
    return text;
}

}  // namespace

RecordingProcess::~RecordingProcess() {
    if (!process_) return;
    process_->send(SIGTERM);
    process_->wait();
}

Expected<> RecordingProcess::begin(HostTime now, std::time_t date) {
    look(now);
    if (process_) return failure(file_, "is being recorded already", "end it first");
    file_ = fmt::format("{}/versavis-{:%Y%m%d-%H%M%S}.mcap", directory_, fmt::localtime(date));
    report_ = nullptr;
    problem_.clear();
    auto process = ChildProcess::start({installed_program("versavis"), "--instance", instance_,
                                        "record", "--json", "--output", file_},
                                       ChildProcess::Errors::inherited);
    if (!process) return Unexpected(process.error());
    process_.emplace(std::move(*process));
    begun_ = now;
    return {};
}

Expected<> RecordingProcess::end() {
    if (!process_) return failure("recording", "none is running", "begin one first");
    process_->send(SIGTERM);
    return {};
}

void RecordingProcess::look(HostTime now) {
    if (!process_ || !process_->ended()) return;
    ended_ = now;
    report_ = client::parse_shallow_json(output_of(*process_));
    process_.reset();
    if (report_.is_object()) return;
    report_ = nullptr;
    problem_ = file_ + ": nothing was recorded; the log of versavis-web says why";
}

nlohmann::json RecordingProcess::facts(HostTime now) {
    look(now);
    std::error_code error;
    const auto bytes = std::filesystem::file_size(file_, error);
    const Duration length = (process_ ? now : ended_) - begun_;
    return {{"possible", possible()},
            {"running", process_.has_value()},
            {"file", file_},
            {"seconds", static_cast<double>(length.ns) * 1e-9},
            {"bytes", error ? 0 : bytes},
            {"report", report_},
            {"problem", problem_}};
}

}  // namespace versavis::web
