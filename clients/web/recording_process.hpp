// SPDX-License-Identifier: BSD-3-Clause
// `versavis record` as a process of its own, begun and ended from the page: what happens to the
// page or its server, a full disk among it, does not touch the service. Used by one thread.
#pragma once

#include <ctime>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "posix/child_process.hpp"
#include "versavis/time.hpp"

namespace versavis::web {

class RecordingProcess {
 public:
    /// `directory`: where files go; empty: nothing is recorded.
    RecordingProcess(std::string instance, std::string directory)
        : instance_(std::move(instance)), directory_(std::move(directory)) {}
    RecordingProcess(const RecordingProcess&) = delete;
    RecordingProcess& operator=(const RecordingProcess&) = delete;
    ~RecordingProcess();  ///< ends it; the file is complete

    bool possible() const { return !directory_.empty(); }

    /// All streams, into a file named by the time. Errors: it runs already; cannot be started.
    Expected<> begin(HostTime now, std::time_t date);

    /// Asks it to end. Errors: none runs.
    Expected<> end();

    /// {possible, running, file, seconds, bytes, report, problem}: of the one that runs, or ran
    /// last.
    nlohmann::json facts(HostTime now);

 private:
    void look(HostTime now);

    std::string instance_;
    std::string directory_;
    std::optional<ChildProcess> process_;
    HostTime begun_;
    HostTime ended_;
    std::string file_;
    nlohmann::json report_;
    std::string problem_;
};

}  // namespace versavis::web
