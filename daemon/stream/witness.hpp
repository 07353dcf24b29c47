// SPDX-License-Identifier: BSD-3-Clause
// Believes a message when it agrees with those before it, and a change when several messages agree.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "stream/doubt.hpp"

namespace versavis::daemon {

/// History: what messages were believed. It has `std::optional<Doubt> doubt(message) const`,
/// `void learn(message)`, and `void rebase()`, after which it knows what is usual but not where the
/// next message belongs; one that has learned nothing doubts nothing. Not thread-safe.
template <class History>
class Witness {
 public:
    /// `to_confirm`: messages that must agree, after nothing was known, until they are confirmed.
    explicit Witness(History blank, int to_confirm = 1)
        : blank_(std::move(blank)), believed_(blank_), rival_(blank_), to_confirm_(to_confirm) {}

    /// None: the message is believed, and remembered. `exchanges`: of the clock until now.
    /// `arrival`: what speaks against it already; then it can only be one of several that agree.
    template <class Message>
    std::optional<Doubt> judge(const Message& message, std::uint64_t exchanges,
                               const std::optional<Doubt>& arrival = std::nullopt) {
        if (arrival && !confirmed()) return arrival;
        auto doubt = believed_.doubt(message);
        if (doubt && !confirmed()) {  // which of them lies, nobody can tell
            believed_.rebase();
            agreed_ = 0;
            doubt = believed_.doubt(message);
        }
        if (!doubt) {
            if (arrival) return arrival;
            believed_.learn(message);
            rivals_ = 0;
            if (!confirmed()) ++agreed_;
            return std::nullopt;
        }
        if (rivals_ > 0 && rival_.doubt(message)) rivals_ = 0;
        if (rivals_++ == 0) {
            rival_ = blank_;
            rival_since_ = exchanges;
        }
        rival_.learn(message);
        return arrival ? arrival : doubt;
    }

    /// The newest one that was believed has others beside it.
    bool confirmed() const { return agreed_ >= to_confirm_; }

    /// So many doubted messages in a row agree among themselves that it is no accident, and the
    /// clock has been compared often enough since to know that it was not its own step.
    bool stepped(std::uint64_t exchanges) const {
        return rivals_ >= rivals_to_step && exchanges - rival_since_ >= exchanges_to_confirm;
    }

    /// From now on those are believed, of which `message` is the newest.
    template <class Message>
    void adopt(const Message& message) {
        forget();
        if (believed_.doubt(message))
            believed_ = rival_;
        else
            believed_.learn(message);
        agreed_ = to_confirm_;
    }

    /// The next message may belong anywhere.
    void forget() {
        believed_.rebase();
        rivals_ = 0;
        agreed_ = 0;
    }

    History& believed() { return believed_; }

 private:
    /// Messages that must agree among themselves against all before. At half, two equal accidents
    /// pass; at twice, a true step costs twice as many messages.
    static constexpr int rivals_to_step = 3;

    /// An estimate that is contradicted begins anew with the third exchange, and lies may agree for
    /// a moment. At half, a step of the board's clock passes for one of the stream; at twice, a
    /// true one costs 0.4 s more.
    static constexpr std::uint64_t exchanges_to_confirm = 4;

    History blank_;
    History believed_;
    History rival_;
    int rivals_ = 0;
    std::uint64_t rival_since_ = 0;
    int to_confirm_;
    int agreed_ = 0;
};

}  // namespace versavis::daemon
