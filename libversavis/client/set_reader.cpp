// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/set_reader.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "client/deadline.hpp"
#include "versavis/wait_set.hpp"

namespace versavis {

namespace {

// Sets that may wait for frames: 6 s at 20 Hz, with one camera far behind. More cost little, but
// most of their items are overwritten anyway.
constexpr std::size_t most_pending = 128;

// Between two looks at the IMU at most, whether or not a set waits for its samples. If lower, a
// reader whose cameras are slow wakes up more often; if higher, a ring of less than 0.2 s of
// samples is overtaken.
constexpr Duration unwatched = milliseconds(100);

// Losses of a camera that one look bears, as in ImuWindow.
constexpr int most_losses = 16;

using Key = std::pair<std::uint32_t, std::uint64_t>;  ///< epoch and tick

struct Pending {
    std::vector<std::optional<Frame>> frames;
    HostTime give_up;
};

/// Stamps may be anything.
Duration spread_of(OutputTime earliest, OutputTime latest) {
    std::int64_t ns = 0;
    const bool too_large = __builtin_sub_overflow(latest.ns, earliest.ns, &ns);
    return {too_large ? std::numeric_limits<std::int64_t>::max() : ns};
}

}  // namespace

bool FrameSet::complete() const {
    return std::all_of(frames.begin(), frames.end(), [](const auto& frame) { return !!frame; });
}

bool FrameSet::valid() const {
    return std::all_of(frames.begin(), frames.end(),
                       [](const auto& frame) { return !frame || frame->valid(); });
}

/// Not part of the interface, as its class is.
struct [[gnu::visibility("hidden")]] SetReader::State {
    std::vector<FrameStream> cameras;
    std::optional<ImuWindow> imu;
    SetOptions options;
    WaitSet waiting;
    WaitSet cameras_waiting;     ///< the IMU's samples wake nobody while no set needs them
    bool by_descriptor = false;  ///< somebody waits for all streams elsewhere
    std::map<Key, Pending> pending;
    std::vector<std::optional<Key>> newest;  ///< of each camera
    std::optional<Key> finished;             ///< of the set before
    std::optional<OutputTime> last;          ///< latest stamp of the set before, and its epoch
    std::uint32_t last_epoch = 0;
    std::uint64_t life{};
    std::vector<bool> ended;  ///< of each camera: its stream is gone
    SetReport report;

    std::optional<NoItem> collect();
    std::optional<NoItem> collect(std::size_t camera);
    std::optional<NoItem> restarted(const NoItem& why, std::uint64_t life_now);
    std::optional<NoItem> gone(const NoItem& why, std::size_t camera);
    bool any_ended() const;
    void add(std::size_t camera, Frame frame);
    bool decided(const Key& key, const Pending& set) const;
    std::optional<FrameSet> ready();
    FrameSet finish(const Key& key, Pending set);
    ImuSpan samples_until(OutputTime latest, std::uint32_t epoch);
    std::optional<HostTime> next_deadline() const;
};

/// The pause to report: a restart once for all streams.
std::optional<NoItem> SetReader::State::restarted(const NoItem& why, std::uint64_t life_now) {
    if (why.why != Pause::restarted || life_now == life) return std::nullopt;
    life = life_now;
    pending.clear();
    newest.assign(cameras.size(), std::nullopt);
    finished.reset();
    last.reset();
    ended.assign(cameras.size(), false);
    return why;
}

/// The pause to report: the end of the first camera that ends, until one of them continues.
std::optional<NoItem> SetReader::State::gone(const NoItem& why, std::size_t camera) {
    if (why.why != Pause::gone) return std::nullopt;
    const bool is_first = !any_ended();
    ended[camera] = true;
    return is_first ? std::optional(why) : std::nullopt;
}

bool SetReader::State::any_ended() const {
    return std::find(ended.begin(), ended.end(), true) != ended.end();
}

std::optional<NoItem> SetReader::State::collect(std::size_t camera) {
    for (int losses = 0; losses < most_losses;) {
        auto frame = cameras[camera].next();
        if (frame) {
            ended[camera] = false;
            add(camera, std::move(*frame));
            continue;
        }
        report.lost += frame.error().lost;
        if (frame.error().why == Pause::lost) ++losses;
        if (auto pause = restarted(frame.error(), cameras[camera].reader().life())) return pause;
        if (auto pause = gone(frame.error(), camera)) return pause;
        if (frame.error().why == Pause::nothing || frame.error().why == Pause::gone) break;
    }
    return std::nullopt;
}

std::optional<NoItem> SetReader::State::collect() {
    for (std::size_t camera = 0; camera < cameras.size(); ++camera)
        if (auto pause = collect(camera)) return pause;
    if (!imu) return std::nullopt;
    const auto collected = imu->collect();
    return collected ? std::nullopt : restarted(collected.error(), imu->reader().life());
}

void SetReader::State::add(std::size_t camera, Frame frame) {
    const bool suspect = (frame.data.flags & flag_suspect) != 0 && !options.suspect;
    // Of another life: a camera that lags behind a restart, or is ahead of the others.
    if (frame.data.trigger == 0 || suspect || frame.life != life) {
        ++report.left_out;
        return;
    }
    const Key key{frame.data.epoch, frame.data.tick()};
    if (finished && key <= *finished) {  // its set was given up
        ++report.left_out;
        return;
    }
    newest[camera] = std::max(newest[camera].value_or(key), key);
    Pending& set = pending[key];
    if (set.frames.empty()) {
        set.frames.resize(cameras.size());
        set.give_up = deadline_after(options.patience);
    }
    set.frames[camera] = std::move(frame);
}

/// True when nothing more can come: each camera is there, or went past it, or time is over.
bool SetReader::State::decided(const Key& key, const Pending& set) const {
    return pending.size() > most_pending || is_over(set.give_up) ||
           std::all_of(newest.begin(), newest.end(), [&](const auto& seen) { return seen >= key; });
}

FrameSet SetReader::State::finish(const Key& key, Pending set) {
    FrameSet made;
    made.life = life;
    made.epoch = key.first;
    made.tick = key.second;
    made.frames = std::move(set.frames);
    std::vector<OutputTime> times;
    for (const auto& frame : made.frames)
        if (frame) times.push_back(frame->time);
    const auto [earliest, latest] = std::minmax_element(times.begin(), times.end());
    made.time = times.front();
    made.spread = spread_of(*earliest, *latest);
    finished = key;
    if (imu) made.imu = samples_until(*latest, made.epoch);
    last = *latest;
    last_epoch = made.epoch;
    ++report.sets;
    return made;
}

ImuSpan SetReader::State::samples_until(OutputTime latest, std::uint32_t epoch) {
    constexpr OutputTime before_all{std::numeric_limits<std::int64_t>::min()};
    ImuSpan span = imu->take(last && last_epoch == epoch ? *last
                             : last                      ? before_all
                                                         : latest,
                             latest, epoch);
    if (!last) span.gap = SpanGap::begin;  // no set before says from where on they count
    return span;
}

std::optional<FrameSet> SetReader::State::ready() {
    while (!pending.empty()) {
        const auto first = pending.begin();
        const auto& frames = first->second.frames;
        if (!decided(first->first, first->second)) return std::nullopt;
        const bool whole = std::all_of(frames.begin(), frames.end(), [](auto& f) { return !!f; });
        if (!whole && !options.partial) {
            ++report.incomplete;
            finished = first->first;
            pending.erase(first);
            continue;
        }
        OutputTime latest{INT64_MIN};
        for (const auto& frame : frames)
            if (frame) latest = std::max(latest, frame->time, std::less<>());
        if (imu && !imu->reaches(latest, first->first.first) && !is_over(first->second.give_up))
            return std::nullopt;
        if (!whole) ++report.incomplete;
        auto node = pending.extract(first);
        return finish(node.key(), std::move(node.mapped()));
    }
    return std::nullopt;
}

std::optional<HostTime> SetReader::State::next_deadline() const {
    std::optional<HostTime> earliest;
    for (const auto& [key, set] : pending)
        earliest = std::min(set.give_up, earliest.value_or(set.give_up));
    return earliest;
}

Expected<SetReader> SetReader::open(const std::vector<std::string>& cameras,
                                    const SetOptions& options) {
    if (cameras.empty()) return failure("a set of frames", "needs the names of cameras");
    if (std::set<std::string>(cameras.begin(), cameras.end()).size() != cameras.size())
        return failure("a set of frames", "names a camera twice", "name each once");
    auto state = std::make_unique<State>();
    state->options = options;
    for (const std::string& name : cameras) {
        auto stream = FrameStream::open(name, options);
        if (!stream) return Unexpected(stream.error());
        state->cameras.push_back(std::move(*stream));
    }
    if (!options.imu.empty()) {
        auto imu = ImuWindow::open(options.imu, options);
        if (!imu) return Unexpected(imu.error());
        state->imu.emplace(std::move(*imu));
    }
    for (FrameStream& camera : state->cameras)
        for (WaitSet* waiting : {&state->waiting, &state->cameras_waiting})
            if (auto added = waiting->add(camera.reader()); !added)
                return Unexpected(added.error());
    if (state->imu)
        if (auto added = state->waiting.add(state->imu->reader()); !added)
            return Unexpected(added.error());
    state->newest.resize(cameras.size());
    state->ended.resize(cameras.size());
    state->life = state->cameras.front().reader().life();
    return SetReader(std::move(state));
}

SetReader::SetReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
SetReader::SetReader(SetReader&&) noexcept = default;
SetReader& SetReader::operator=(SetReader&&) noexcept = default;
SetReader::~SetReader() = default;

Expected<FrameSet, NoItem> SetReader::next(Duration timeout) {
    const HostTime deadline = deadline_after(timeout);
    for (bool is_last = false;;) {
        if (const auto pause = state_->collect()) return Unexpected<NoItem>(*pause);
        if (auto set = state_->ready()) return std::move(*set);
        const auto give_up = state_->next_deadline();
        state_->waiting.set_deadline(give_up);
        const HostTime now = host_now();
        const bool idle = state_->pending.empty() && !state_->by_descriptor;
        const HostTime until = std::min({deadline, give_up.value_or(deadline), now + unwatched});
        WaitSet& waiting = idle ? state_->cameras_waiting : state_->waiting;
        const bool found = waiting.wait(until - now).has_value();
        const bool over = is_over(deadline);
        const bool due = give_up && is_over(*give_up);
        // What is found when time is over is looked at once more, and no longer: streams may go on.
        if (over && !due && (!found || is_last))
            return Unexpected<NoItem>(NoItem{state_->any_ended() ? Pause::gone : Pause::nothing});
        is_last = over;
    }
}

Expected<int> SetReader::fd() {
    state_->by_descriptor = true;
    return state_->waiting.fd();
}

const SetReport& SetReader::report() const { return state_->report; }

}  // namespace versavis
