// SPDX-License-Identifier: BSD-3-Clause
#include "recorder.hpp"

#include <stdexcept>

namespace versavis::firmware::replay {

void Recorder::Tape::begin(const char* name) {
    words.push_back(names.try_emplace(name, names.size()).first->second);
    count_at = words.size();
    words.push_back(0);
}

void Recorder::Tape::end_arguments() {
    words[count_at] = static_cast<std::uint32_t>(words.size() - count_at - 1);
    count_at = words.size();
    words.push_back(0);
}

std::uint32_t Recorder::Tape::result(std::uint32_t word) {
    ++words[count_at];
    words.push_back(word);
    return word;
}

Hal Recorder::tap(const Hal& hal, const Identity& identity) {
    if (hal_) throw std::logic_error("a recording has one life of one board");
    taped_value(tape_, "identity", identity);
    taped_value(tape_, "facts", hal.facts);
    return hal_.emplace(tape_, &hal).hal(hal.facts);
}

void Recorder::poll_begins(Nanoseconds now) {
    taped_poll(tape_, next_wake_,
               static_cast<std::uint8_t>(measured_ ? poll_again | poll_measured : poll_again));
    polls_.push_back({now, measured_});
}

std::vector<std::uint32_t> Recorder::words() const {
    Tape ended = tape_;
    taped_poll(ended, next_wake_);
    std::vector<std::string> names(ended.names.size());
    for (const auto& [name, index] : ended.names) names[index] = name;
    std::vector<std::uint32_t> words{magic, static_cast<std::uint32_t>(names.size())};
    for (std::string& name : names) {
        words.push_back(static_cast<std::uint32_t>(name.size()));
        Words([&words](std::uint32_t word) {
            return words.push_back(word), word;
        }).pass_bytes(name.data(), name.size());
    }
    words.insert(words.end(), ended.words.begin(), ended.words.end());
    return words;
}

}  // namespace versavis::firmware::replay
