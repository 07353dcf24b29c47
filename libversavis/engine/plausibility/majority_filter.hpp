// SPDX-License-Identifier: BSD-3-Clause
// Believes a message when it agrees with those before it, and a change when several messages agree.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "engine/plausibility/implausibility.hpp"
#include "engine/plausibility/persistence.hpp"

namespace versavis {

/// History: what messages were believed. It has `std::optional<Implausibility> doubt(message)
/// const`, `void learn(message)`, `bool repeats(message) const`, true of the newest one come twice,
/// and `void rebase()`, after which it knows what is usual but not where the next message belongs;
/// one that has learned nothing doubts nothing. Not thread-safe.
///
/// Where messages disagree the majority decides, by one candidate and a count of those for it less
/// those against it (R. Boyer, J. Moore, MJRTY: a fast majority vote algorithm, 1991): lies in
/// between delay the truth, but do not keep it out.
template <class History>
class MajorityFilter {
 public:
    /// `to_confirm`: majority that messages must have, after nothing was known, until they are
    /// confirmed.
    explicit MajorityFilter(History blank, int to_confirm = 1)
        : blank_(std::move(blank)),
          usual_(blank_),
          believed_(blank_),
          rival_(blank_),
          to_confirm_(to_confirm) {}

    /// None: the message is believed, and remembered. `exchanges`: of the clock until now.
    /// `arrival`: what speaks against it already; then it can only be one of several that agree.
    template <class Message>
    std::optional<Implausibility> judge(
        const Message& message, std::uint64_t exchanges,
        const std::optional<Implausibility>& arrival = std::nullopt) {
        overturned_ = voted_ = false;
        if (!confirmed()) {
            believed_since_ = exchanges;
            return arrival ? arrival : judge_unconfirmed(message);
        }
        const auto doubt = believed_.doubt(message);
        if (doubt) vote(message, exchanges);
        if (arrival || doubt) return arrival ? arrival : doubt;
        believed_.learn(message);
        votes_ = std::max(votes_ - votes_of_truth, 0);
        return std::nullopt;
    }

    /// The newest one that was believed has others beside it.
    bool confirmed() const { return agreed_ >= to_confirm_; }

    /// The newest message has made those void that were believed, but not confirmed, before it.
    bool overturned() const { return overturned_; }

    /// So many doubted messages, of which this is one, agree among themselves that it is no
    /// accident, and the clock has been compared often enough since to know that it was not its own
    /// step.
    bool stepped(std::uint64_t exchanges) const {
        return voted_ && votes_ >= votes_to_step &&
               exchanges - rival_since_ >= exchanges_to_confirm;
    }

    /// The same where nothing but the stream itself can say which of the two is right: they have
    /// agreed for twice as long as those that were believed before, and for `least` exchanges.
    bool prevailed(std::uint64_t exchanges, std::uint64_t least = 0) const {
        const std::uint64_t believed_for = rival_since_ - believed_since_;
        return stepped(exchanges) &&
               exchanges - rival_since_ >= std::clamp(believed_for * 2, least, most_to_prevail);
    }

    /// From now on those are believed, of which `message` is the newest.
    template <class Message>
    void adopt(const Message& message) {
        forget();
        believed_since_ = rival_since_;
        if (believed_.doubt(message))
            believed_ = rival_;
        else
            believed_.learn(message);
        agreed_ = to_confirm_;
    }

    /// The next message may belong anywhere.
    void forget() {
        if (confirmed()) {
            usual_ = believed_;
            usual_.rebase();
        }
        believed_ = usual_;
        votes_ = agreed_ = 0;
    }

    History& believed() { return believed_; }

 private:
    /// Majority of messages that agree among themselves against all before.
    static constexpr int votes_to_step = 3;

    /// An estimate that is contradicted begins anew with the third exchange, and lies may agree for
    /// a moment.
    static constexpr std::uint64_t exchanges_to_confirm = 4;

    /// Votes against a rival that a message has which fits what is believed.
    static constexpr int votes_of_truth = 8;

    template <class Message>
    std::optional<Implausibility> judge_unconfirmed(const Message& message) {
        if (const auto doubt = believed_.doubt(message)) {
            if (believed_.repeats(message)) return doubt;
            if (agreed_ > 1) {
                --agreed_;
                return doubt;
            }
            overturned_ = agreed_ > 0;
            agreed_ = 0;
            believed_ = usual_;
            if (const auto unusual = believed_.doubt(message)) return unusual;
        }
        believed_.learn(message);
        ++agreed_;
        return std::nullopt;
    }

    template <class Message>
    void vote(const Message& message, std::uint64_t exchanges) {
        if (votes_ > 0 && rival_.doubt(message)) {
            if (--votes_ > 0) return;
        }
        if (votes_ == 0) {
            rival_ = blank_;
            rival_since_ = exchanges;
        }
        rival_.learn(message);
        ++votes_;
        voted_ = true;
    }

    History blank_;
    History usual_;  ///< what was known of messages in general before all was forgotten
    History believed_;
    History rival_;
    int votes_ = 0;  ///< for the rival
    bool voted_ = false;
    std::uint64_t rival_since_ = 0;
    std::uint64_t believed_since_ = 0;
    int to_confirm_;
    int agreed_ = 0;
    bool overturned_ = false;
};

}  // namespace versavis
