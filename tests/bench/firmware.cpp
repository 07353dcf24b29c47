// SPDX-License-Identifier: BSD-3-Clause
// Instructions that the firmware's core takes, counted one by one, and its memory.
#include <sys/ptrace.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <stdexcept>

#include "byte_register_device.hpp"
#include "metric.hpp"
#include "world.hpp"

namespace versavis::bench {

namespace {

using scenario::ms;

constexpr long breakpoint = 0xCC;
constexpr std::size_t most_calls = 4'000;  // stepping is slow; many periods of the cameras

/// Full load: 8 kHz IMU, four cameras at 200 Hz with light, PPS and clock requests.
void work_at_full_load(bool traced) {
    scenario::World world;
    for (unsigned camera = 0; camera < 4; ++camera) {
        scenario::CameraSettings settings;
        settings.exposure = [](auto, auto) { return 2 * ms; };
        world.add_camera(camera, settings, 200'000'000);
    }
    world.add_imu(std::make_unique<devices::Icm42688pDevice>(&scenario::World::motion),
                  wire::ImuKind::icm42688p, 8000, true);
    world.configuration.illumination = {15, 0, 0, 100'000, 4'000'000, 900'000};
    if (!world.begin()) throw std::runtime_error("the board refuses the configuration");
    world.run(300 * ms);
    world.set_link(76'923, 64, 128);
    if (traced) ::raise(SIGSTOP);
    world.send(wire::ClockRequest{1, 0});
    world.run(60 * ms);
}

/// A child that is stepped through: how many instructions each call of `function` takes, what it
/// calls included.
class InstructionCounter {
 public:
    InstructionCounter(void (*work)(bool), std::uintptr_t function)
        : function_(function), child_(::fork()) {
        if (child_ == 0) {
            ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
            work(true);
            ::_exit(0);
        }
        if (!stops_with(SIGSTOP))
            throw std::runtime_error("the firmware cannot be traced on this machine");
    }
    ~InstructionCounter() {
        ::kill(child_, SIGKILL);
        ::waitpid(child_, nullptr, 0);
    }
    InstructionCounter(const InstructionCounter&) = delete;
    InstructionCounter& operator=(const InstructionCounter&) = delete;

    std::vector<double> count_calls() {
        std::vector<double> counts;
        const long original = ::ptrace(PTRACE_PEEKTEXT, child_, function_, nullptr);
        while (counts.size() < most_calls) {
            ::ptrace(PTRACE_POKETEXT, child_, function_, (original & ~0xFFL) | breakpoint);
            ::ptrace(PTRACE_CONT, child_, nullptr, nullptr);
            if (!stops_with(SIGTRAP)) break;
            ::ptrace(PTRACE_POKETEXT, child_, function_, original);
            user_regs_struct registers = read_registers();
            registers.rip = function_;
            ::ptrace(PTRACE_SETREGS, child_, nullptr, &registers);
            counts.push_back(static_cast<double>(step_to_return(registers.rsp)));
        }
        return counts;
    }

 private:
    bool stops_with(int signal) const {
        int status = 0;
        return ::waitpid(child_, &status, 0) == child_ && WIFSTOPPED(status) &&
               WSTOPSIG(status) == signal;
    }
    user_regs_struct read_registers() const {
        user_regs_struct registers{};
        ::ptrace(PTRACE_GETREGS, child_, nullptr, &registers);
        return registers;
    }
    /// The call is over when the stack is above the return address.
    long step_to_return(unsigned long long stack) const {
        long steps = 0;
        while (read_registers().rsp <= stack) {
            ::ptrace(PTRACE_SINGLESTEP, child_, nullptr, nullptr);
            if (!stops_with(SIGTRAP)) break;
            ++steps;
        }
        return steps;
    }

    std::uintptr_t function_;
    pid_t child_;
};

std::uintptr_t address_of_poll() {
    void (firmware::Board::*const poll)() = &firmware::Board::poll;
    std::uintptr_t address = 0;
    std::memcpy(&address, &poll, sizeof address);
    return address;
}

}  // namespace

std::vector<Metric> bench_firmware() {
    InstructionCounter counter(&work_at_full_load, address_of_poll());
    std::vector<double> counts = counter.count_calls();
    if (counts.empty()) throw std::runtime_error("no poll was counted");
    std::sort(counts.begin(), counts.end());
    // A port at 125 MHz has 125'000 cycles until what is committed a millisecond ahead is due.
    return {
        {"firmware_poll_median", counts[counts.size() / 2], "instr.", 5'000},
        {"firmware_poll_worst", counts.back(), "instr.", 60'000},
        {"firmware_static_memory", static_cast<double>(sizeof(firmware::Board)) / 1024, "KiB", 64}};
}

}  // namespace versavis::bench
