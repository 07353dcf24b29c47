// SPDX-License-Identifier: BSD-3-Clause
#include "client/process.hpp"

#include <unistd.h>

#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>

namespace versavis::ring {

namespace {

// A writer whose heartbeat is older than this is considered dead. If lower, a service that is
// delayed looks dead; if higher, readers in another pid namespace notice a death later.
constexpr std::int64_t heartbeat_limit_ns = 3'000'000'000;

// From this age of the heartbeat on, the writer's start time is checked as well as its process id,
// which costs some 20 us. If lower, idle readers pay for it, since services update it every 50 ms;
// if higher, a zombie passes for alive for longer.
constexpr std::int64_t doubtful_ns = 100'000'000;

bool can_be_judged(const Constants& constants) {
    return constants.writer_pid != 0 && constants.writer_pid <= INT_MAX &&
           constants.pid_namespace != 0 && constants.pid_namespace == own_namespaces().pid;
}

/// Empty: there is no such process, or it cannot be read.
std::string stat_of(std::uint32_t pid) {
    std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
    std::string line;
    std::getline(stat, line);
    return line;
}

/// The inode from a link such as "pid:[4026531836]", which a process may read where AppArmor denies
/// it to look at the file itself. 0: there is no such namespace.
std::uint64_t namespace_inode(const char* path) {
    char link[64] = {};
    if (::readlink(path, link, sizeof link - 1) < 0) return 0;
    const char* number = std::strchr(link, '[');
    return number == nullptr ? 0 : std::strtoull(number + 1, nullptr, 10);
}

/// 0: only the remains of a process.
std::uint64_t start_in(const std::string& line) {
    std::size_t at = line.rfind(')');  // the command may contain spaces
    if (at != std::string::npos && line[at + 2] == 'Z') return 0;
    for (int field = 3; field <= 22 && at != std::string::npos; ++field)
        at = line.find(' ', at + 1);
    return at == std::string::npos ? 0 : std::strtoull(line.c_str() + at, nullptr, 10);
}

}  // namespace

Liveness quick_liveness(const Constants& constants) {
    if (!can_be_judged(constants)) return Liveness::unknown;
    const auto pid = static_cast<pid_t>(constants.writer_pid);
    return ::kill(pid, 0) != 0 && errno == ESRCH ? Liveness::dead : Liveness::alive;
}

Liveness liveness(const Constants& constants) {
    if (const Liveness quick = quick_liveness(constants); quick != Liveness::alive) return quick;
    const std::string line = stat_of(constants.writer_pid);
    if (line.empty()) return Liveness::unknown;  // /proc may hide other users' processes
    const std::uint64_t start = start_in(line);
    if (start != 0 && constants.time_namespace != own_namespaces().time) return Liveness::unknown;
    return start == constants.writer_start_ticks ? Liveness::alive : Liveness::dead;
}

std::uint64_t start_ticks_of(std::uint32_t pid) { return start_in(stat_of(pid)); }

std::uint64_t start_ticks_of_this_process() {
    return start_ticks_of(static_cast<std::uint32_t>(::getpid()));
}

Namespaces own_namespaces() {
    // A process stays where it was born; a child may be born elsewhere. Asking the kernel takes
    // 5 us each, and readers ask between waking up and handing over an item.
    thread_local pid_t process = 0;
    thread_local Namespaces known{};
    if (const pid_t now = ::getpid(); now != process) {
        known = {namespace_inode("/proc/self/ns/pid"), namespace_inode("/proc/self/ns/time")};
        process = now;
    }
    return known;
}

bool is_own(const Constants& constants) {
    return constants.writer_pid == static_cast<std::uint32_t>(::getpid()) &&
           constants.pid_namespace == own_namespaces().pid &&
           constants.time_namespace == own_namespaces().time &&
           constants.writer_start_ticks == start_ticks_of_this_process();
}

bool Pulse::beats(HostTime heartbeat, HostTime now) {
    const bool young = heartbeat.ns <= now.ns && heartbeat.ns > now.ns - heartbeat_limit_ns;
    if (!young && last_ && heartbeat > *last_) changed_ = now;
    last_ = heartbeat;
    return young || (changed_ && now.ns - changed_->ns < heartbeat_limit_ns);
}

bool writer_lives(const Mapping& mapping, Pulse& pulse) {
    const Header& header = mapping.header();
    // SYNC 6: acquire here, release in supersede() and end(): a reader that sees the segment ended
    // also sees its last item in a second look. Otherwise that item could go unread.
    const auto state = header.state.load(std::memory_order_acquire);
    if (state != static_cast<std::uint32_t>(WriterState::live)) return false;
    const HostTime now = host_now();
    const HostTime heartbeat{header.heartbeat_ns.load(std::memory_order_relaxed)};
    const bool doubtful = heartbeat.ns < now.ns - doubtful_ns;
    const Constants& constants = mapping.constants();
    const Liveness seen = doubtful ? liveness(constants) : quick_liveness(constants);
    return pulse.beats(heartbeat, now) && seen != Liveness::dead;
}

}  // namespace versavis::ring
