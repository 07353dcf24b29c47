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

const char* to_string(SpanGap gap) {
    switch (gap) {
        case SpanGap::none: return "none";
        case SpanGap::begin: return "begin";
        case SpanGap::end: return "end";
        case SpanGap::epoch: return "epoch";
        case SpanGap::numbers: return "numbers";
    }
    return "unknown";
}

void ImuWindow::forget() {
    samples_.clear();
    before_.reset();
}

Expected<void, NoItem> ImuWindow::collect() {
    for (int losses = 0; losses < most_losses;) {
        auto sample = stream_.next();
        if (sample) {
            samples_.push_back(std::move(*sample));
            if (samples_.size() > most_samples) samples_.pop_front();
        } else if (sample.error().why == Pause::restarted) {
            forget();
            return Unexpected<NoItem>(sample.error());
        } else if (sample.error().why != Pause::lost) {
            return {};
        } else {
            ++losses;
        }
    }
    return {};
}

bool ImuWindow::reaches(const EpochTime& time) const {
    return !samples_.empty() && samples_.back().time.life == time.life &&
           !samples_.back().time.precedes(time);
}

/// What was forgotten is read from the ring again, where it still is.
void ImuWindow::look_back(const EpochTime& after) {
    const ImuSample* oldest = samples_.empty() ? nullptr : &samples_.front();
    if (before_) oldest = &*before_;
    if (oldest == nullptr || !after.precedes(oldest->time)) return;
    // And the one before, which shows that none is missing.
    if (stream_.reader().seek(after, 1)) forget();
}

ImuSpan ImuWindow::take(const EpochTime& after, const EpochTime& upto) {
    ImuSpan span;
    const bool other_life = !samples_.empty() && samples_.front().time.life != after.life;
    if (!after.compares_with(upto) || other_life) {
        span.gap = SpanGap::epoch;
        return span;
    }
    while (!samples_.empty() && !after.precedes(samples_.front().time)) {
        before_ = std::move(samples_.front());
        samples_.pop_front();
    }
    const bool begun = before_ && before_->time.compares_with(after);
    const ImuSample* last = begun ? &*before_ : nullptr;
    bool counted = true;
    bool over = false;
    for (const ImuSample& sample : samples_) {
        over = !sample.time.compares_with(upto);
        if (over) break;
        if (last != nullptr && sample.data.number > last->data.number)
            span.lost += sample.data.number - last->data.number - 1;
        else if (last != nullptr)
            counted = false;
        last = &sample;
        if (upto.precedes(sample.time)) {
            span.beyond = sample;
            break;
        }
        span.samples.push_back(sample);
    }
    if (!begun)
        span.gap = before_ && before_->time.epoch < after.epoch ? SpanGap::epoch : SpanGap::begin;
    else if (last->time.precedes(upto))
        span.gap = over ? SpanGap::epoch : SpanGap::end;
    else
        span.gap = counted ? SpanGap::none : SpanGap::numbers;
    return span;
}

Expected<ImuSpan, NoItem> ImuWindow::between(const EpochTime& after, const EpochTime& upto,
                                             Duration patience) {
    if (!after.compares_with(upto)) return take(after, upto);
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
