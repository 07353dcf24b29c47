// SPDX-License-Identifier: BSD-3-Clause
#include "posix/child_process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <system_error>

namespace versavis {

std::string installed_program(const std::string& name) {
    std::error_code error;
    return std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / name;
}

Expected<ChildProcess> ChildProcess::start(std::vector<std::string> arguments, Errors errors) {
    const auto failed = [&](int error) {
        return failure(arguments[0],
                       "cannot be started: " + std::generic_category().message(error));
    };
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
        return failed(errno);
    FileDescriptor ours(ends[0]);
    const FileDescriptor its(ends[1]);
    std::vector<char*> pointers;
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, its.get(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, its.get(), STDOUT_FILENO);
    // Writing to a directory fails; /dev/null may not exist in a chroot.
    if (errors == Errors::dropped)
        posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/", O_RDONLY | O_DIRECTORY, 0);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    pid_t pid = -1;
    const int error =
        posix_spawnp(&pid, pointers[0], &files, &attributes, pointers.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    if (error != 0) return failed(error);
    return ChildProcess(pid, std::move(ours));
}

ChildProcess::~ChildProcess() {
    if (pid_ < 0) return;
    ::kill(pid_, SIGKILL);
    wait();
}

void ChildProcess::send(int signal) const {
    if (pid_ > 0) ::kill(pid_, signal);
}

bool ChildProcess::ended() const {
    siginfo_t state{};
    return pid_ < 0 ||
           (::waitid(P_PID, static_cast<id_t>(pid_), &state, WEXITED | WNOHANG | WNOWAIT) == 0 &&
            state.si_pid == pid_);
}

int ChildProcess::wait() {
    int status = 0;
    ::waitpid(std::exchange(pid_, -1), &status, 0);
    return status;
}

}  // namespace versavis
