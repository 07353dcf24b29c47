// SPDX-License-Identifier: BSD-3-Clause
// Records what the core asks of its hardware and what it gets, poll by poll, for a replay on the
// chip's instruction set.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "native_board.hpp"
#include "taped_hal.hpp"

namespace versavis::firmware::replay {

struct RecordedPoll {
    Nanoseconds at;
    bool measured;
};

/// Of one life of one board. The file, in little-endian words: `magic`; how many names there are;
/// each name's size and its bytes, padded; then the calls: name, number of arguments, the
/// arguments, number of results, the results.
class Recorder final : public CoreTap {
 public:
    Hal tap(const Hal& hal, const Identity& identity) override;
    void poll_begins(Nanoseconds now) override;
    void poll_ended(Nanoseconds next_wake) override { next_wake_ = next_wake; }

    /// From now on polls are part of the figures, or not.
    void set_measured(bool measured) { measured_ = measured; }

    const std::vector<RecordedPoll>& polls() const { return polls_; }

    /// The recording up to now.
    std::vector<std::uint32_t> words() const;

    static constexpr std::uint32_t magic = 0x31505653;  ///< "SVP1"

 private:
    /// Calls do not nest.
    struct Tape {
        void begin(const char* name);
        void argument(std::uint32_t word) { words.push_back(word); }
        void end_arguments();
        std::uint32_t result(std::uint32_t word);
        template <class Result, class Real>
        Result perform(Real real) {
            return real();
        }

        std::map<std::string, std::uint32_t> names;
        std::vector<std::uint32_t> words;
        std::size_t count_at = 0;  ///< of the arguments or results that are being written
    };

    Tape tape_;
    std::optional<TapedHal<Tape>> hal_;
    Nanoseconds next_wake_ = never;
    bool measured_ = false;
    std::vector<RecordedPoll> polls_;
};

}  // namespace versavis::firmware::replay
