// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/finding.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace versavis::client {

namespace {

using nlohmann::json;

constexpr int schema = 1;

json finding_json(const Finding& finding) {
    return {{"check", finding.check},   {"subject", finding.subject},
            {"value", finding.value},   {"verdict", to_string(finding.verdict)},
            {"reason", finding.reason}, {"cure", finding.cure},
            {"fixable", !!finding.fix}, {"fixed", finding.fixed}};
}

std::string finding_text(const Finding& finding) {
    std::string line = fmt::format("{:<8} {:<16} {:<12} {}", to_string(finding.verdict),
                                   finding.check, finding.subject, finding.value);
    line = line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
    if (!finding.reason.empty()) line += fmt::format("         {}\n", finding.reason);
    if (finding.fixed) line += "         fixed, until the next boot; for good:\n";
    if (!finding.cure.empty()) line += fmt::format("         cure: {}\n", finding.cure);
    return line;
}

}  // namespace

const char* to_string(Verdict verdict) {
    switch (verdict) {
        case Verdict::good: return "ok";
        case Verdict::unknown: return "unknown";
        case Verdict::warning: return "warning";
        case Verdict::bad: break;
    }
    return "bad";
}

const char* to_string(Conclusion::State state) {
    switch (state) {
        case Conclusion::State::right: return "right";
        case Conclusion::State::wrong: return "wrong";
        case Conclusion::State::unknown: break;
    }
    return "unknown";
}

std::string report_text(const Findings& findings, const Conclusion& conclusion) {
    std::string text;
    for (const Finding& finding : findings) text += finding_text(finding);
    return text + "\n" + conclusion.sentence + "\n";
}

std::string report_json(const Findings& findings, const Conclusion& conclusion) {
    json list = json::array();
    for (const Finding& finding : findings) list.push_back(finding_json(finding));
    const json document{
        {"schema", schema},
        {"findings", list},
        {"synchronisation",
         {{"state", to_string(conclusion.state)}, {"sentence", conclusion.sentence}}}};
    // Names from devices may hold anything; what is no UTF-8 is replaced.
    return document.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace versavis::client
