// SPDX-License-Identifier: BSD-3-Clause
// Tells the board's time outputs where the seconds of UTC lie, and checks the pulses that they
// sent.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "board/output_pace.hpp"
#include "engine/clock/translator.hpp"
#include "settings/configuration.hpp"

namespace versavis::daemon {

enum class TimeOutputState {
    waiting,  ///< the time is not known, and sentences say so
    silent,   ///< it is, but the board reports no pulses
    sending,
    wrong,  ///< a pulse was not where its second is: the time is called unknown for a while
};
const char* to_string(TimeOutputState state);

struct TimeOutputReport {
    std::string name;
    TimeOutputState state = TimeOutputState::waiting;
    std::string hint;               ///< why it does not send
    std::uint64_t pulses = 0;       ///< that the board reported
    std::int64_t utc_s = 0;         ///< of the newest pulse; 0: there was none
    std::optional<Duration> error;  ///< of the newest pulse that was compared with the output clock
};

/// The time is called known while the board's clock is locked, nobody doubts the second, and no
/// leap second is near; not for a few seconds after a step of the output clock. Thread-safe.
class TimeAnnouncer {
 public:
    explicit TimeAnnouncer(const std::vector<TimeOutputConfiguration>& outputs);

    bool wanted() const { return !outputs_.empty(); }

    /// A new connection.
    void begin();

    /// The firmware of the board that is connected is too old.
    void board_lacks_them();

    /// What to send to the board now: once a second, and at once when the time is no longer known.
    /// The first ones of a connection also end what an earlier service used.
    std::vector<wire::TimeOutput> messages(HostTime now, clock::Translator& translator);

    /// The board sent a pulse. Returns by how much it was off, if that is wrong.
    std::optional<Duration> sent(const wire::Event& event, HostTime now,
                                 clock::Translator& translator);

    std::vector<TimeOutputReport> report(HostTime now) const;

 private:
    struct Output {
        wire::TimeOutput settings;
        TimeOutputReport report;
        HostTime reported;  ///< when the newest pulse was
        HostTime wrong;     ///< when the newest wrong one was; 0: never
        Duration wrong_by;
    };
    struct Second {
        clock::BoardSecond at;
        std::int64_t utc_s = 0;
        std::int32_t pace_ppb = 0;
        std::int64_t to_leap_s = INT64_MAX;
    };

    std::string find_second(HostTime now, clock::Translator& translator, Second& second);

    std::vector<Output> outputs_;
    mutable std::mutex mutex_;
    OutputPace pace_;
    std::optional<std::uint32_t> epoch_;
    HostTime settled_;  ///< from then on the time of this epoch is trusted
    HostTime next_;
    bool begins_ = true;                                  ///< nothing was sent by this connection
    std::string unknown_ = "the board is not connected";  ///< why the time is; empty: it is known
    HostTime known_since_;
    BoardTime known_from_;  ///< pulses from here on are of this epoch
};

}  // namespace versavis::daemon
