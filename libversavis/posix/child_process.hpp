// SPDX-License-Identifier: BSD-3-Clause
// A program that runs as a child and does not outlive its owner.
#pragma once

#include <sys/types.h>

#include <string>
#include <utility>
#include <vector>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"

namespace versavis {

/// Where a program is that was installed with this one.
std::string installed_program(const std::string& name);

class ChildProcess {
 public:
    enum class Errors { inherited, dropped };  ///< where its standard error goes

    /// Runs `arguments[0]`, looked for as a shell does, with no signal blocked.
    static Expected<ChildProcess> start(std::vector<std::string> arguments, Errors errors);
    ChildProcess(ChildProcess&& other) noexcept
        : pid_(std::exchange(other.pid_, -1)), socket_(std::move(other.socket_)) {}
    ~ChildProcess();  ///< kills it

    /// A stream whose other end is its standard input and output.
    int socket() const { return socket_.get(); }

    void send(int signal) const;

    /// Whether there is nothing left but its status, for wait().
    bool ended() const;

    /// Waits for its end; the status is that of waitpid().
    int wait();

 private:
    ChildProcess(pid_t pid, FileDescriptor socket) : pid_(pid), socket_(std::move(socket)) {}

    pid_t pid_;  ///< -1: it has ended
    FileDescriptor socket_;
};

}  // namespace versavis
