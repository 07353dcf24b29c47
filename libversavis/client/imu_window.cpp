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

bool ImuWindow::reaches(OutputTime time, std::uint32_t epoch) const {
    if (samples_.empty()) return false;
    const ImuSample& newest = samples_.back();
    return newest.data.epoch > epoch || (newest.data.epoch == epoch && newest.time >= time);
}

/// What was forgotten is read from the ring again, where it still is.
void ImuWindow::look_back(OutputTime after, std::uint32_t epoch) {
    const ImuSample* oldest = samples_.empty() ? nullptr : &samples_.front();
    if (before_) oldest = &*before_;
    if (oldest == nullptr || oldest->data.epoch < epoch ||
        (oldest->data.epoch == epoch && oldest->time <= after))
        return;
    const bool is_newest = samples_.empty() || samples_.back().data.epoch == epoch;
    if (is_newest)
        stream_.reader().seek(after, 1);  // and the one before, which shows that none is missing
    else
        stream_.reader().seek(ring::Position::oldest);  // times of several epochs are in no order
    forget();
}

ImuSpan ImuWindow::take(OutputTime after, OutputTime upto, std::uint32_t epoch) {
    const auto precedes = [&](const ImuSample& sample) {
        return sample.data.epoch < epoch || (sample.data.epoch == epoch && sample.time <= after);
    };
    while (!samples_.empty() && precedes(samples_.front())) {
        before_ = std::move(samples_.front());
        samples_.pop_front();
    }
    const bool begun = before_ && before_->data.epoch == epoch;
    const ImuSample* last = begun ? &*before_ : nullptr;
    ImuSpan span;
    bool counted = true;
    bool over = false;
    for (const ImuSample& sample : samples_) {
        over = sample.data.epoch != epoch;
        if (over) break;
        if (last != nullptr && sample.data.number > last->data.number)
            span.lost += sample.data.number - last->data.number - 1;
        else if (last != nullptr)
            counted = false;
        last = &sample;
        if (sample.time > upto) {
            span.beyond = sample;
            break;
        }
        span.samples.push_back(sample);
    }
    if (!begun)
        span.gap = before_ && before_->data.epoch < epoch ? SpanGap::epoch : SpanGap::begin;
    else if (last->time < upto)
        span.gap = over ? SpanGap::epoch : SpanGap::end;
    else
        span.gap = counted ? SpanGap::none : SpanGap::numbers;
    return span;
}

Expected<ImuSpan, NoItem> ImuWindow::between(OutputTime after, OutputTime upto, std::uint32_t epoch,
                                             Duration patience) {
    look_back(after, epoch);
    const HostTime deadline = deadline_after(patience);
    for (;;) {
        if (auto collected = collect(); !collected) return Unexpected<NoItem>(collected.error());
        const Duration left = left_until(deadline);
        if (reaches(upto, epoch) || left == Duration{}) return take(after, upto, epoch);
        stream_.reader().wait(left);
    }
}

}  // namespace versavis
