// SPDX-License-Identifier: BSD-3-Clause
#include "doctor_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "doctor/clock_checks.hpp"
#include "doctor/fixes.hpp"
#include "doctor/host_checks.hpp"
#include "doctor/network_checks.hpp"
#include "doctor/service_checks.hpp"
#include "doctor/usb_checks.hpp"

namespace versavis::client {

namespace {

void wait(double seconds) {
    const auto whole = static_cast<std::int64_t>(seconds);
    const auto rest = static_cast<std::int64_t>((seconds - static_cast<double>(whole)) * 1e9);
    const timespec length{whole, rest};
    nanosleep(&length, nullptr);
}

Findings examine_all(const Subject& subject, double seconds) {
    const clock::KernelState kernel = clock::kernel_clocks()->kernel_state();
    const LossCounters before = read_losses(subject);
    if (!subject.cameras.empty()) wait(seconds);  // losses that go on show within it
    Findings findings;
    for (const Findings& more : {check_service(subject), check_host(subject), check_usb(subject),
                                 check_network(subject, before, read_losses(subject)),
                                 check_clock(subject, kernel), check_ptp(subject, kernel)})
        findings.insert(findings.end(), more.begin(), more.end());
    return findings;
}

bool is_bad(const Finding& finding) { return finding.verdict == Verdict::bad && !finding.fixed; }

}  // namespace

DoctorCommand::DoctorCommand(CLI::App& app)
    : command_(app.add_subcommand(
          "doctor",
          "Check host, network, USB, clocks and service: each measured value, whether it is right, "
          "and the command that cures it; at last, whether the synchronisation is right, and the "
          "proof. Exits 0 if nothing is bad and the synchronisation is right, else 1 "
          "(docs/user/doctor.md)")) {
    command_->add_option("--config", configuration_,
                         "Configuration file of the service (default: the one that it has read)");
    command_->add_option("--seconds", seconds_, "How long losses on links are counted")
        ->check(CLI::Range(0.0, 3600.0))
        ->capture_default_str();
    command_->add_flag(
        "--fix", fix_,
        "Change what is safe while everything runs, until the next boot; needs root");
    command_->add_flag("--json", json_, "Print one JSON object (docs/contracts/doctor-report.md)");
}

int DoctorCommand::run(const std::string& instance, const std::string& release) const {
    const Subject subject = examine(instance, configuration_, release);
    Findings findings = examine_all(subject, seconds_);
    if (fix_) apply_fixes(subject.files, findings);
    const Conclusion conclusion = conclude(subject);
    fmt::print("{}", json_ ? report_json(findings, conclusion) : report_text(findings, conclusion));
    const bool bad = std::any_of(findings.begin(), findings.end(), is_bad);
    return bad || conclusion.state != Conclusion::State::right ? EXIT_FAILURE : EX_OK;
}

}  // namespace versavis::client
