// SPDX-License-Identifier: BSD-3-Clause
// A verification as text and as JSON.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "verify/verification.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// Findings of one stream that the text shows; the rest is in the JSON.
constexpr std::size_t most_lines = 8;

std::string span_text(const FindingSpan& span) {
    return span.from_s == span.to_s ? fmt::format("second {}", span.from_s)
                                    : fmt::format("seconds {} to {}", span.from_s, span.to_s);
}

std::string amount_text(Duration amount) {
    const double us = static_cast<double>(amount.ns) * 1e-3;
    if (std::abs(us) < 1000) return fmt::format("{:+.1f} us", us);
    if (std::abs(us) < 1e6) return fmt::format("{:+.3f} ms", us * 1e-3);
    return fmt::format("{:+.6f} s", us * 1e-6);
}

/// `found`: a FindingSpan or a WorstSecond.
template <class Found>
std::string about_items(const StreamVerdict& stream, const Found& found) {
    return fmt::format(
        "{} {}{}: {}{}", found.items, stream.kind == "camera" ? "frame" : "sample",
        found.items == 1 ? "" : "s", words_of(found.finding),
        found.worst.ns == 0 ? "" : fmt::format(" (by up to {})", amount_text(found.worst)));
}

std::string finding_text(const StreamVerdict& stream, const FindingSpan& span) {
    return fmt::format("{}, {}, {}", stream.name, span_text(span), about_items(stream, span));
}

bool is_larger(const FindingSpan& a, const FindingSpan& b) {
    return a.items != b.items ? a.items > b.items : absolute(a.worst) > absolute(b.worst);
}

/// Of all streams, the finding of a grade about the most items; empty: there is none.
std::string largest_finding(const Verification& verification, Grade grade) {
    const StreamVerdict* of = nullptr;
    const FindingSpan* largest = nullptr;
    for (const StreamVerdict& stream : verification.streams)
        for (const FindingSpan& span : stream.findings) {
            if (grade_of(span.finding) != grade) continue;
            if (largest != nullptr && !is_larger(span, *largest)) continue;
            of = &stream;
            largest = &span;
        }
    return largest == nullptr ? "" : finding_text(*of, *largest);
}

std::uint64_t graded(const Verification& verification, Grade grade) {
    std::uint64_t count = 0;
    for (const StreamVerdict& stream : verification.streams)
        count += stream.graded[static_cast<std::size_t>(grade)];
    return count;
}

json amount_or_null(Duration amount) { return amount.ns == 0 ? json() : json(amount.ns); }

json to_json(const StreamVerdict& stream) {
    json findings = json::array();
    for (const FindingSpan& span : stream.findings) {
        findings.push_back(json{{"finding", name_of(span.finding)},
                                {"verdict", to_string(grade_of(span.finding))},
                                {"text", words_of(span.finding)},
                                {"from_s", span.from_s},
                                {"to_s", span.to_s},
                                {"items", span.items},
                                {"worst_ns", amount_or_null(span.worst)}});
    }
    json worst;
    if (const auto& found = stream.worst_second)
        worst = {{"second", found->second},
                 {"finding", name_of(found->finding)},
                 {"items", found->items},
                 {"worst_ns", amount_or_null(found->worst)}};
    json seconds = json::array();
    for (const auto& [second, verdict] : stream.seconds)
        seconds.push_back(json{{"second", second},
                               {"items", verdict.items},
                               {"withheld", verdict.withheld},
                               {"verdict", to_string(verdict.grade)}});
    return {{"name", stream.name},
            {"kind", stream.kind},
            {"verdict", to_string(stream.grade())},
            {"items", stream.items},
            {"proved", stream.graded[static_cast<std::size_t>(Grade::proved)]},
            {"plausible", stream.graded[static_cast<std::size_t>(Grade::plausible)]},
            {"untrusted", stream.graded[static_cast<std::size_t>(Grade::untrusted)]},
            {"withheld", stream.withheld},
            {"lost", stream.lost},
            {"sigma_ns", stream.sigma.ns},
            {"worst_second", std::move(worst)},
            {"findings", std::move(findings)},
            {"seconds", std::move(seconds)}};
}

}  // namespace

std::string Verification::sentence() const {
    std::uint64_t items = 0;
    std::uint64_t withheld = 0;
    for (const StreamVerdict& stream : streams) {
        items += stream.items;
        withheld += stream.withheld;
    }
    const std::string left_out =
        withheld == 0 ? "" : fmt::format("; {} more were published as suspect", withheld);
    switch (grade()) {
        case Grade::untrusted:
            return "Not to be trusted: " + largest_finding(*this, Grade::untrusted) + ".";
        case Grade::plausible:
            if (streams.empty()) return "There is nothing to verify.";
            return fmt::format("Nothing contradicts the {} stamps, but {} are not proved: {}.",
                               items - withheld, graded(*this, Grade::plausible),
                               largest_finding(*this, Grade::plausible));
        case Grade::proved: break;
    }
    return fmt::format("Synchronised: all {} stamps of {} stream{} over {} s are proved{}.",
                       items - withheld, streams.size(), streams.size() == 1 ? "" : "s", seconds,
                       left_out);
}

json to_json(const Verification& verification) {
    json streams = json::array();
    for (const StreamVerdict& stream : verification.streams) streams.push_back(to_json(stream));
    return {{"file", verification.file},
            {"verdict", to_string(verification.grade())},
            {"sentence", verification.sentence()},
            {"seconds", verification.seconds},
            {"clock",
             {{"board_lives", verification.board_lives},
              {"exchanges", verification.exchanges},
              {"refused_exchanges", verification.refused_exchanges},
              {"bounds_width_ns", verification.bounds_width.ns}}},
            {"streams", std::move(streams)},
            {"notes", verification.notes}};
}

std::string to_text(const Verification& verification) {
    std::string text = fmt::format("{}: {}\n{}\n\n", verification.file,
                                   to_string(verification.grade()), verification.sentence());
    text += fmt::format("{:<12} {:>9} {:>9} {:>9} {:>11} {:>9} {:>7} {:>9}\n", "stream", "items",
                        "proved", "plausible", "not trusted", "withheld", "lost", "sigma/us");
    for (const StreamVerdict& stream : verification.streams)
        text +=
            fmt::format("{:<12} {:>9} {:>9} {:>9} {:>11} {:>9} {:>7} {:>9.1f}\n", stream.name,
                        stream.items, stream.graded[static_cast<std::size_t>(Grade::proved)],
                        stream.graded[static_cast<std::size_t>(Grade::plausible)],
                        stream.graded[static_cast<std::size_t>(Grade::untrusted)], stream.withheld,
                        stream.lost, static_cast<double>(stream.sigma.ns) * 1e-3);
    text += fmt::format(
        "clock: {} exchange{} with the board in {} boot{}; they bound host times "
        "to {:.0f} us\n",
        verification.exchanges, verification.exchanges == 1 ? "" : "s", verification.board_lives,
        verification.board_lives == 1 ? "" : "s",
        static_cast<double>(verification.bounds_width.ns) * 1e-3);
    for (const StreamVerdict& stream : verification.streams)
        if (const auto& found = stream.worst_second)
            text += fmt::format("{}, worst second: {}, {}\n", stream.name, found->second,
                                about_items(stream, *found));
    for (const StreamVerdict& stream : verification.streams)
        for (std::size_t i = 0; i < stream.findings.size(); ++i) {
            if (i == most_lines) {
                text += fmt::format("{}: {} more findings, see --json\n", stream.name,
                                    stream.findings.size() - i);
                break;
            }
            text += finding_text(stream, stream.findings[i]) + "\n";
        }
    for (const std::string& note : verification.notes) text += note + "\n";
    return text;
}

}  // namespace versavis::client
