// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description_sandbox.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>

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

/// Between looks at `cancelled`.
constexpr Duration look_interval = milliseconds(20);

/// The most that a probe says.
constexpr std::size_t longest_reason = 500;

struct Verdict {
    std::string refused;  ///< why; empty: nothing is wrong
    bool slow = false;    ///< perhaps because this host is
};

/// A child with its standard input and output; killed when nobody waits for it any more.
class Probe {
 public:
    Probe(const std::string& program, bool zipped) {
        std::array<int, 2> ends{};
        if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return;
        socket_ = ends[0];
        ::fcntl(socket_, F_SETFL, O_NONBLOCK);
        std::string option = "--probe-description";
        std::string kind = zipped ? "zip" : "xml";
        std::string name = program;
        char* const arguments[] = {name.data(), option.data(), kind.data(), nullptr};
        posix_spawn_file_actions_t files;
        posix_spawn_file_actions_init(&files);
        posix_spawn_file_actions_adddup2(&files, ends[1], STDIN_FILENO);
        posix_spawn_file_actions_adddup2(&files, ends[1], STDOUT_FILENO);
        // What its libraries write there fails and is nobody's; /dev/null may not exist in a
        // chroot.
        posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/", O_RDONLY | O_DIRECTORY, 0);
        posix_spawnattr_t attributes;
        posix_spawnattr_init(&attributes);
        sigset_t none;
        sigemptyset(&none);
        posix_spawnattr_setsigmask(&attributes, &none);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
        if (posix_spawn(&pid_, name.c_str(), &files, &attributes, arguments, environ) != 0)
            pid_ = -1;
        posix_spawnattr_destroy(&attributes);
        posix_spawn_file_actions_destroy(&files);
        ::close(ends[1]);
    }
    ~Probe() {
        if (socket_ >= 0) ::close(socket_);
        if (pid_ > 0) {
            ::kill(pid_, SIGKILL);
            ::waitpid(pid_, nullptr, 0);
        }
    }
    Probe(const Probe&) = delete;
    Probe& operator=(const Probe&) = delete;

    bool runs() const { return pid_ > 0; }

    /// Sends all, and receives what it says until it is done. False: it does not end.
    bool talk(const std::vector<std::uint8_t>& bytes, const Cancelled& cancelled) {
        const HostTime deadline = host_now() + probe_patience;
        for (std::size_t sent = 0; host_now() < deadline && !cancelled();) {
            const bool sending = sent < bytes.size();
            pollfd polled{socket_, static_cast<short>(sending ? POLLIN | POLLOUT : POLLIN), 0};
            const timespec pause{0, look_interval.ns};
            if (::ppoll(&polled, 1, &pause, nullptr) <= 0) continue;
            if (sending && (polled.revents & POLLOUT) != 0) {
                const ssize_t size =
                    ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
                sent = size > 0 ? sent + static_cast<std::size_t>(size) : bytes.size();
                if (sent == bytes.size()) ::shutdown(socket_, SHUT_WR);
            }
            if ((polled.revents & (POLLIN | POLLHUP)) == 0) continue;
            std::array<char, longest_reason> part{};
            const ssize_t size = ::recv(socket_, part.data(), part.size(), 0);
            if (size <= 0) return true;
            said_.append(part.data(), static_cast<std::size_t>(size));
            if (said_.size() > longest_reason) return true;
        }
        return false;
    }

    Verdict verdict() {
        int status = 0;
        ::waitpid(pid_, &status, 0);
        pid_ = -1;
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
    int socket_ = -1;
    pid_t pid_ = -1;
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
        Probe probe(program_, description.zipped);
        if (!probe.runs())
            return failure(camera, "its description cannot be checked: no probe process",
                           "allow the service to start processes");
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
