// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/wait_set.hpp"

#include <algorithm>
#include <vector>

#include "client/deadline.hpp"
#include "client/futex.hpp"
#include "client/segment.hpp"
#include "client/watch.hpp"

namespace versavis {

using ring::FutexWord;

struct WaitSet::State {
    std::vector<ring::Reader*> readers;
    std::vector<FutexWord> words;
    std::size_t turn = 0;  ///< the one that is asked first
    std::optional<HostTime> deadline;
    std::unique_ptr<ring::Watch> watch;  ///< once fd() was called
};

WaitSet::WaitSet() : state_(std::make_unique<State>()) {}
WaitSet::WaitSet(WaitSet&&) noexcept = default;
WaitSet& WaitSet::operator=(WaitSet&&) noexcept = default;
WaitSet::~WaitSet() = default;

Expected<> WaitSet::add(ring::Reader& reader) {
    if (state_->readers.size() + 1 >= ring::most_futex_words)
        return failure(ErrorCode::exhausted, reader.name(),
                       "is one stream more than a WaitSet can hold",
                       "use a second WaitSet in another thread");
    state_->readers.push_back(&reader);
    return {};
}

std::optional<std::size_t> WaitSet::ready() {
    const std::size_t count = state_->readers.size();
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t at = (state_->turn + i) % count;
        if (!state_->readers[at]->ready()) continue;
        state_->turn = at + 1;
        return at;
    }
    return std::nullopt;
}

std::optional<std::size_t> WaitSet::wait(Duration timeout) {
    const HostTime deadline = deadline_after(timeout);
    const auto& readers = state_->readers;
    for (;;) {
        if (state_->watch) state_->watch->calm();
        state_->words.clear();
        for (ring::Reader* reader : readers) state_->words.push_back(reader->wake_word());
        if (const auto found = ready()) {
            if (state_->watch) state_->watch->signal();
            return found;
        }
        const Duration left = left_until(deadline);
        if (left == Duration{}) break;
        ring::futex_wait_any(state_->words, std::min(left.ns, ring::longest_sleep_ns));
    }
    if (state_->watch) arm();
    return std::nullopt;
}

void WaitSet::arm() {
    std::vector<ring::WatchTarget> targets;
    std::optional<HostTime> deadline = state_->deadline;
    auto word = state_->words.begin();
    for (const ring::Reader* reader : state_->readers) {
        targets.push_back(reader->target((word++)->value));
        const auto retry = reader->retry();
        if (retry) deadline = std::min(*retry, deadline.value_or(*retry));
    }
    state_->watch->arm(std::move(targets), deadline);
}

Expected<int> WaitSet::fd() {
    if (!state_->watch) {
        auto watch = ring::Watch::start();
        if (!watch) return Unexpected(watch.error());
        state_->watch = std::move(*watch);
    }
    return state_->watch->fd();
}

void WaitSet::set_deadline(std::optional<HostTime> deadline) { state_->deadline = deadline; }

}  // namespace versavis
