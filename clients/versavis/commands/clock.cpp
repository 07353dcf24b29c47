// SPDX-License-Identifier: BSD-3-Clause
#include "clock.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <map>

#include "base/fail.hpp"
#include "status/status_document.hpp"
#include "status/status_view.hpp"

namespace versavis::client {

namespace {

void add_inputs(CLI::App& command, std::string& exchanges, std::string& oneway) {
    command
        .add_option("--exchanges", exchanges,
                    "CSV file with the columns h1_ns,m2_ns,m3_ns,h4_ns and, if known, available_ns")
        ->required();
    command.add_option("--oneway", oneway,
                       "CSV file with the columns m_ns,h_ns: messages board -> host");
}

void add_estimator(CLI::App& command, EstimatorKind& estimator, bool& fair_start) {
    static const std::map<std::string, EstimatorKind> estimators{
        {"envelope", EstimatorKind::envelope}, {"ekf", EstimatorKind::ekf}};
    static const std::map<std::string, bool> starts{{"published", false}, {"fair", true}};
    command
        .add_option("--estimator", estimator,
                    "envelope (default), or ekf: the original system's filter, as published")
        ->transform(CLI::CheckedTransformer(estimators).description("{envelope,ekf}"))
        ->type_name("NAME")
        ->default_str("envelope");
    command
        .add_option(
            "--ekf-start", fair_start,
            "Start values of the ekf: published (default), or fair: taken from the first exchange")
        ->transform(CLI::CheckedTransformer(starts).description("{published,fair}"))
        ->type_name("NAME")
        ->default_str("published");
}

}  // namespace

ClockCommands::ClockCommands(CLI::App& app, std::function<bool()> stop)
    : clock_(
          app.add_subcommand("clock", "Show, record or replay the estimate of the board's clock")) {
    clock_->require_subcommand(1);
    record_settings_.stop = std::move(stop);
    add_status();
    add_record();
    add_replay();
    add_history();
}

void ClockCommands::add_status() {
    status_ = clock_->add_subcommand(
        "status",
        "Show how well board time is translated to host time. Exits 0 if locked, 1 if not "
        "locked, 69 if the service is not running");
    status_->add_flag("--json", json_,
                      "Print the object `clock` of the status document (docs/contracts/status.md)");
}

void ClockCommands::add_record() {
    record_ = clock_->add_subcommand(
        "record", "Record the timestamps that compare the board's clock with the host's");
    record_->add_option("--seconds", recording_s_, "Seconds to record (default: until stopped)")
        ->check(CLI::PositiveNumber);
    record_->add_option("--exchanges", record_settings_.exchanges, "CSV file for the exchanges")
        ->required();
    record_->add_option("--oneway", record_settings_.one_way,
                        "CSV file for the board's one-way messages");
}

void ClockCommands::add_replay() {
    replay_ = clock_->add_subcommand(
        "replay",
        "Repeat the board-to-host conversion from recorded exchanges (files: docs/user/clock.md)");
    add_inputs(*replay_, replay_settings_.exchanges, replay_settings_.oneway);
    replay_
        ->add_option("--query", replay_settings_.queries,
                     "CSV file with the columns available_ns,board_ns: each answer uses only "
                     "what was known by then")
        ->required();
    replay_
        ->add_option("--out", replay_settings_.out,
                     "CSV file to write: board_ns,host_ns,sigma_ns,state, one row per query, in "
                     "the same order")
        ->required();
    add_estimator(*replay_, estimator_, fair_start_);
    replay_->add_flag(
        "--smoothed", replay_settings_.smoothed,
        "Use all messages for each answer, including later ones (estimator envelope only)");
}

void ClockCommands::add_history() {
    CLI::App* history = clock_->add_subcommand(
        "history",
        "Write offset, skew, residual and innovation over recorded exchanges; "
        "'python3 -m versavis.plot' draws the file");
    add_inputs(*history, history_settings_.exchanges, history_settings_.oneway);
    history->add_option("--out", history_settings_.out, "CSV file to write: one row per exchange")
        ->required();
    add_estimator(*history, estimator_, fair_start_);
}

bool ClockCommands::chosen() const { return clock_->parsed(); }
bool ClockCommands::records() const { return record_->parsed(); }

int ClockCommands::run(const std::string& instance) {
    if (status_->parsed()) return show_status(instance);
    if (record_->parsed()) return record(instance);
    if (fair_start_ && estimator_ == EstimatorKind::ekf) estimator_ = EstimatorKind::ekf_fair;
    return replay_->parsed() ? replay() : history();
}

int ClockCommands::show_status(const std::string& instance) const {
    const auto status = read_status(instance);
    if (!status) return fail(status.error());
    const auto clock = status->value("clock", nlohmann::json::object());
    fmt::print("{}", json_ ? clock.dump() + "\n" : clock_text(*status));
    std::fflush(stdout);
    return clock.value("state", "") == "locked" ? EX_OK : EXIT_FAILURE;
}

int ClockCommands::record(const std::string& instance) {
    record_settings_.instance = instance;
    record_settings_.duration = {static_cast<std::int64_t>(recording_s_ * 1e9)};
    return record_clock(record_settings_);
}

int ClockCommands::replay() {
    replay_settings_.estimator = estimator_;
    if (replay_settings_.smoothed && estimator_ != EstimatorKind::envelope) {
        fmt::print(stderr,
                   "versavis: --smoothed cannot be combined with --estimator ekf: that filter has "
                   "no smoother\n");
        return EX_USAGE;
    }
    const auto done = replay_clock(replay_settings_);
    if (!done) return fail(done.error());
    fmt::print("{}: {} answers from {} messages; {} queries precede the first message\n",
               replay_settings_.out, done->answers, done->messages, done->unanswered);
    if (done->ignored != 0)
        fmt::print(stderr, "versavis: {} rows with stamps beyond 73 years were ignored\n",
                   done->ignored);
    return EX_OK;
}

int ClockCommands::history() {
    history_settings_.estimator = estimator_;
    const auto rows = write_clock_history(history_settings_);
    if (!rows) return fail(rows.error());
    fmt::print("{}: {} exchanges\n", history_settings_.out, *rows);
    return EX_OK;
}

}  // namespace versavis::client
