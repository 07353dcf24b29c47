// SPDX-License-Identifier: BSD-3-Clause
// A process to which the kernel gives no more of something, or refuses a call.
#pragma once

#include <linux/filter.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include <csignal>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace versavis::test {

/// No thread can be started as long as this lives: none is given the stack that it would have.
class NoThreads {
 public:
    NoThreads() {
        ::pthread_getattr_default_np(&before_);
        pthread_attr_t huge{};
        ::pthread_attr_init(&huge);
        ::pthread_attr_setstacksize(&huge, std::size_t{1} << 60U);
        ::pthread_setattr_default_np(&huge);
        ::pthread_attr_destroy(&huge);
    }
    ~NoThreads() {
        ::pthread_setattr_default_np(&before_);
        ::pthread_attr_destroy(&before_);
    }
    NoThreads(const NoThreads&) = delete;
    NoThreads& operator=(const NoThreads&) = delete;

 private:
    pthread_attr_t before_{};
};

/// No file can be opened as long as this lives.
class NoDescriptors {
 public:
    NoDescriptors() {
        ::getrlimit(RLIMIT_NOFILE, &before_);
        const rlimit none{0, before_.rlim_max};
        ::setrlimit(RLIMIT_NOFILE, &none);
    }
    ~NoDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }
    NoDescriptors(const NoDescriptors&) = delete;
    NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
    rlimit before_{};
};

/// No file can grow beyond `size` as long as this lives.
class SmallFiles {
 public:
    explicit SmallFiles(std::uint64_t size) : signal_(std::signal(SIGXFSZ, SIG_IGN)) {
        ::getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit small{size, before_.rlim_max};
        ::setrlimit(RLIMIT_FSIZE, &small);
    }
    ~SmallFiles() {
        ::setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, signal_);
    }
    SmallFiles(const SmallFiles&) = delete;
    SmallFiles& operator=(const SmallFiles&) = delete;

 private:
    void (*signal_)(int);
    rlimit before_{};
};

/// From here on the kernel refuses this system call to the calling thread, and to those that it
/// starts, with `error`; with a `second`, only where that is its second argument. There is no way
/// back: it is for a process made for that. False: the machine does not allow it.
inline bool refuse(long call, int error, std::optional<std::uint32_t> second = std::nullopt) {
    const auto load = [](std::size_t offset) -> sock_filter {
        return BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset));
    };
    const auto allow_unless = [](std::uint32_t value, std::uint8_t skipped) -> sock_filter {
        return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, skipped);
    };
    const auto answer = [](std::uint32_t value) -> sock_filter {
        return BPF_STMT(BPF_RET | BPF_K, value);
    };
    const std::uint8_t more = second ? 2 : 0;
    std::vector<sock_filter> filter{
        load(offsetof(seccomp_data, nr)),
        allow_unless(static_cast<std::uint32_t>(call), static_cast<std::uint8_t>(more + 1))};
    if (second) {
        filter.push_back(load(offsetof(seccomp_data, args[1])));  // lower half: little-endian
        filter.push_back(allow_unless(*second, 1));
    }
    filter.push_back(answer(SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error)));
    filter.push_back(answer(SECCOMP_RET_ALLOW));
    const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
    return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

}  // namespace versavis::test
