// SPDX-License-Identifier: BSD-3-Clause
#include "discovery/service_program.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "posix/child_process.hpp"

namespace versavis::client {

Expected<ProgramResult> run_versavisd(std::vector<std::string> arguments) {
    const std::string program = installed_program("versavisd");
    arguments.insert(arguments.begin(), program);
    auto process = ChildProcess::start(std::move(arguments), ChildProcess::Errors::inherited);
    if (!process)
        return failure(program, process.error().what, "install the service beside this program");
    ProgramResult result;
    std::array<char, 4096> part{};
    for (;;) {
        const ssize_t size = ::read(process->socket(), part.data(), part.size());
        if (size < 0 && errno == EINTR) continue;
        if (size <= 0) break;
        result.output.append(part.data(), static_cast<std::size_t>(size));
    }
    const int status = process->wait();
    if (!WIFEXITED(status)) return failure(program, "it crashed", "see its log");
    result.exit_code = WEXITSTATUS(status);
    return result;
}

}  // namespace versavis::client
