// SPDX-License-Identifier: BSD-3-Clause
// The examples, as their readers will run them: against a live service, which dies and comes back.
#include <catch2/catch.hpp>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "../support/process.hpp"
#include "../support/stack.hpp"
#include "../support/temporary_directory.hpp"

using namespace versavis;
using test::Process;
using test::Stack;

namespace {

struct Example {
    std::vector<std::string> command;
    std::string line;   ///< a part of what it prints
    std::string after;  ///< and of what it prints of a service that died; empty: it is silent
};

std::vector<std::string> python(const std::string& name) {
    return {"/usr/bin/python3", "-u", VERSAVIS_SOURCE_DIR "/clients/examples/" + name};
}

const std::vector<Example> examples{
    {{test::program("example-viewer")}, "mean brightness", "the service is gone"},
    {{test::program("example-stereo")}, "samples", "the service is gone"},
    {{test::program("example-epoll")}, "rad/s", ""},
    {{test::program("example-viewer-c")}, "first byte", "the service is gone"},
    {{test::program("example-stereo-c")}, "samples", "the service is gone"},
    {{test::program("example-epoll-c")}, "a frame of", ""},
    {{test::program("viewer-abi-1.0")}, "first byte", "the service is gone"},
    {{test::program("stereo-abi-1.0")}, "samples", "the service is gone"},
    {python("viewer.py"), "ns +- ", "the service is gone"},
    {python("stereo.py"), "IMU samples", "the service is gone"},
    {python("epoll.py"), "imu0", ""},
    {python("numpy_consumer.py"), "changed by", "the service is gone"},
};

bool is_python(const Example& example) { return example.command.front() == "/usr/bin/python3"; }

/// What a program needs to find its streams, the library and the package.
class Environment {
 public:
    explicit Environment(const std::string& instance) {
        ::setenv("VERSAVIS_INSTANCE", instance.c_str(), 1);
        ::setenv("VERSAVIS_LIBRARY", VERSAVIS_LIBRARY_FILE, 1);
        ::setenv("PYTHONPATH", VERSAVIS_SOURCE_DIR "/clients/python", 1);
        ::setenv("PYTHONDONTWRITEBYTECODE", "1", 1);
    }
    ~Environment() {
        for (const char* name : {"VERSAVIS_INSTANCE", "VERSAVIS_LIBRARY", "PYTHONPATH"})
            ::unsetenv(name);
    }
    Environment(const Environment&) = delete;
    Environment& operator=(const Environment&) = delete;
};

/// The exit code of a shell in which `script` runs this program as "$@".
int in_shell(const char* script, const std::vector<std::string>& command, const std::string& log,
             std::string* output = nullptr) {
    std::vector<std::string> all{"/bin/sh", "-c", script, "sh"};
    all.insert(all.end(), command.begin(), command.end());
    return test::run(all, log, output);
}

}  // namespace

TEST_CASE("examples: without a service each says so in a sentence") {
    const Environment environment("nobody");
    const test::TemporaryDirectory directory;
    for (const Example& example : examples) {
        CAPTURE(example.command);
        std::string output;
        CHECK(test::run(example.command, (directory.path() / "log").string(), &output) == 1);
        CHECK_THAT(output,
                   Catch::Contains("is the service running?") && !Catch::Contains("Traceback"));
    }
}

TEST_CASE("examples: each does what it says, and goes on after a restart") {
    Stack stack(test::StackSettings{"examples", 61, 2, 20, "", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status([](const auto& status) { return status["health"] == "ok"; });
    const Environment environment(stack.instance());
    const std::filesystem::path door = stream_path(stack.instance(), "cam0");
    CHECK(std::filesystem::is_socket(door));
    // A reader written from the document finds the way in, too.
    CHECK(test::run({"python3", VERSAVIS_SOURCE_DIR "/tests/system/read_ring.py", door, "3"},
                    stack.log_path("foreign"), nullptr) == 0);
    std::vector<std::unique_ptr<Process>> running;
    for (const Example& example : examples)
        running.push_back(std::make_unique<Process>(
            example.command, stack.log_path("example-" + std::to_string(running.size()))));
    for (std::size_t i = 0; i < examples.size(); ++i) {
        CAPTURE(examples[i].command);
        CHECK(running[i]->wait_for_output(examples[i].line, seconds(20)));
    }
    for (const char* viewer : {"example-viewer", "example-viewer-c"})
        CHECK(in_shell("exec \"$@\" > /dev/full", {test::program(viewer)},
                       stack.log_path("full")) == 1);
    for (const Example& example : examples) {
        if (!is_python(example)) continue;
        CAPTURE(example.command);
        std::string output;
        CHECK(in_shell("\"$@\" | head -n 1", example.command, stack.log_path("head"), &output) ==
              0);
        CHECK_THAT(output, !Catch::Contains("Traceback") && !Catch::Contains("BrokenPipe"));
    }
    stack.kill_service();
    for (std::size_t i = 0; i < examples.size(); ++i) {
        CAPTURE(examples[i].command);
        CHECK(running[i]->wait_for_output(examples[i].after, seconds(20)));
    }
    std::vector<std::size_t> printed;
    for (const auto& process : running) printed.push_back(process->output().size());
    stack.start_service();
    const HostTime deadline = host_now() + seconds(40);
    for (std::size_t i = 0; i < examples.size(); ++i) {
        CAPTURE(examples[i].command);
        const auto goes_on = [&] {
            return running[i]->output().find(examples[i].line, printed[i]) != std::string::npos;
        };
        while (!goes_on() && host_now() < deadline)
            stack.wait_for_status([](auto&) { return true; });
        CHECK(goes_on());
        running[i]->signal(SIGINT);
        CHECK(running[i]->wait(seconds(20)) == (is_python(examples[i]) ? 0 : 128 + SIGINT));
        CHECK_THAT(running[i]->output(), !Catch::Contains("Traceback"));
    }
}
