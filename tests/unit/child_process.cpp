// SPDX-License-Identifier: BSD-3-Clause
#include "posix/child_process.hpp"

#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cerrno>
#include <filesystem>
#include <optional>

using namespace versavis;

namespace {

std::string received(const ChildProcess& process) {
    std::string text(100, '\0');
    text.resize(
        static_cast<std::size_t>(::recv(process.socket(), text.data(), text.size(), MSG_WAITALL)));
    return text;
}

}  // namespace

TEST_CASE("child_process: reads and writes one socket, and its end is known") {
    auto echo = ChildProcess::start({"sh", "-c", "cat; echo lost >&2; exit 7"},
                                    ChildProcess::Errors::dropped);
    REQUIRE(echo);
    REQUIRE(::send(echo->socket(), "text", 4, MSG_NOSIGNAL) == 4);
    CHECK_FALSE(echo->ended());
    ::shutdown(echo->socket(), SHUT_WR);
    CHECK(received(*echo) == "text");
    const int status = echo->wait();
    CHECK(echo->ended());
    CHECK(WIFEXITED(status));
    CHECK(WEXITSTATUS(status) == 7);
}

TEST_CASE("child_process: does not outlive its owner, wherever that was moved") {
    auto first = ChildProcess::start({"sh", "-c", "echo $$; exec sleep 60"},
                                     ChildProcess::Errors::inherited);
    REQUIRE(first);
    std::optional<ChildProcess> owner(std::move(*first));
    std::string text(20, '\0');
    text.resize(static_cast<std::size_t>(::recv(owner->socket(), text.data(), text.size(), 0)));
    const pid_t pid = std::stoi(text);
    CHECK(::kill(pid, 0) == 0);
    owner.reset();
    CHECK(::kill(pid, 0) != 0);
    CHECK(errno == ESRCH);
}

TEST_CASE("child_process: takes signals, and its end is seen before it is waited for") {
    auto process = ChildProcess::start({"sleep", "60"}, ChildProcess::Errors::inherited);
    REQUIRE(process);
    process->send(SIGTERM);
    CHECK(received(*process).empty());  // until its end
    while (!process->ended()) ::usleep(1000);
    const int status = process->wait();
    CHECK(WIFSIGNALED(status));
    CHECK(WTERMSIG(status) == SIGTERM);
    process->send(SIGTERM);  // to nobody
}

TEST_CASE("child_process: programs are installed together", "[kernel]") {
    CHECK(std::filesystem::exists(installed_program("unit_tests")));
    CHECK_FALSE(std::filesystem::exists(installed_program("no_such_program")));
}

TEST_CASE("child_process: a program that is not there is an error", "[kernel]") {
    const auto none = ChildProcess::start({"/nowhere/program"}, ChildProcess::Errors::inherited);
    REQUIRE_FALSE(none);
    CHECK_THAT(none.error().message(), Catch::Contains("/nowhere/program: cannot be started"));
}
