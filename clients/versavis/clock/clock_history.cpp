// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>

#include "posix/file.hpp"

namespace versavis::client {

namespace {

using namespace clock;

using Wide = __int128;  // recorded stamps may have any value

BoardTime board_middle(const Exchange& e) { return {std::midpoint(e.received.ns, e.answered.ns)}; }
HostTime host_middle(const Exchange& e) { return {std::midpoint(e.sent.ns, e.arrived.ns)}; }

}  // namespace

std::vector<ClockPoint> clock_history(const ClockRecording& recording, ClockEstimator& estimator) {
    std::vector<ClockPoint> history;
    std::optional<Exchange> first;
    HostTime begin;
    double changed_ns = 0;
    for (const TimedMessage& timed : recording.messages) {
        const auto* exchange = std::get_if<Exchange>(&timed.message);
        const BoardTime board =
            exchange != nullptr ? board_middle(*exchange) : std::get<OneWay>(timed.message).sent;
        const HostEstimate before = estimator.translate(board);
        estimator.add(timed.message);
        const HostEstimate after = estimator.translate(board);
        if (after.state == ClockState::init) continue;
        const bool began = before.state == ClockState::init;
        if (!began) changed_ns += static_cast<double>(Wide{after.time.ns} - Wide{before.time.ns});
        if (exchange == nullptr) continue;
        if (!first) {
            first = *exchange;
            begin = after.time;
        }
        const HostTime host = host_middle(*exchange);
        const Wide advance_host = Wide{after.time.ns} - Wide{host_middle(*first).ns};
        const Wide advance_board = Wide{board.ns} - Wide{board_middle(*first).ns};
        const HostTime expected = began ? after.time : before.time;
        // Both stamps of a point are at one instant, by the estimate; the midpoint may be far from
        // it.
        history.push_back({static_cast<double>(Wide{after.time.ns} - Wide{begin.ns}) * 1e-9,
                           static_cast<double>(advance_host - advance_board),
                           static_cast<double>(after.sigma.ns), estimator.skew_ppm(),
                           estimator.skew_sigma_ppm(),
                           static_cast<double>(Wide{host.ns} - Wide{expected.ns}), changed_ns});
        changed_ns = 0;
    }
    std::stable_sort(history.begin(), history.end(),
                     [](const ClockPoint& a, const ClockPoint& b) { return a.time_s < b.time_s; });
    return history;
}

std::string to_csv(const std::vector<ClockPoint>& history) {
    std::string text =
        "time_s,offset_ns,sigma_ns,skew_ppm,skew_sigma_ppm,residual_ns,innovation_ns\n";
    for (const ClockPoint& p : history)
        text +=
            fmt::format("{:.9f},{:.0f},{:.0f},{:.9g},{:.9g},{:.0f},{:.0f}\n", p.time_s, p.offset_ns,
                        p.sigma_ns, p.skew_ppm, p.skew_sigma_ppm, p.residual_ns, p.innovation_ns);
    return text;
}

Expected<std::size_t> write_clock_history(const ClockHistorySettings& settings) {
    const auto checked = check_output(settings.out, {settings.exchanges, settings.oneway});
    if (!checked) return Unexpected(checked.error());
    const auto recording = read_clock_recording(settings.exchanges, settings.oneway);
    if (!recording) return Unexpected(recording.error());
    const auto history = clock_history(*recording, *make_estimator(settings.estimator));
    if (history.empty())
        return failure(settings.exchanges, "contains no exchange that an estimator can start from",
                       "round trips must be positive: are the columns in the right order?");
    const auto written = write_whole_file(settings.out, to_csv(history));
    if (!written) return Unexpected(written.error());
    return history.size();
}

}  // namespace versavis::client
