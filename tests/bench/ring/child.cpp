// SPDX-License-Identifier: BSD-3-Clause
#include "child.hpp"

#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>
#include <utility>

namespace versavis::bench {

Child::Child(const std::function<void()>& body) {
    std::fflush(nullptr);
    pid_ = ::fork();
    if (pid_ < 0) throw std::runtime_error("no process to be had");
    if (pid_ > 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    try {
        body();
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench: {}\n", error.what());
        std::exit(EXIT_FAILURE);
    }
    std::exit(EXIT_SUCCESS);  // with what libraries do at exit
}

Child::Child(Child&& other) noexcept : pid_(std::exchange(other.pid_, -1)) {}

Child::~Child() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
}

void Child::finish(Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    int status = 0;
    while (::waitpid(pid_, &status, WNOHANG) == 0) {
        if (host_now() > deadline) throw std::runtime_error("a process of the bench hangs");
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    pid_ = -1;
    if (status != 0) throw std::runtime_error("a process of the bench failed");
}

Usage Usage::now() {
    rusage now{};
    getrusage(RUSAGE_SELF, &now);
    return {static_cast<double>(now.ru_utime.tv_sec + now.ru_stime.tv_sec) * 1e9 +
                static_cast<double>(now.ru_utime.tv_usec + now.ru_stime.tv_usec) * 1e3,
            static_cast<double>(now.ru_minflt)};
}

std::shared_ptr<void> shared_memory(std::size_t size) {
    void* memory = ::mmap(nullptr, size, PROT_READ | PROT_WRITE,
                          MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (memory == MAP_FAILED) throw std::runtime_error("no shared memory to be had");
    return {memory, [size](void* at) { ::munmap(at, size); }};
}

}  // namespace versavis::bench
