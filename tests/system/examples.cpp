// SPDX-License-Identifier: BSD-3-Clause
// The examples, as their readers will run them: against a live service, which dies and comes back.
#include <catch2/catch.hpp>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <vector>

#include "../support/process.hpp"
#include "../support/stack.hpp"

using namespace versavis;
using test::Process;
using test::Stack;

namespace {

struct Example {
    std::string program;
    std::string line;   ///< a part of what it prints
    std::string after;  ///< and of what it prints of a service that died; empty: it is silent
};

const std::vector<Example> examples{
    {"example-viewer", "mean brightness", "the service is gone"},
    {"example-stereo", "samples", "the service is gone"},
    {"example-epoll", "rad/s", ""},
    {"example-viewer-c", "first byte", "the service is gone"},
    {"example-stereo-c", "samples", "the service is gone"},
    {"example-epoll-c", "a frame of", ""},
};

}  // namespace

TEST_CASE("examples: each does what it says, and goes on after a restart") {
    Stack stack({"examples", 61, 2, 20, "", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status([](const auto& status) { return status["health"] == "ok"; });
    ::setenv("VERSAVIS_INSTANCE", stack.instance().c_str(), 1);
    std::vector<std::unique_ptr<Process>> running;
    for (const Example& example : examples)
        running.push_back(
            std::make_unique<Process>(std::vector<std::string>{test::program(example.program)},
                                      stack.log_path(example.program + ".log")));
    for (std::size_t i = 0; i < examples.size(); ++i) {
        CAPTURE(examples[i].program);
        CHECK(running[i]->wait_for_output(examples[i].line, seconds(20)));
    }
    stack.kill_service();
    for (std::size_t i = 0; i < examples.size(); ++i) {
        CAPTURE(examples[i].program);
        CHECK(running[i]->wait_for_output(examples[i].after, seconds(20)));
    }
    std::vector<std::size_t> printed;
    for (const auto& process : running) printed.push_back(process->output().size());
    stack.start_service();
    const HostTime deadline = host_now() + seconds(40);
    for (std::size_t i = 0; i < examples.size(); ++i) {
        CAPTURE(examples[i].program);
        const auto goes_on = [&] {
            return running[i]->output().find(examples[i].line, printed[i]) != std::string::npos;
        };
        while (!goes_on() && host_now() < deadline)
            stack.wait_for_status([](auto&) { return true; });
        CHECK(goes_on());
        running[i]->signal(SIGKILL);
    }
    ::unsetenv("VERSAVIS_INSTANCE");
}
