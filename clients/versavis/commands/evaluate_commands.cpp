// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate_commands.hpp"

#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "base/fail.hpp"

namespace versavis::client {

namespace {

constexpr double published_rate_hz = 1000;

/// "NAME=1,2.5" with so many numbers.
Expected<std::pair<std::string, std::vector<double>>> named_numbers(const std::string& option,
                                                                    const std::string& text,
                                                                    std::size_t count) {
    const std::size_t equals = text.find('=');
    std::vector<double> numbers;
    const char* at = text.data() + (equals == std::string::npos ? text.size() : equals + 1);
    const char* const end = text.data() + text.size();
    while (at < end) {
        double number = 0;
        const auto [next, failed] = std::from_chars(at, end, number);
        const bool plausible = std::abs(number) < 1e9;  // a number at all, too
        if (failed != std::errc{} || !plausible || (next < end && *next != ',')) break;
        numbers.push_back(number);
        at = next + 1;
    }
    if (equals == 0 || at <= end || numbers.size() != count)
        return failure(option,
                       fmt::format("'{}' is not CAMERA= and {} number{}", text, count,
                                   count == 1 ? "" : "s with commas between them"),
                       "see versavis evaluate leds --help");
    return std::pair(text.substr(0, equals), std::move(numbers));
}

Expected<LedEvaluationSettings> led_settings(const std::vector<std::string>& boards,
                                             const std::vector<std::string>& exposures) {
    LedEvaluationSettings settings;
    for (const std::string& text : boards) {
        const auto board = named_numbers("--board", text, 4);
        if (!board) return Unexpected(board.error());
        const auto& [camera, n] = *board;
        const LedPlace place{n[0], n[1], n[2], n[3]};
        if (place.pitch() < 3)
            return failure("--board",
                           fmt::format("'{}' is less than 3 pixels from LED to LED", text),
                           "give the centres of the two outermost LEDs");
        settings.places[camera] = place;
    }
    for (const std::string& text : exposures) {
        const auto exposure = named_numbers("--exposure", text, 1);
        if (!exposure) return Unexpected(exposure.error());
        settings.exposures[exposure->first] = {
            static_cast<std::int64_t>(exposure->second[0] * 1e3)};
    }
    return settings;
}

}  // namespace

EvaluateCommands::EvaluateCommands(CLI::App& app, std::function<bool()> stop)
    : evaluate_(app.add_subcommand(
          "evaluate", "Measure the synchronisation from a recording (docs/user/evaluate.md)")),
      stop_(std::move(stop)),
      sensors_(*evaluate_, stop_) {
    evaluate_->require_subcommand(1);
    add_leds();
}

void EvaluateCommands::add_leds() {
    leds_ = evaluate_->add_subcommand(
        "leds",
        "Read the LED timing board in the frames: compare camera pairs, check increments against "
        "stamps, measure offsets within a step. Exits 0 if all match, 1 if not");
    leds_->add_option("recording", recording_, "Recording (versavis record)")->required();
    leds_->add_option("--camera", cameras_, "Evaluate only this camera; may be repeated");
    leds_
        ->add_option("--rate", led_rate_hz_,
                     "Steps of the board per second (default: [ports] test_rate_hz of the "
                     "recording's configuration, or 1000)")
        ->check(CLI::Range(0.1, 1e6));
    leds_
        ->add_option("--direction", backward_,
                     "Direction of the running LEDs: forward (default) or backward")
        ->transform(CLI::CheckedTransformer(
                        std::map<std::string, bool>{{"forward", false}, {"backward", true}})
                        .description("{forward,backward}"))
        ->type_name("NAME");
    leds_
        ->add_option("--bits", high_first_,
                     "Bit order of the binary LEDs, counted from the running ones: low-first "
                     "(default) or high-first")
        ->transform(CLI::CheckedTransformer(
                        std::map<std::string, bool>{{"low-first", false}, {"high-first", true}})
                        .description("{low-first,high-first}"))
        ->type_name("NAME");
    leds_
        ->add_option("--board", boards_,
                     "CAMERA=X1,Y1,X2,Y2: centres of the two outermost LEDs in pixels (default: "
                     "detected); may be repeated")
        ->type_name("PLACE");
    leds_
        ->add_option("--exposure", exposures_,
                     "CAMERA=US: true exposure time in us (default: as measured); may be repeated")
        ->type_name("TIME");
    leds_->add_flag("--json", json_, "Print the report as one JSON object");
}

bool EvaluateCommands::chosen() const { return evaluate_->parsed(); }

int EvaluateCommands::run() { return sensors_.chosen() ? sensors_.run() : run_leds(); }

bool EvaluateCommands::progress(std::size_t frames) const {
    if (isatty(STDERR_FILENO) != 0 && frames % 20 == 0) {
        fmt::print(stderr, "\r{} pictures", frames);
        std::fflush(stderr);
    }
    return !stop_();
}

int EvaluateCommands::run_leds() {
    auto settings = led_settings(boards_, exposures_);
    if (!settings) return fail(settings.error(), EX_USAGE);
    const auto recording = Recording::open(recording_);
    if (!recording) return fail(recording.error(), EX_NOINPUT);
    const double recorded = recorded_led_rate_hz(*recording);
    settings->report.rate_hz = led_rate_hz_ > 0 ? led_rate_hz_
                               : recorded > 0   ? recorded
                                                : published_rate_hz;
    settings->report.layout.backward = backward_;
    settings->report.layout.high_bit_first = high_first_;
    auto report = evaluate_leds(*recording, cameras_, *settings,
                                [this](std::size_t frames) { return progress(frames); });
    if (isatty(STDERR_FILENO) != 0) fmt::print(stderr, "\r\x1b[K");
    if (!report) {
        Error error = report.error();
        error.where = error.where.empty() ? recording_ : recording_ + ", " + error.where;
        return fail(error, EX_DATAERR);
    }
    if (stop_()) report->notes.emplace_back("stopped before the end of the recording");
    fmt::print("{}", json_ ? to_json(*report).dump() + "\n" : to_text(*report));
    return report->ok() ? EX_OK : EXIT_FAILURE;
}

}  // namespace versavis::client
