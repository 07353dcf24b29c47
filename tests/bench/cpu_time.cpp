// SPDX-License-Identifier: BSD-3-Clause
#include "cpu_time.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace versavis::bench {

double cpu_seconds(pid_t pid) {
    std::ifstream file(fmt::format("/proc/{}/stat", pid));
    std::stringstream text;
    text << file.rdbuf();
    std::string line = text.str().substr(text.str().rfind(')') + 2);
    std::istringstream fields(line);
    std::string field;
    double ticks = 0;
    for (int number = 3; number <= 15 && fields >> field; ++number)
        if (number >= 14) ticks += std::stod(field);
    return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

double aravis_cpu_per_gb(test::Stack& stack, double seconds_each) {
    rusage before{};
    rusage after{};
    std::string output;
    getrusage(RUSAGE_CHILDREN, &before);
    test::run(
        {"arv-camera-test-0.8", "-n", stack.scenario().cameras[0].address, "--duration",
         std::to_string(static_cast<int>(seconds_each)), "--no-packet-socket", "-i", "9000", "-a"},
        stack.log_path("aravis.log"), &output);
    getrusage(RUSAGE_CHILDREN, &after);
    const auto seconds = [](const rusage& usage) {
        return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
               static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e-6;
    };
    const auto at = output.find("n_completed_buffers    = ");
    const double frames = at == std::string::npos ? 0 : std::stod(output.substr(at + 25));
    if (frames < seconds_each)
        throw std::runtime_error("arv-camera-test received nothing:\n" + output);
    return (seconds(after) - seconds(before)) / (frames * frame_gb);
}

}  // namespace versavis::bench
