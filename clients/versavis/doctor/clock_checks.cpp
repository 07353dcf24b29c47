// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/clock_checks.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <system_error>

#include "posix/child_process.hpp"

namespace versavis::client {

namespace {

/// TAI minus UTC since 2017; a leap second is announced half a year before.
constexpr int tai_minus_utc_s = 37;

/// Who steers CLOCK_REALTIME by NTP. phc2sys is not among them: it may be driven by that clock.
constexpr std::array time_services{"chronyd", "systemd-timesyncd", "ntpd", "openntpd"};

/// A clock of this class was never disciplined by anything.
constexpr const char* undisciplined_class = "248";

std::vector<std::string> running_time_services(const HostFiles& files) {
    std::vector<std::string> running;
    for (const char* name : time_services)
        if (!files.processes(name).empty()) running.emplace_back(name);
    return running;
}

const PtpAnswer* find(const std::vector<PtpAnswer>& answers, const std::string& set) {
    const auto found = std::find_if(answers.begin(), answers.end(),
                                    [&](const PtpAnswer& answer) { return answer.set == set; });
    return found == answers.end() ? nullptr : &*found;
}

std::string value(const std::vector<PtpAnswer>& answers, const std::string& set,
                  const std::string& key) {
    const PtpAnswer* answer = find(answers, set);
    const auto found = answer == nullptr ? std::map<std::string, std::string>::const_iterator{}
                                         : answer->values.find(key);
    return answer == nullptr || found == answer->values.end() ? "" : found->second;
}

Findings check_ports(const std::vector<PtpAnswer>& answers) {
    Findings findings;
    for (const PtpAnswer& answer : answers) {
        if (answer.set != "PORT_DATA_SET") continue;
        const auto state = answer.values.find("portState");
        if (state == answer.values.end()) continue;
        Finding finding{"ptp_port", answer.port, state->second};
        if (state->second == "FAULTY" || state->second == "DISABLED") {
            finding.verdict = Verdict::bad;
            finding.reason = "the port does not take part in PTP";
            finding.cure = "journalctl -u 'ptp4l@*' says why: link down, no time stamping?";
        } else if (state->second != "SLAVE" && state->second != "MASTER" &&
                   state->second != "PASSIVE" && state->second != "GRAND_MASTER") {
            finding.verdict = Verdict::warning;
            finding.reason = "no master has been chosen yet, or its messages do not arrive";
            finding.cure =
                "wait 10 s; check that the switch passes multicast and the domain number";
        }
        findings.push_back(finding);
    }
    return findings;
}

Findings check_master(const std::vector<PtpAnswer>& answers,
                      const std::map<std::string, std::string>& cameras) {
    const std::string master = value(answers, "PARENT_DATA_SET", "grandmasterIdentity");
    const std::string own = value(answers, "DEFAULT_DATA_SET", "clockIdentity");
    if (master.empty()) return {};
    Finding finding{"ptp_master", master, ""};
    const auto camera = cameras.find(master);
    const std::string clock_class = value(answers, "PARENT_DATA_SET", "gm.ClockClass");
    if (camera != cameras.end()) {
        finding.value = fmt::format("camera {} is the grandmaster", camera->second);
        finding.verdict = Verdict::bad;
        finding.reason = "the time of all others is that of its crystal since power-on, not UTC";
        finding.cure =
            "make the camera slave only (PtpSlaveOnly, GevIEEE1588Mode = SlaveOnly), or: "
            "sudo pmc -u -b 0 'SET PRIORITY1 100'";
    } else if (master == own) {
        finding.value = "this host is the grandmaster";
    } else {
        finding.value = fmt::format("another clock is the grandmaster, class {}", clock_class);
        if (clock_class == undisciplined_class) {
            finding.verdict = Verdict::warning;
            finding.reason = "a foreign master that nothing disciplines: its time may be anything";
            finding.cure =
                "discipline that clock (GNSS, NTP), remove it, or make this host the master: "
                "sudo pmc -u -b 0 'SET PRIORITY1 100'";
        }
    }
    return {finding};
}

Findings check_utc_offset(const std::vector<PtpAnswer>& answers) {
    const auto offset = number_in(value(answers, "TIME_PROPERTIES_DATA_SET", "currentUtcOffset"));
    if (!offset) return {};
    const bool valid = value(answers, "TIME_PROPERTIES_DATA_SET", "currentUtcOffsetValid") == "1";
    Finding finding{"ptp_utc_offset", "",
                    fmt::format("{} s, {}", *offset, valid ? "valid" : "not stated as valid")};
    if (*offset == tai_minus_utc_s) return {finding};
    finding.verdict = valid ? Verdict::bad : Verdict::warning;
    finding.reason = fmt::format(
        "PTP counts TAI, which is {} s ahead of UTC: clocks that use this offset are off by {} s",
        tai_minus_utc_s, tai_minus_utc_s - *offset);
    finding.cure = fmt::format("set utc_offset {} in the master's ptp4l.conf", tai_minus_utc_s);
    return {finding};
}

/// A slave's ptp4l steers the clock of the interface; of the host, only with software stamps.
Findings check_phc2sys(const std::vector<PtpAnswer>& answers, const clock::KernelState& kernel,
                       bool phc2sys) {
    const bool slave = std::any_of(answers.begin(), answers.end(), [](const PtpAnswer& answer) {
        const auto state = answer.values.find("portState");
        return state != answer.values.end() && state->second == "SLAVE";
    });
    if (!slave) return {};
    Finding finding{"phc2sys", "", phc2sys ? "runs" : "does not run"};
    if (phc2sys || kernel.synchronised) return {finding};
    finding.verdict = Verdict::warning;
    finding.reason =
        "the interface's clock follows PTP, the host's does not, unless ptp4l stamps in software";
    finding.cure = "sudo systemctl enable --now phc2sys@INTERFACE";
    return {finding};
}

std::string trimmed(const std::string& text) {
    const std::size_t begin = text.find_first_not_of(" \t");
    return begin == std::string::npos
               ? ""
               : text.substr(begin, text.find_last_not_of(" \t\r") + 1 - begin);
}

/// Clock identities of the cameras that this host has talked to.
std::map<std::string, std::string> camera_identities(const Subject& subject) {
    std::map<std::string, std::string> identities;
    if (!subject.configuration) return identities;
    std::istringstream neighbours(subject.files.text("/proc/net/arp").value_or(""));
    std::map<std::string, std::string> addresses;
    for (std::string line; std::getline(neighbours, line);) {
        std::istringstream words(line);
        std::string ip, type, flags, mac;
        if (words >> ip >> type >> flags >> mac) addresses[ip] = mac;
    }
    for (const auto& [name, device] : subject.configuration->cameras) {
        const auto found = addresses.find(device);
        const std::string identity =
            clock_identity(found == addresses.end() ? device : found->second);
        if (!identity.empty()) identities[identity] = name;
    }
    return identities;
}

}  // namespace

std::string clock_identity(const std::string& mac) {
    std::string digits;
    for (const char c : mac) {
        if (c == ':' || c == '-') continue;
        if (std::isxdigit(static_cast<unsigned char>(c)) == 0) return "";
        digits += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    return digits.size() == 12 && digits != "000000000000"
               ? digits.substr(0, 6) + ".fffe." + digits.substr(6)
               : "";
}

std::vector<PtpAnswer> parse_pmc(const std::string& text) {
    std::vector<PtpAnswer> answers;
    std::istringstream lines(text);
    const std::string response = " RESPONSE MANAGEMENT ";
    for (std::string line; std::getline(lines, line);) {
        const std::size_t at = line.find(response);
        if (at != std::string::npos) {
            std::istringstream words(line);
            PtpAnswer answer;
            words >> answer.port;
            answer.set = trimmed(line.substr(at + response.size()));
            answers.push_back(answer);
        } else if (!answers.empty()) {
            const std::string entry = trimmed(line);
            const std::size_t blank = entry.find(' ');
            if (blank != std::string::npos)
                answers.back().values[entry.substr(0, blank)] = trimmed(entry.substr(blank));
        }
    }
    return answers;
}

Expected<std::vector<PtpAnswer>> ask_ptp4l() {
    auto pmc = ChildProcess::start(
        {"pmc", "-u", "-b", "0", "GET DEFAULT_DATA_SET", "GET PORT_DATA_SET", "GET PARENT_DATA_SET",
         "GET TIME_PROPERTIES_DATA_SET", "GET CURRENT_DATA_SET"},
        ChildProcess::Errors::dropped);
    if (!pmc) return Unexpected(pmc.error());
    std::string text;
    std::array<char, 4096> piece{};
    for (ssize_t size = 0; (size = ::read(pmc->socket(), piece.data(), piece.size())) > 0;)
        text.append(piece.data(), static_cast<std::size_t>(size));
    pmc->wait();
    auto answers = parse_pmc(text);
    if (answers.empty())
        return failure("ptp4l", "it does not answer pmc", "run this as root: sudo versavis doctor");
    return answers;
}

Findings check_clock(const Subject& subject, const clock::KernelState& kernel) {
    const std::string output =
        subject.status
            ? subject.status->value("clock", nlohmann::json::object()).value("output", "realtime")
        : subject.configuration ? subject.configuration->output
                                : "realtime";
    const std::vector<std::string> services = running_time_services(subject.files);
    const bool used = output != "monotonic_raw";
    Finding ntp{"host_clock", "", ""};
    ntp.value = kernel.error != 0     ? fmt::format("cannot be read: {}",
                                                    std::generic_category().message(kernel.error))
                : kernel.synchronised ? fmt::format("synchronised to {:.6f} s",
                                                    static_cast<double>(kernel.max_error.ns) * 1e-9)
                                      : "not synchronised";
    if (!services.empty()) ntp.value += fmt::format(", by {}", fmt::join(services, ", "));
    if (services.size() > 1) {
        ntp.verdict = Verdict::bad;
        ntp.reason = "two programs steer one clock, against each other";
        ntp.cure = fmt::format("sudo systemctl disable --now {}", services.back());
    } else if (kernel.error != 0) {
        ntp.verdict = Verdict::unknown;
        ntp.reason = "a sandbox or container keeps the kernel's state from this program";
        ntp.cure = "run it outside";
    } else if (!kernel.synchronised && used) {
        ntp.verdict = Verdict::warning;
        ntp.reason = fmt::format(
            "stamps are of CLOCK_{}, which nothing disciplines: they agree with one another, not "
            "with other computers",
            output == "tai" ? "TAI" : "REALTIME");
        ntp.cure = services.empty() ? "sudo apt install chrony"
                                    : fmt::format("journalctl -u {}", services.front());
    }
    Finding tai{"tai_offset", "", ""};
    tai.value = kernel.tai_offset_s == 0
                    ? fmt::format("not set{}", output == "tai" ? "" : ", not used")
                    : fmt::format("{} s", kernel.tai_offset_s);
    if (output == "tai" && kernel.tai_offset_s != tai_minus_utc_s) {
        tai.verdict = Verdict::bad;
        tai.reason = fmt::format("stamps of CLOCK_TAI are off by {} s",
                                 tai_minus_utc_s - kernel.tai_offset_s);
        tai.cure = "leapsectz right/UTC in /etc/chrony/chrony.conf, or phc2sys, sets it";
    }
    return {ntp, tai};
}

Findings check_ptp(const std::vector<PtpAnswer>& answers,
                   const std::map<std::string, std::string>& cameras,
                   const clock::KernelState& kernel, bool phc2sys) {
    Findings findings = check_ports(answers);
    for (const Findings& more : {check_master(answers, cameras), check_utc_offset(answers),
                                 check_phc2sys(answers, kernel, phc2sys)})
        findings.insert(findings.end(), more.begin(), more.end());
    return findings;
}

Findings check_ptp(const Subject& subject, const clock::KernelState& kernel) {
    if (subject.files.processes("ptp4l").empty()) return {};
    const auto answers = ask_ptp4l();
    if (!answers)
        return {{"ptp_port", "", "ptp4l runs", Verdict::unknown, answers.error().what,
                 answers.error().cure}};
    return check_ptp(*answers, camera_identities(subject), kernel,
                     !subject.files.processes("phc2sys").empty());
}

}  // namespace versavis::client
