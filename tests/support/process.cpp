// SPDX-License-Identifier: BSD-3-Clause
#include "process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <ctime>
#include <fstream>
#include <sstream>
#include <stdexcept>

extern char** environ;

namespace versavis::test {

namespace {

/// Between two looks at something that can only be polled.
void pause_between_looks() {
    const timespec pause{0, 2'000'000};
    nanosleep(&pause, nullptr);
}

}  // namespace

Process::Process(const std::vector<std::string>& arguments, const std::string& log) : log_(log) {
    std::vector<char*> argv;
    for (const std::string& argument : arguments)
        argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                     O_CREAT | O_TRUNC | O_WRONLY | O_APPEND, 0644);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    const int error = posix_spawnp(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot start " + arguments[0]);
}

Process::~Process() {
    if (code_ >= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
}

void Process::signal(int number) const { ::kill(pid_, number); }

int Process::wait(Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    while (code_ < 0) {
        int status = 0;
        if (::waitpid(pid_, &status, WNOHANG) == pid_)
            code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
        else if (host_now() > deadline)
            return -1;
        else
            pause_between_looks();
    }
    return code_;
}

int Process::terminate(Duration timeout) {
    if (code_ < 0) signal(SIGTERM);
    return wait(timeout);
}

bool Process::wait_for_output(const std::string& text, Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    while (output().find(text) == std::string::npos) {
        if (host_now() > deadline || wait({}) >= 0) return output().find(text) != std::string::npos;
        pause_between_looks();
    }
    return true;
}

std::string Process::output() const {
    std::ifstream file(log_);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
}

int run(const std::vector<std::string>& arguments, const std::string& log, std::string* output) {
    Process process(arguments, log);
    const int code = process.wait(seconds(60));
    if (output != nullptr) *output = process.output();
    return code;
}

std::string program(const std::string& name) { return std::string(VERSAVIS_BIN_DIR) + "/" + name; }

}  // namespace versavis::test
