// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description_sandbox.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "posix/child_process.hpp"
#include "posix/file.hpp"

namespace versavis::daemon {

namespace {

/// First line of the file: what was found good by other rules is looked at again.
constexpr const char* file_header = "versavis camera descriptions 2";

/// The most that are kept.
constexpr std::size_t most_kept = 1000;

/// Until a probe is killed that has not used up its CPU time.
constexpr Duration probe_patience = seconds(60);

/// Probes of one description that may use up their CPU time.
constexpr unsigned slow_probes = 3;

/// The most that a probe says.
constexpr std::size_t longest_reason = 500;

struct Verdict {
    std::string refused;  ///< why; empty: nothing is wrong
    bool slow = false;    ///< perhaps because this host is
};

/// What a probe process says of one description.
class Probe {
 public:
    explicit Probe(ChildProcess process) : process_(std::move(process)) {
        ::fcntl(process_.socket(), F_SETFL, O_NONBLOCK);
    }

    /// Sends all, and receives what it says until it is done. False: it does not end.
    bool talk(const std::vector<std::uint8_t>& bytes, const Cancelled& cancelled) {
        const HostTime deadline = host_now() + probe_patience;
        for (std::size_t sent = 0; host_now() < deadline && !cancelled();) {
            const bool sending = sent < bytes.size();
            pollfd polled{process_.socket(),
                          static_cast<short>(sending ? POLLIN | POLLOUT : POLLIN), 0};
            const timespec pause{0, cancelled_interval.ns};
            if (::ppoll(&polled, 1, &pause, nullptr) <= 0) continue;
            if (sending && (polled.revents & POLLOUT) != 0) {
                const ssize_t size = ::send(process_.socket(), bytes.data() + sent,
                                            bytes.size() - sent, MSG_NOSIGNAL);
                sent = size > 0 ? sent + static_cast<std::size_t>(size) : bytes.size();
                if (sent == bytes.size()) ::shutdown(process_.socket(), SHUT_WR);
            }
            if ((polled.revents & (POLLIN | POLLHUP)) == 0) continue;
            std::array<char, longest_reason> part{};
            const ssize_t size = ::recv(process_.socket(), part.data(), part.size(), 0);
            if (size <= 0) return true;
            said_.append(part.data(), static_cast<std::size_t>(size));
            if (said_.size() > longest_reason) return true;
        }
        return false;
    }

    Verdict verdict() {
        const int status = process_.wait();
        if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
        if (WIFEXITED(status) && !said_.empty())
            return {said_.substr(0, said_.find_first_of('\n'))};
        if (!WIFSIGNALED(status)) return {"parsing it crashes"};
        // The limit of CPU time is one of SIGKILL, too.
        if (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL)
            return {"parsing it takes too much CPU time", true};
        return {fmt::format("parsing it crashes with signal {}", WTERMSIG(status))};
    }

 private:
    ChildProcess process_;
    std::string said_;
};

}  // namespace

DescriptionSandbox::DescriptionSandbox(std::filesystem::path program,
                                       const std::filesystem::path& directory)
    : program_(std::move(program)), file_(directory / "descriptions") {
    std::ifstream file(file_);
    std::string line;
    if (!std::getline(file, line) || line != file_header) return;
    while (good_.size() < most_kept && std::getline(file, line)) good_.insert(line);
}

std::optional<std::string> DescriptionSandbox::known(const std::string& hash) const {
    const std::lock_guard lock(mutex_);
    if (good_.count(hash) != 0) return "";
    const auto refused = refused_.find(hash);
    return refused != refused_.end() ? std::optional(refused->second) : std::nullopt;
}

/// What is slow is checked again some times: the host may have been throttled.
void DescriptionSandbox::remember(const std::string& hash, const std::string& refused, bool slow) {
    const std::lock_guard lock(mutex_);
    if (refused.empty()) return keep(hash);
    if (slow && ++slow_[hash] < slow_probes) return;
    if (refused_.size() >= most_kept) refused_.clear();
    refused_[hash] = refused;
}

void DescriptionSandbox::keep(const std::string& hash) {
    if (good_.size() >= most_kept) good_.clear();
    good_.insert(hash);
    std::string text = fmt::format("{}\n", file_header);
    for (const std::string& line : good_) text += line + '\n';
    // Where it fails, they are looked at again in the next life.
    static_cast<void>(write_whole_file(file_, text));
}

Expected<> DescriptionSandbox::vet(const std::string& camera, const Description& description,
                                   const Cancelled& cancelled) {
    const std::string hash = hash_of(description) + (description.zipped ? " zip" : " xml");
    auto refused = known(hash);
    if (!refused) {
        auto process = ChildProcess::start(
            {program_, "--probe-description", description.zipped ? "zip" : "xml"},
            ChildProcess::Errors::dropped);
        if (!process)
            return failure(camera, "its description cannot be checked: no probe process",
                           "allow the service to start processes");
        Probe probe(std::move(*process));
        if (!probe.talk(description.bytes, cancelled))
            return failure(camera,
                           cancelled() ? "the check was stopped"
                                       : fmt::format("the check of its description does not end "
                                                     "within {} s",
                                                     probe_patience.ns / seconds(1).ns),
                           "this host is busy; the check is tried again");
        const Verdict verdict = probe.verdict();
        refused = verdict.refused;
        remember(hash, verdict.refused, verdict.slow);
    }
    if (refused->empty()) return {};
    return failure(camera, "its description is refused: " + *refused,
                   "ask its maker for another firmware, or take it off the network");
}

}  // namespace versavis::daemon
