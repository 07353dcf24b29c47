// SPDX-License-Identifier: BSD-3-Clause
// Whether the process that made a segment still runs, as far as this one can see.
#pragma once

#include <cstdint>
#include <optional>

#include "client/segment.hpp"
#include "versavis/time.hpp"

namespace versavis::ring {

enum class Liveness {
    alive,
    dead,
    unknown,  ///< it is of another pid or time namespace, or hidden from this process
};

/// By process id alone: one system call.
Liveness quick_liveness(const Constants& constants);

/// By process id and start time: detects zombies and a reused process id. Reads a file of /proc.
/// Between time namespaces start times do not compare: there only a heartbeat shows that a process
/// which is there is the writer.
Liveness liveness(const Constants& constants);

/// Field 22 of /proc/<pid>/stat; 0: there is no such process, or only its remains. With the process
/// id it identifies a process until reboot.
std::uint64_t start_ticks_of(std::uint32_t pid);
std::uint64_t start_ticks_of_this_process();

/// Inodes of this process's namespaces; 0: unknown. Those of time exist since Linux 5.6.
struct Namespaces {
    std::uint64_t pid;
    std::uint64_t time;
};
Namespaces own_namespaces();

/// True when this process made the segment. All that says so was its own then, namespaces included.
bool is_own(const Constants& constants);

/// Whether a writer updates its heartbeat: one reader asks repeatedly.
class Pulse {
 public:
    /// True when the heartbeat is young. One that is far off this process's clock, as that of a
    /// writer in another time namespace, is young when it has just changed.
    bool beats(HostTime heartbeat, HostTime now);

 private:
    std::optional<HostTime> last_;
    std::optional<HostTime> changed_;  ///< when it did so on a clock that is not this one's
};

/// True when the stream is open, its writer's process is not known to be dead, and its heart beats.
bool writer_lives(const Mapping& mapping, Pulse& pulse);

}  // namespace versavis::ring
