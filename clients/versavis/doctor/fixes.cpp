// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/fixes.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "posix/file_descriptor.hpp"

namespace versavis::client {

void apply_fixes(const HostFiles& files, Findings& findings) {
    for (Finding& finding : findings) {
        if (!finding.fix) continue;
        const std::string& content = finding.fix->content;
        // One write: files of the kernel take a value as a whole.
        const FileDescriptor file(
            ::open(files.path(finding.fix->file).c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC));
        const bool written = file && ::write(file.get(), content.data(), content.size()) ==
                                         static_cast<ssize_t>(content.size());
        if (written)
            finding.fixed = true;
        else
            finding.reason +=
                "; --fix: " + finding.fix->file + ": " + std::generic_category().message(errno);
    }
}

}  // namespace versavis::client
