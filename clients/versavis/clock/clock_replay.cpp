// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <numeric>

#include "base/plausible_time.hpp"
#include "clock/clock_csv.hpp"
#include "posix/file.hpp"

namespace versavis::client {

namespace {

using namespace clock;

template <class Filter>
class Estimator final : public ClockEstimator {
 public:
    explicit Estimator(Filter filter) : filter_(std::move(filter)) {}

    void add(const Message& message) override {
        std::visit([this](const auto& m) { filter_.add(m); }, message);
    }
    HostEstimate translate(BoardTime board) const override { return filter_.translate(board); }
    double skew_ppm() const override { return filter_.skew_ppm(); }
    double skew_sigma_ppm() const override { return filter_.skew_sigma_ppm(); }

 private:
    Filter filter_;
};

Expected<void> read_exchanges(const std::string& path, ClockRecording& recording) {
    const auto table = read_csv(path, {{"h1_ns", "m2_ns", "m3_ns", "h4_ns"}, {"available_ns"}});
    if (!table) return Unexpected(table.error());
    if (table->rows == 0)
        return failure(path, "contains no exchanges, only a header",
                       "record for at least a few seconds");
    const auto& columns = table->columns;
    const auto& available = columns[4].empty() ? columns[3] : columns[4];
    for (std::size_t i = 0; i < table->rows; ++i) {
        const Exchange exchange{{columns[0][i]}, {columns[1][i]}, {columns[2][i]}, {columns[3][i]}};
        const bool kept = is_plausible(exchange.sent.ns) && is_plausible(exchange.received.ns) &&
                          is_plausible(exchange.answered.ns) && is_plausible(exchange.arrived.ns);
        if (kept)
            recording.messages.push_back({{available[i]}, exchange});
        else
            ++recording.ignored;
    }
    return {};
}

Expected<void> read_oneway(const std::string& path, ClockRecording& recording) {
    const auto table = read_csv(path, {{"m_ns", "h_ns"}, {}});
    if (!table) return Unexpected(table.error());
    for (std::size_t i = 0; i < table->rows; ++i) {
        const OneWay message{{table->columns[0][i]}, {table->columns[1][i]}};
        if (is_plausible(message.sent.ns) && is_plausible(message.arrived.ns))
            recording.messages.push_back({message.arrived, message});
        else
            ++recording.ignored;
    }
    return {};
}

Expected<std::vector<ClockQuery>> read_queries(const std::string& path) {
    const auto table = read_csv(path, {{"available_ns", "board_ns"}, {}});
    if (!table) return Unexpected(table.error());
    std::vector<ClockQuery> queries;
    queries.reserve(table->rows);
    for (std::size_t i = 0; i < table->rows; ++i)
        queries.push_back({{table->columns[0][i]}, {table->columns[1][i]}});
    return queries;
}

std::string to_csv(const std::vector<ClockQuery>& queries, const ClockAnswers& answers) {
    std::string text = "board_ns,host_ns,sigma_ns,state\n";
    auto out = std::back_inserter(text);
    for (std::size_t i = 0; i < answers.size(); ++i) {
        const HostEstimate& answer = answers[i];
        if (answer.state == ClockState::init)
            fmt::format_to(out, "{},0,{},init\n", queries[i].board.ns, INT64_MAX);
        else
            fmt::format_to(out, "{},{},{},{}\n", queries[i].board.ns, answer.time.ns,
                           answer.sigma.ns, to_string(answer.state));
    }
    return text;
}

}  // namespace

std::unique_ptr<ClockEstimator> make_estimator(EstimatorKind kind) {
    if (kind == EstimatorKind::envelope)
        return std::make_unique<Estimator<EnvelopeFilter>>(EnvelopeFilter());
    const EkfStart start = kind == EstimatorKind::ekf ? EkfStart::published() : EkfStart::fair();
    return std::make_unique<Estimator<Ekf>>(Ekf(start));
}

Expected<ClockRecording> read_clock_recording(const std::string& exchanges,
                                              const std::string& oneway) {
    ClockRecording recording;
    auto done = read_exchanges(exchanges, recording);
    if (done && !oneway.empty()) done = read_oneway(oneway, recording);
    if (!done) return Unexpected(done.error());
    std::stable_sort(recording.messages.begin(), recording.messages.end(),
                     [](const auto& a, const auto& b) { return a.available < b.available; });
    return recording;
}

ClockAnswers replayed_answers(const std::vector<TimedMessage>& messages,
                              const std::vector<ClockQuery>& queries, ClockEstimator& estimator) {
    std::vector<std::size_t> order(queries.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return queries[a].available < queries[b].available;
    });
    ClockAnswers answers(queries.size());
    auto next = messages.begin();
    for (const std::size_t index : order) {
        const ClockQuery& query = queries[index];
        for (; next != messages.end() && next->available <= query.available; ++next)
            estimator.add(next->message);
        if (is_plausible(query.board.ns)) answers[index] = estimator.translate(query.board);
    }
    return answers;
}

ClockAnswers smoothed_answers(const std::vector<TimedMessage>& messages,
                              const std::vector<ClockQuery>& queries) {
    std::vector<Message> stamps;
    stamps.reserve(messages.size());
    for (const TimedMessage& timed : messages) stamps.push_back(timed.message);
    const Smoother smoother(stamps);
    ClockAnswers answers(queries.size());
    for (std::size_t i = 0; i < queries.size(); ++i)
        if (is_plausible(queries[i].board.ns)) answers[i] = smoother.translate(queries[i].board);
    return answers;
}

Expected<ClockReplaySummary> replay_clock(const ClockReplaySettings& settings) {
    if (settings.smoothed && settings.estimator != EstimatorKind::envelope)
        return failure("--smoothed", "the published filter has no smoother",
                       "use --estimator envelope");
    const auto checked =
        check_output(settings.out, {settings.exchanges, settings.oneway, settings.queries});
    if (!checked) return Unexpected(checked.error());
    const auto recording = read_clock_recording(settings.exchanges, settings.oneway);
    if (!recording) return Unexpected(recording.error());
    const auto queries = read_queries(settings.queries);
    if (!queries) return Unexpected(queries.error());
    const auto estimator = make_estimator(settings.estimator);
    const ClockAnswers answers = settings.smoothed
                                     ? smoothed_answers(recording->messages, *queries)
                                     : replayed_answers(recording->messages, *queries, *estimator);
    const auto written = write_whole_file(settings.out, to_csv(*queries, answers));
    if (!written) return Unexpected(written.error());
    const auto unanswered = std::count_if(
        answers.begin(), answers.end(), [](const auto& a) { return a.state == ClockState::init; });
    return ClockReplaySummary{recording->messages.size(), recording->ignored, answers.size(),
                              static_cast<std::size_t>(unanswered)};
}

Expected<void> check_output(const std::string& out, const std::vector<std::string>& inputs) {
    std::error_code ignored;
    for (const std::string& input : inputs)
        if (std::filesystem::is_regular_file(input, ignored) &&
            std::filesystem::equivalent(input, out, ignored))
            return failure(out, "is an input as well and would be overwritten",
                           "name another file");
    return {};
}

}  // namespace versavis::client
