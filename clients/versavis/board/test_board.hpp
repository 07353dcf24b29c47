// SPDX-License-Identifier: BSD-3-Clause
// A board that a test drives: found, opened, greeted, and given one configuration after the other.
#pragma once

#include <cstdint>
#include <string>

#include "board/board_search.hpp"
#include "board/conversation.hpp"

namespace versavis::client {

class TestBoard {
 public:
    /// Errors: none, or several; another program has it; another protocol.
    static Expected<TestBoard> open(const BoardChoice& choice, const std::string& instance);

    /// Stops what runs, and waits until it is in force. Errors: refused, no answer.
    Expected<> configure(wire::Configuration configuration);

    const device::Greeting& greeting() const { return greeting_; }
    bool has(std::uint32_t part) const { return (greeting_.hello.present & part) != 0; }
    std::uint32_t present() const { return greeting_.hello.present; }

    /// Board time at which the configuration came into force: what is older is of another one.
    std::int64_t configured_ns() const { return configured_ns_; }

    Conversation& link() { return link_; }

 private:
    TestBoard(Conversation link, device::Greeting greeting)
        : link_(std::move(link)), greeting_(greeting) {}

    Conversation link_;
    device::Greeting greeting_;
    std::uint32_t id_ = 0;  ///< of the newest configuration
    std::int64_t configured_ns_ = 0;
};

}  // namespace versavis::client
