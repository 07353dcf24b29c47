// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/imu_window.hpp"

#include <algorithm>

#include "client/deadline.hpp"

namespace versavis {

namespace {

// Samples kept at most: two minutes at 1 kHz, in 20 MB.
constexpr std::size_t most_samples = 131072;

// Losses tolerated in one look: a reader that keeps up has none, a slow one has one or two. If
// lower, a reader that is overtaken while it catches up looks once more; if higher, a damaged ring,
// where each look finds another loss, is given up later.
constexpr int most_losses = 16;

}  // namespace

Expected<ImuWindow> ImuWindow::open(const std::string& name, const StreamOptions& options) {
    StreamOptions from_oldest = options;
    from_oldest.start = Position::oldest;
    auto stream = ImuStream::open(name, from_oldest);
    if (!stream) return Unexpected(stream.error());
    return ImuWindow(std::move(*stream));
}

Expected<void, NoItem> ImuWindow::collect() {
    for (int losses = 0; losses < most_losses;) {
        auto sample = stream_.next();
        if (sample) {
            // A new epoch's times do not compare with those before.
            if (!samples_.empty() && samples_.back().data.epoch != sample->data.epoch) {
                samples_.clear();
                before_.reset();
            }
            samples_.push_back(std::move(*sample));
            if (samples_.size() > most_samples) samples_.pop_front();
        } else if (sample.error().why == Pause::restarted) {
            samples_.clear();
            before_.reset();
            return Unexpected<NoItem>(sample.error());
        } else if (sample.error().why != Pause::lost) {
            return {};
        } else {
            ++losses;
        }
    }
    return {};
}

bool ImuWindow::reaches(OutputTime time) const {
    return !samples_.empty() && samples_.back().time >= time;
}

/// What was forgotten is read from the ring again, where it still is.
void ImuWindow::look_back(OutputTime after) {
    const ImuSample* oldest = samples_.empty() ? nullptr : &samples_.front();
    if (before_) oldest = &*before_;
    if (oldest == nullptr || oldest->time <= after) return;
    stream_.reader().seek(after, 1);  // and the one before, which shows that none is missing
    samples_.clear();
    before_.reset();
}

ImuSpan ImuWindow::take(OutputTime after, OutputTime upto) {
    ImuSpan span;
    while (!samples_.empty() && samples_.front().time <= after) {
        before_ = samples_.front();
        samples_.pop_front();
    }
    const ImuSample* last = before_ ? &*before_ : nullptr;
    for (const ImuSample& sample : samples_) {
        if (last != nullptr && sample.data.number > last->data.number)
            span.lost += sample.data.number - last->data.number - 1;
        last = &sample;
        if (sample.time > upto) {
            span.beyond = sample;
            break;
        }
        span.samples.push_back(sample);
    }
    span.covered = reaches(upto) && before_;
    return span;
}

Expected<ImuSpan, NoItem> ImuWindow::between(OutputTime after, OutputTime upto, Duration patience) {
    look_back(after);
    const HostTime deadline = deadline_after(patience);
    for (;;) {
        if (auto collected = collect(); !collected) return Unexpected<NoItem>(collected.error());
        const Duration left = left_until(deadline);
        if (reaches(upto) || left == Duration{}) return take(after, upto);
        stream_.reader().wait(left);
    }
}

}  // namespace versavis
