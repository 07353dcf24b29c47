// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/service_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <system_error>

#include "posix/child_process.hpp"
#include "status/status_document.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// What talks to cameras, by the name of its process as the kernel cuts it.
constexpr std::array camera_programs{"arv-viewer-0.8", "arv-tool-0.8", "arv-camera-test",
                                     "SpinView_QT",    "pylonviewer",  "MVS",
                                     "VimbaXViewer",   "VimbaViewer",  "ArenaView"};

/// Or by a library that it has loaded.
constexpr std::array camera_libraries{"/libaravis-",          "/libSpinnaker.", "/libpylonbase",
                                      "/libMvCameraControl.", "/libVmbC.",      "/libVimbaC.",
                                      "/libarena_api",        "/libgxiapi."};

Findings check_life(const Subject& subject) {
    const std::string service = fmt::format("instance {}", subject.instance);
    if (subject.status)
        return {{"service", service,
                 fmt::format("process {}, release {}", subject.pid(),
                             subject.status->value("release", "?"))}};
    if (subject.unit && subject.unit->what.rfind("waiting: ", 0) == 0)
        return {{"service", service, "serves nothing yet", Verdict::bad,
                 subject.unit->where + ": " + subject.unit->what, subject.unit->cure}};
    return {{"service", service, "not running", Verdict::bad, subject.silence.what,
             "sudo systemctl start versavisd; journalctl -u versavisd says why it ended"}};
}

/// By the service's program, which is beside this one.
Findings check_configuration(const Subject& subject) {
    if (!subject.configuration)
        return {{"configuration", "", "not read", Verdict::bad,
                 subject.configuration_error.where + ": " + subject.configuration_error.what,
                 subject.configuration_error.cure}};
    const std::string path = subject.configuration->path;
    const std::string program = installed_program("versavisd");
    std::error_code error;
    if (!std::filesystem::exists(program, error)) return {};
    auto check = ChildProcess::start({program, "--check-config", "--config", path},
                                     ChildProcess::Errors::dropped);
    if (!check) return {};
    if (check->wait() == 0) return {{"configuration", path, "valid"}};
    return {{"configuration", path, "not valid", Verdict::bad, "the service does not start with it",
             fmt::format("versavisd --check-config --config {}", path)}};
}

Findings check_releases(const Subject& subject) {
    if (!subject.status) return {};
    Findings findings;
    const std::string release = subject.status->value("release", "");
    if (release != subject.release)
        findings.push_back({"release", "service",
                            fmt::format("{}, this program {}", release, subject.release),
                            Verdict::warning, "the service was not restarted after an upgrade",
                            "sudo systemctl restart versavisd"});
    const json board = subject.status->value("board", json::object());
    const json outdated = board.value("firmware_outdated", json());
    if (!outdated.is_boolean()) return findings;
    Finding firmware{"firmware", "board", board.value("firmware", "")};
    if (outdated.get<bool>()) {
        firmware.verdict = Verdict::warning;
        firmware.reason = fmt::format("it is older than the service, {}", release);
        firmware.cure =
            "sudo systemctl stop versavisd && versavis flash && sudo systemctl start versavisd";
    }
    findings.push_back(firmware);
    return findings;
}

/// In the words of the service.
void add_device(Findings& findings, const json& device, const std::string& name,
                const std::string& value) {
    const std::string health = device.value("health", "");
    if (device.value("state", "") == "unused") return;
    Finding finding{"device", name, value};
    if (health == "degraded") finding.verdict = Verdict::bad;
    if (health == "starting") finding.verdict = Verdict::unknown;
    if (health == "ok" && !device.value("hint", "").empty()) finding.verdict = Verdict::warning;
    finding.reason = device.value("hint", "");
    const std::string fault = device.value("fault", "");
    if (!fault.empty()) finding.value += ", " + fault;
    findings.push_back(finding);
}

/// Not every device has a rate.
std::string state_and_rate(const json& device) {
    std::string state = device.value("state", "");
    if (!device.contains("delivered_hz")) return state;
    return fmt::format("{}, {:.1f} of {:g} Hz", state, device.value("delivered_hz", 0.0),
                       device.value("configured_hz", 0.0));
}

Findings check_devices(const Subject& subject) {
    if (!subject.status) return {};
    const json& status = *subject.status;
    Findings findings;
    for (const char* part : {"board", "clock"})
        if (status.contains(part))
            add_device(findings, status[part], part, status[part].value("state", ""));
    for (const char* kind : device_arrays)
        for (const json& device : status.value(kind, json::array()))
            add_device(findings, device, device.value("name", ""), state_and_rate(device));
    return findings;
}

/// Both would open the same board.
bool same_board(const ConfiguredParts& one, const ConfiguredParts& other) {
    if (one.board_link != other.board_link) return false;
    return one.board_link != "usb" || one.board_serial == other.board_serial ||
           one.board_serial.empty() || other.board_serial.empty();
}

Findings check_sharing(const Subject& subject) {
    if (!subject.status || !subject.configuration || !subject.uses_board()) return {};
    Findings findings;
    for (const std::string& instance : subject.files.list("/dev/shm/versavis")) {
        if (instance == subject.instance) continue;
        const auto status = read_status(instance);
        if (!status || status->value("board", json::object()).value("state", "") == "unused")
            continue;
        const auto other = read_configured_parts(status->value("configuration", ""));
        if (!other || !same_board(*subject.configuration, *other)) continue;
        findings.push_back(
            {"board_shared", fmt::format("instance {}", instance),
             fmt::format("process {}, {}", status->value("pid", 0), other->path), Verdict::bad,
             "two services want one board: only one of them gets it",
             fmt::format("set a different 'serial' of [board] in each file, or stop one: sudo kill "
                         "{}",
                         status->value("pid", 0))});
    }
    return findings;
}

/// What of cameras a process is known to use; empty: nothing.
std::string camera_use(const HostFiles& files, const std::string& pid, const std::string& name) {
    for (const char* program : camera_programs)
        if (name == program) return name;
    const std::string maps = files.text("/proc/" + pid + "/maps").value_or("");
    for (const char* library : camera_libraries)
        if (maps.find(library) != std::string::npos) return name + " with " + (library + 1) + "*";
    return "";
}

Findings check_strangers(const HostFiles& files) {
    Findings findings;
    for (const std::string& pid : files.list("/proc")) {
        if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
        const std::string name = files.text("/proc/" + pid + "/comm").value_or("");
        if (name.empty() || name.rfind("versavis", 0) == 0) continue;
        const std::string use = camera_use(files, pid, name);
        if (use.empty()) continue;
        findings.push_back({"other_program", "process " + pid, use, Verdict::warning,
                            "it can take over a camera, or change its settings",
                            "end it: kill " + pid});
    }
    return findings;
}

// What the conclusion rests on.

struct Proof {
    std::uint64_t proved = 0;
    std::uint64_t published = 0;
    std::uint64_t withheld = 0;
    std::size_t cameras = 0;   ///< triggered
    std::size_t measured = 0;  ///< of them, whose exposures are measured by their line
    std::size_t agreeing = 0;  ///< of those, whose own account of the exposure agrees
    std::size_t by_ptp = 0;    ///< of all, who stamp by PTP's time
    std::string missing;       ///< the first camera without proof, and why
};

std::string counted(std::size_t cameras) {
    return fmt::format("{} camera{}", cameras, cameras == 1 ? "" : "s");
}

Proof proof_of(const json& status) {
    Proof proof;
    for (const json& camera : status.value("cameras", json::array())) {
        const std::string name = camera.value("name", "");
        if (camera.value("state", "") == "stopped") {
            if (proof.missing.empty()) proof.missing = name + " is stopped by request";
            continue;
        }
        const std::string trigger = camera.value("trigger", "");
        if (trigger != "board" && trigger != "ptp") {
            if (proof.missing.empty()) proof.missing = name + " runs freely, without triggers";
            continue;
        }
        if (trigger == "ptp") ++proof.by_ptp;
        const auto published = camera.value("frames_published", std::uint64_t{0});
        const auto suspect = camera.value("frames_suspect", std::uint64_t{0});
        ++proof.cameras;
        proof.published += published;
        proof.proved += published - std::min(published, suspect);
        const auto unproved = camera.value("frames_without_trigger", std::uint64_t{0});
        proof.withheld += unproved - std::min(unproved, suspect);  // others are flagged instead
        if (camera.value("pairing", "") != "locked" && proof.missing.empty())
            proof.missing =
                fmt::format("the pairing of {} is '{}'", name, camera.value("pairing", ""));
        else if (published == suspect && proof.missing.empty())
            proof.missing = "no frame of " + name + " was proved yet";
        if (camera.value("exposure_ns", 0.0) <= 0) continue;
        ++proof.measured;
        if (camera.value("camera_exposure_ns", 0.0) > 0 ||
            camera.value("edge_difference_ns", json()).is_number())
            ++proof.agreeing;
    }
    return proof;
}

/// What confirms the stamps beside the pairing.
std::string witnesses(const json& status, const Proof& proof) {
    std::string text;
    if (proof.measured > 0)
        text += fmt::format("; the exposures of {} of {} are measured by their line",
                            proof.measured, counted(proof.cameras));
    if (proof.agreeing > 0) text += fmt::format(", {} report the same", proof.agreeing);
    if (proof.by_ptp > 0)
        text += fmt::format("; PTP's time makes the stamps of {}", counted(proof.by_ptp));
    if (status.value("board", json::object()).value("stamp_test", "") == "passed")
        text += "; the board's test of its stamps passes";
    if (status.value("clock", json::object()).value("pps", "") == "used")
        text += "; PPS makes the stamps";
    return text;
}

Conclusion because(Conclusion::State state, std::string why) {
    if (!why.ends_with('?')) why += '.';
    switch (state) {
        case Conclusion::State::right: return {state, "The synchronisation is right: " + why};
        case Conclusion::State::wrong: return {state, "The synchronisation is not right: " + why};
        case Conclusion::State::unknown: break;
    }
    return {state, "Whether the synchronisation is right is not known: " + why};
}

/// The first device, in the order of cause, that has this health; empty: none.
std::string first_cause(const json& status, const std::string& health) {
    const auto text = [](const json& device, const std::string& name) {
        return fmt::format("{}: {}: {}", name, device.value("fault", ""), device.value("hint", ""));
    };
    for (const char* part : {"board", "clock"})
        if (status.contains(part) && status[part].value("health", "") == health)
            return text(status[part], part);
    for (const char* kind : device_arrays)
        for (const json& device : status.value(kind, json::array()))
            if (device.value("health", "") == health) return text(device, device.value("name", ""));
    return "";
}

}  // namespace

Findings check_service(const Subject& subject) {
    Findings findings;
    for (const Findings& more :
         {check_life(subject), check_configuration(subject), check_releases(subject),
          check_devices(subject), check_sharing(subject), check_strangers(subject.files)})
        findings.insert(findings.end(), more.begin(), more.end());
    return findings;
}

Conclusion conclude(const Subject& subject) {
    if (subject.status) return conclude(*subject.status);
    return because(
        Conclusion::State::unknown,
        "there is no living service: " + subject.silence.what +
            (subject.unit ? "; " + subject.unit->where + ": " + subject.unit->what : ""));
}

Conclusion conclude(const json& status) {
    using State = Conclusion::State;
    const std::string degraded = first_cause(status, "degraded");
    if (!degraded.empty()) return because(State::wrong, degraded);
    const std::string starting = first_cause(status, "starting");
    if (!starting.empty()) return because(State::unknown, starting);
    // A board that is not used has no clock; the cameras' own then make the stamps.
    const bool has_board = status.value("board", json::object()).value("state", "") != "unused";
    const json ptp = status.value("ptp", json());
    const json clock = has_board || !ptp.is_object() ? status.value("clock", json::object()) : ptp;
    const json sigma = clock.value("sigma_ns", json());
    for (const json& used : {clock, ptp.is_object() ? ptp : clock})
        if (used.value("state", "") != "locked" || !sigma.is_number())
            return because(State::unknown,
                           fmt::format("the clock is '{}'", used.value("state", "unknown")));
    const Proof proof = proof_of(status);
    if (!proof.missing.empty()) return because(State::unknown, proof.missing);
    if (proof.cameras == 0)
        return because(State::unknown, "no camera is configured, so there are no frames to prove");
    const std::string all = proof.proved == proof.published
                                ? "all of them proved"
                                : fmt::format("{} of them proved", proof.proved);
    return because(
        State::right,
        fmt::format("{} frames of {} were published, {}, {} were withheld; sigma is {:.1f} us, the "
                    "bound {:.1f} us{}",
                    proof.published, counted(proof.cameras), all, proof.withheld,
                    sigma.get<double>() * 1e-3, clock.value("bound_ns", 0.0) * 1e-3,
                    witnesses(status, proof)));
}

}  // namespace versavis::client
