// SPDX-License-Identifier: BSD-3-Clause
// What disciplines the host's clock: NTP, the TAI offset, and the roles of PTP.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doctor/finding.hpp"
#include "doctor/subject.hpp"
#include "engine/clock/system_clocks.hpp"

namespace versavis::client {

/// An answer of ptp4l.
struct PtpAnswer {
    std::string port;  ///< who answers
    std::string set;   ///< as PORT_DATA_SET
    std::map<std::string, std::string> values;
};

/// What pmc prints.
std::vector<PtpAnswer> parse_pmc(const std::string& text);

/// Asks the ptp4l of this host. Error: no pmc, or no answer.
Expected<std::vector<PtpAnswer>> ask_ptp4l();

Findings check_clock(const Subject& subject, const clock::KernelState& kernel);

/// `answers`: what ptp4l says; `cameras`: names by clock identity (see clock_identity).
Findings check_ptp(const std::vector<PtpAnswer>& answers,
                   const std::map<std::string, std::string>& cameras,
                   const clock::KernelState& kernel, bool phc2sys);

/// All of PTP on this host; nothing if no ptp4l runs.
Findings check_ptp(const Subject& subject, const clock::KernelState& kernel);

/// The identity that a PTP clock has by its MAC address, as pmc prints it; empty: no address.
std::string clock_identity(const std::string& mac);

}  // namespace versavis::client
