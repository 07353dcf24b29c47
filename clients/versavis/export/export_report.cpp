// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>

#include "export/export.hpp"

namespace versavis::client {

namespace {

using Counts = std::map<std::string, std::map<std::string, std::uint64_t>>;

Counts count_left_out(const Selection& selection) {
    Counts counts;
    for (const auto& item : selection.left_out)
        ++counts[selection.stream(item.stream)][to_string(item.reason)];
    return counts;
}

std::string left_out_text(const Counts& counts, const std::string& stream) {
    const auto found = counts.find(stream);
    if (found == counts.end()) return "";
    std::string text;
    for (const auto& [reason, count] : found->second)
        text += fmt::format("{}{} {}", text.empty() ? "; left out: " : ", ", count, reason);
    return text;
}

std::string sigma_text(std::uint32_t sigma_ns) {
    return sigma_ns == sigma_unknown ? "sigma not known"
                                     : fmt::format("sigma up to {:.0f} us", sigma_ns * 1e-3);
}

double seconds_of(const SelectedSequence& sequence) {
    return static_cast<double>((sequence.last - sequence.first).ns) * 1e-9;
}

/// Nothing of one that is all.
std::string sequences_text(const Selection& selection) {
    const auto& all = selection.sequences;
    if (all.size() < 2) return "";
    std::string text = fmt::format("  {} sequences, each continuous:\n", all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
        const std::string& cause = all[i].bounds.cause;
        text += fmt::format("    {}: {:.1f} s from {} ns, {} sets, {} samples{}\n",
                            sequence_folder(selection, i), seconds_of(all[i]), all[i].first.ns,
                            all[i].sets, all[i].samples.size(),
                            cause.empty() ? "" : "; before it, " + cause);
    }
    return text;
}

nlohmann::json sequences_json(const Selection& selection) {
    nlohmann::json list = nlohmann::json::array();
    for (std::size_t i = 0; i < selection.sequences.size(); ++i) {
        const SelectedSequence& one = selection.sequences[i];
        list.push_back({{"directory", sequence_folder(selection, i)},
                        {"first_ns", one.first.ns},
                        {"last_ns", one.last.ns},
                        {"joined", one.bounds.joined},
                        {"epoch", nullptr},
                        {"sets", one.sets},
                        {"samples", one.samples.size()},
                        {"cut", one.bounds.cause}});
        if (!one.bounds.joined) list.back()["epoch"] = one.bounds.continuity.epoch;
    }
    return list;
}

nlohmann::json as_json(const ExportReport& report) {
    const Counts counts = count_left_out(report.selection);
    nlohmann::json streams = nlohmann::json::array();
    const auto add = [&](const std::string& name, std::uint64_t items, double rate,
                         std::uint32_t sigma_ns) {
        const auto found = counts.find(name);
        streams.push_back({{"name", name},
                           {"exported", items},
                           {"rate_hz", rate},
                           {"largest_sigma_ns", nullptr},
                           {"left_out", found == counts.end() ? nlohmann::json::object()
                                                              : nlohmann::json(found->second)}});
        if (sigma_ns != sigma_unknown) streams.back()["largest_sigma_ns"] = sigma_ns;
    };
    for (const auto& one : report.selection.cameras)
        add(one.name, one.frames, one.rate_hz, one.largest_sigma_ns);
    for (const auto& one : report.selection.imus)
        add(one.name, one.samples, one.rate_hz, one.largest_sigma_ns);
    return {{"directory", report.directory},
            {"sets", report.selection.sets},
            {"sequences", sequences_json(report.selection)},
            {"streams", streams},
            {"files", report.written},
            {"verdict", report.verdict},
            {"notes", report.notes}};
}

}  // namespace

std::string sequence_folder(const Selection& selection, std::size_t index) {
    return selection.sequences.size() < 2 ? "" : fmt::format("sequence-{}", index + 1);
}

std::string to_text(const ExportReport& report, bool json) {
    if (json)
        return as_json(report).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) +
               "\n";
    const Counts counts = count_left_out(report.selection);
    std::string text = report.directory + ":\n";
    if (report.selection.cameras.size() > 1)
        text += fmt::format("  {} sets of {} cameras\n", report.selection.sets,
                            report.selection.cameras.size());
    for (const auto& one : report.selection.cameras)
        text += fmt::format("  {}: {} frames, {:.2f} Hz, {}{}\n", one.name, one.frames, one.rate_hz,
                            sigma_text(one.largest_sigma_ns), left_out_text(counts, one.name));
    for (const auto& one : report.selection.imus)
        text += fmt::format("  {}: {} samples, {:.2f} Hz, longest gap {:.1f} ms, {}{}\n", one.name,
                            one.samples, one.rate_hz, static_cast<double>(one.longest_gap.ns) / 1e6,
                            sigma_text(one.largest_sigma_ns), left_out_text(counts, one.name));
    text += sequences_text(report.selection);
    for (const auto& file : report.written) text += "  " + file + "\n";
    if (!report.selection.left_out.empty()) text += "  left_out.csv lists what was left out\n";
    if (!report.verdict.empty()) text += fmt::format("  {} (verification.html)\n", report.verdict);
    for (const auto& note : report.notes) text += "  note: " + note + "\n";
    return text;
}

std::string readme(const ExportReport& report) {
    return "Exported by 'versavis export'.\n\n" + to_text(report, false) +
           "\nStamps are nanoseconds of the output clock: of a frame the middle of its exposure, "
           "of a "
           "sample\nthe motion. Within a sequence they can be compared, and the IMU has no hole.\n";
}

}  // namespace versavis::client
