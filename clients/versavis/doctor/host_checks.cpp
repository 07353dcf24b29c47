// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/host_checks.hpp"

#include <fmt/format.h>
#include <pwd.h>
#include <sched.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <map>
#include <sstream>

#include "versavis/ring_path.hpp"

namespace versavis::client {

namespace {

/// The service makes no ring that would leave less memory.
constexpr std::uint64_t least_memory_mib = 64;
/// Of the disk: measurements and descriptions are small.
constexpr std::uint64_t least_disk_mib = 16;

/// The thread that stamps what the board sends asks for it.
constexpr int realtime_priority = 20;

/// Fields of /proc/PID/stat as proc(5) numbers them.
constexpr int field_priority = 40;
constexpr int field_policy = 41;

/// The highest real-time priority of the threads of a process; 0: none has one.
int highest_priority(const HostFiles& files, int pid) {
    int highest = 0;
    const std::string tasks = fmt::format("/proc/{}/task", pid);
    for (const std::string& task : files.list(tasks)) {
        const auto text = files.text(fmt::format("{}/{}/stat", tasks, task));
        const std::size_t name_end = text ? text->rfind(')') : std::string::npos;
        if (name_end == std::string::npos) continue;
        std::istringstream fields(text->substr(name_end + 1));
        std::string field;
        int priority = 0;
        for (int number = 3; fields >> field && number <= field_policy; ++number) {
            const std::int64_t value = number_in(field).value_or(0);
            if (number == field_priority) priority = static_cast<int>(value);
            if (number == field_policy && (value == SCHED_FIFO || value == SCHED_RR))
                highest = std::max(highest, priority);
        }
    }
    return highest;
}

/// The soft limit of /proc/PID/limits; none: not readable.
std::optional<std::string> limit_of(const HostFiles& files, int pid, const std::string& title) {
    const auto text = files.text(fmt::format("/proc/{}/limits", pid));
    const std::size_t at = text ? text->find(title) : std::string::npos;
    if (at == std::string::npos) return std::nullopt;
    std::istringstream rest(text->substr(at + title.size()));
    std::string soft;
    rest >> soft;
    return soft;
}

Findings check_realtime(const Subject& subject) {
    if (subject.pid() == 0 || !subject.uses_board()) return {};
    const int priority = highest_priority(subject.files, subject.pid());
    if (priority > 0)
        return {{"realtime", "", fmt::format("a thread runs at priority {}", priority)}};
    const auto limit = limit_of(subject.files, subject.pid(), "Max realtime priority");
    Finding finding{"realtime", "",
                    fmt::format("no thread has priority; limit {}", limit.value_or("unknown"))};
    const auto allowed = limit ? number_in(*limit) : std::nullopt;  // none: unlimited
    if (allowed && *allowed < realtime_priority) {
        finding.verdict = Verdict::warning;
        finding.reason = "load of the host delays the stamps of the board's messages: sigma grows";
        finding.cure = fmt::format(
            "sudo systemctl edit versavisd: LimitRTPRIO={} below [Service]; then restart it",
            realtime_priority);
    } else {
        finding.verdict = Verdict::unknown;
        finding.reason = "the limit allows it: refused by the kernel, or given back under load";
    }
    return {finding};
}

Findings check_governor(const HostFiles& files) {
    const std::string folder = "/sys/devices/system/cpu/";
    std::map<std::string, int> governors;
    for (const std::string& cpu : files.list(folder))
        if (const auto governor = files.text(folder + cpu + "/cpufreq/scaling_governor"))
            ++governors[*governor];
    if (governors.empty()) return {};  // a virtual machine has none
    Finding finding{"governor", "", ""};
    for (const auto& [name, cpus] : governors)
        finding.value +=
            fmt::format("{}{} on {} CPUs", finding.value.empty() ? "" : ", ", name, cpus);
    if (governors.size() == 1 && governors.count("performance") == 1) return {finding};
    finding.verdict = Verdict::warning;
    finding.reason = "CPUs that must speed up first read packets late";
    finding.cure = "sudo cpupower frequency-set -g performance (apt install linux-cpupower)";
    return {finding};
}

/// Free space of the file system that has `path`, or the nearest folder above it that exists.
Findings check_space(const Subject& subject, const std::string& check, const std::string& path,
                     std::uint64_t least_mib, const std::string& consequence,
                     const std::string& cure) {
    std::filesystem::path place = subject.files.path(path);
    struct statvfs space {};
    while (::statvfs(place.c_str(), &space) != 0 && errno == ENOENT && place.has_relative_path())
        place = place.parent_path();
    if (space.f_frsize == 0) return {};
    const auto mib = [&space](std::uint64_t blocks) { return blocks * space.f_frsize >> 20U; };
    Finding finding{check, path,
                    fmt::format("{} of {} MiB free", mib(space.f_bavail), mib(space.f_blocks))};
    if (mib(space.f_bavail) < least_mib) {
        finding.verdict = Verdict::bad;
        finding.reason = consequence;
        finding.cure = cure;
    } else if ((space.f_flag & ST_RDONLY) != 0) {
        finding.value += ", read-only";
        finding.verdict = Verdict::warning;
        finding.reason = consequence;
        finding.cure = "mount a file system there that can be written, or set 'state_directory'";
    }
    return {finding};
}

constexpr auto no_rings = "the service cannot make its rings when it starts";

/// Where the rings lie: sealed ones have no file.
Findings check_memory(const Subject& subject) {
    if (subject.configuration && !subject.configuration->sealed_rings)
        return check_space(
            subject, "shm", "/dev/shm", least_memory_mib, no_rings,
            "du -sh /dev/shm/* says who fills it; sudo mount -o remount,size=75% /dev/shm");
    std::istringstream text(subject.files.text("/proc/meminfo").value_or(""));
    std::string name;
    std::uint64_t kib = 0;
    while (text >> name >> kib && name != "MemAvailable:") std::getline(text, name);
    if (!text) return {};
    Finding finding{"memory", "", fmt::format("{} MiB available", kib >> 10U)};
    if (kib >> 10U < least_memory_mib) {
        finding.verdict = Verdict::bad;
        finding.reason = no_rings;
        finding.cure = "ps aux --sort=-rss | head says which programs take it";
    }
    return {finding};
}

Findings check_permission(const Subject& subject) {
    const std::string directory = instance_directory(subject.instance);
    if (::access(directory.c_str(), R_OK | X_OK) == 0)
        return {{"permission", directory, "this user may read the streams"}};
    if (errno != EACCES) return {};  // there are none
    const passwd* user = ::getpwuid(::getuid());
    return {{"permission", directory, "this user may not read the streams", Verdict::bad,
             "only members of the group versavis may",
             fmt::format("sudo usermod -aG versavis {}; then log out and in again",
                         user != nullptr ? user->pw_name : "$USER")}};
}

}  // namespace

Findings check_host(const Subject& subject) {
    Findings findings;
    const auto add = [&findings](Findings more) {
        findings.insert(findings.end(), more.begin(), more.end());
    };
    add(check_realtime(subject));
    add(check_governor(subject.files));
    add(check_memory(subject));
    if (subject.configuration)
        add(check_space(
            subject, "disk", subject.configuration->state_directory, least_disk_mib,
            "measurements that the service reuses are not kept",
            fmt::format("df -h {} says how full it is", subject.configuration->state_directory)));
    add(check_permission(subject));
    return findings;
}

}  // namespace versavis::client
