// SPDX-License-Identifier: BSD-3-Clause
#include "judge_process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

extern char** environ;

namespace versavis::liar {

JudgeProcess::JudgeProcess(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), VERSAVIS_JUDGE);
    std::vector<char*> words;
    for (std::string& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    int in[2];
    int out[2];
    if (::pipe2(in, O_CLOEXEC) != 0 || ::pipe2(out, O_CLOEXEC) != 0)
        throw std::runtime_error("judge: no pipes");
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, in[0], STDIN_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
    const int failed =
        ::posix_spawn(&pid_, arguments[0].c_str(), &actions, nullptr, words.data(), environ);
    ::posix_spawn_file_actions_destroy(&actions);
    ::close(in[0]);
    ::close(out[1]);
    to_judge_ = in[1];
    from_judge_ = out[0];
    ::signal(SIGPIPE, SIG_IGN);  // a judge that has ended is an error, not the end
    if (failed != 0) throw std::runtime_error("judge: cannot start " + arguments[0]);
}

JudgeProcess::~JudgeProcess() {
    ::close(to_judge_);  // its end
    ::close(from_judge_);
    ::waitpid(pid_, nullptr, 0);
}

void JudgeProcess::command(const nlohmann::json& command) {
    const std::string line = command.dump() + "\n";
    if (::write(to_judge_, line.data(), line.size()) != static_cast<ssize_t>(line.size()))
        throw std::runtime_error("the judge has ended");
}

nlohmann::json JudgeProcess::report() {
    command({{"do", "report"}});
    for (;;) {
        const std::size_t end = received_.find('\n');
        if (end != std::string::npos) {
            const auto document = nlohmann::json::parse(received_.substr(0, end));
            received_.erase(0, end + 1);
            return document;
        }
        char buffer[65536];
        const ssize_t size = ::read(from_judge_, buffer, sizeof buffer);
        if (size <= 0) throw std::runtime_error("the judge has ended");
        received_.append(buffer, static_cast<std::size_t>(size));
    }
}

}  // namespace versavis::liar
