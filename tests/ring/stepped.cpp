// SPDX-License-Identifier: BSD-3-Clause
#include "stepped.hpp"

#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <stdexcept>

namespace versavis::test {

void mark() { std::raise(SIGSTOP); }

Stepped::Stepped(const std::function<void()>& body) : process_(::fork()) {
    if (process_ < 0) throw std::runtime_error("no process to be had");
    if (process_ == 0) {
        ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
        body();
        ::_exit(0);
    }
    int status = 0;
    if (::waitpid(process_, &status, 0) != process_ || !WIFSTOPPED(status) ||
        WSTOPSIG(status) != SIGSTOP)
        throw std::runtime_error("a process cannot be traced, or ended before its first mark");
}

Stepped::~Stepped() { kill(); }

bool Stepped::kill_after(unsigned steps, Step step) {
    const int request = step == Step::instruction ? PTRACE_SINGLESTEP : PTRACE_SYSCALL;
    bool stepping = true;
    for (unsigned i = 0; i < steps && stepping; ++i) stepping = run(request) == SIGTRAP;
    kill();
    return stepping;
}

/// The signal that stopped it again.
int Stepped::run(int request) const {
    int status = 0;
    if (::ptrace(static_cast<__ptrace_request>(request), process_, nullptr, nullptr) != 0 ||
        ::waitpid(process_, &status, 0) != process_ || !WIFSTOPPED(status))
        throw std::runtime_error("a process ended before its second mark");
    return WSTOPSIG(status);
}

void Stepped::kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
    process_ = -1;
}

}  // namespace versavis::test
