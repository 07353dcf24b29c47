// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/set_reader.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
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

// Between two looks for a camera that is not there yet. If lower, waiting for it costs more; if
// higher, its first frames are missed.
constexpr Duration retry_period = milliseconds(100);

// Losses of a camera that one look bears, as in ImuWindow.
constexpr int most_losses = 16;

// By how much frames of two instances may differ in host time to be of one grid point: boards that
// share sync pulses, PPS or PTP place them within some microseconds. If lower, the middles of
// exposures that vary do not meet; if higher, frames of boards that share nothing meet by chance.
constexpr Duration together = microseconds(500);

/// Epoch and tick; where instances are several, 0 and host time, since ticks of two boards do not
/// compare.
using Key = std::pair<std::uint32_t, std::uint64_t>;

/// A stream, and which of the reader's instances serves it.
struct Place {
    std::string name;
    std::size_t instance = 0;

    friend bool operator==(const Place& a, const Place& b) {
        return a.name == b.name && a.instance == b.instance;
    }
};

struct Instance {
    std::string name;
    std::optional<std::uint64_t> life;  ///< none: none of its cameras is there yet
    std::optional<Key> finished;        ///< epoch and tick of its frames in the set before
};

struct Pending {
    std::vector<std::optional<Frame>> frames;
    HostTime give_up;
};

Key grid_point(const Frame& frame) { return {frame.data.epoch, frame.data.tick()}; }

bool precedes(const EpochTime& a, const EpochTime& b) { return a.precedes(b); }

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
    std::vector<Instance> instances;
    std::vector<Place> places;                        ///< of the cameras
    std::vector<std::optional<FrameStream>> cameras;  ///< none: not there yet
    HostTime retry;                                   ///< when those are looked for again
    std::optional<ImuWindow> imu;
    std::size_t imu_instance = 0;
    SetOptions options;
    WaitSet waiting;
    WaitSet cameras_waiting;     ///< the IMU's samples wake nobody while no set needs them
    bool by_descriptor = false;  ///< somebody waits for all streams elsewhere
    std::map<Key, Pending> pending;
    std::vector<std::optional<Key>> newest;  ///< of each camera
    std::optional<Key> finished;             ///< of the set before
    std::optional<EpochTime> finished_at;    ///< latest stamp of it, by the instance of the IMU
    std::optional<EpochTime> last;           ///< latest stamp of the set before, likewise
    std::vector<bool> ended;  ///< of each camera: its stream is gone, or was never there
    SetReport report;

    bool joins() const { return instances.size() > 1; }
    Place place(const std::string& name);
    Key key_of(const Frame& frame) const;
    Key after(const Key& key) const;
    std::optional<Duration> distance(const Pending& set, const Frame& frame, std::size_t camera)
        const;
    Pending& set_of(const Frame& frame, std::size_t camera);
    bool has_a_place(const Frame& frame, std::size_t camera) const;
    void begin(std::size_t instance, std::uint64_t life_now);
    StreamOptions options_of(const Place& place) const;
    Expected<> open(std::size_t camera);
    std::optional<NoItem> open_absent();
    std::optional<NoItem> collect();
    std::optional<NoItem> collect(std::size_t camera);
    std::optional<NoItem> restarted(const NoItem& why, std::size_t instance,
                                    std::uint64_t life_now);
    std::optional<NoItem> gone(const NoItem& why, std::size_t camera);
    bool any_ended() const;
    void add(std::size_t camera, Frame frame);
    bool is_late(const Frame& frame, std::size_t camera) const;
    std::optional<EpochTime> end(const Key& key, const Pending& set);
    Duration spread(const Pending& set) const;
    bool decided(const Key& key, const Pending& set) const;
    bool deliverable(const Pending& set) const;
    bool covered(const Pending& set) const;
    void skip_older();
    std::optional<FrameSet> ready();
    FrameSet finish(const Key& key, Pending set);
    ImuSpan samples_until(const EpochTime& latest);
    std::optional<HostTime> next_deadline() const;
};

/// "instance/stream", or a stream of the instance that the options name.
Place SetReader::State::place(const std::string& name) {
    const auto slash = name.rfind('/');
    const bool named = slash != std::string::npos;
    const std::string instance = named ? name.substr(0, slash) : options.instance;
    const auto known = std::find_if(instances.begin(), instances.end(),
                                    [&](const Instance& other) { return other.name == instance; });
    const auto index = static_cast<std::size_t>(known - instances.begin());
    if (known == instances.end()) instances.push_back({instance, {}, {}});
    return {named ? name.substr(slash + 1) : name, index};
}

Key SetReader::State::key_of(const Frame& frame) const {
    if (joins()) return {0, static_cast<std::uint64_t>(frame.data.host_time.ns)};
    return grid_point(frame);
}

/// The last key that is of the same set as this one, or of the same grid point.
Key SetReader::State::after(const Key& key) const {
    return {key.first, key.second + (joins() ? static_cast<std::uint64_t>(together.ns) : 0)};
}

/// The pause to report: a restart once for all streams of an instance.
std::optional<NoItem> SetReader::State::restarted(const NoItem& why, std::size_t instance,
                                                  std::uint64_t life_now) {
    if (why.why != Pause::restarted || life_now == instances[instance].life) return std::nullopt;
    begin(instance, life_now);
    return why;
}

void SetReader::State::begin(std::size_t instance, std::uint64_t life_now) {
    instances[instance].life = life_now;
    instances[instance].finished.reset();
    if (!joins()) finished.reset();  // else by host time, which goes on
    if (instance == imu_instance) {
        finished_at.reset();
        last.reset();
    }
    for (std::size_t camera = 0; camera < cameras.size(); ++camera) {
        if (places[camera].instance != instance) continue;
        newest[camera].reset();
        ended[camera] = !cameras[camera];
        for (auto& [key, set] : pending) set.frames[camera].reset();
    }
    for (auto set = pending.begin(); set != pending.end();) {
        const auto& frames = set->second.frames;
        const bool empty = std::none_of(frames.begin(), frames.end(),
                                        [](const auto& frame) { return frame.has_value(); });
        set = empty ? pending.erase(set) : std::next(set);
    }
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
    if (!cameras[camera]) return std::nullopt;
    for (int losses = 0; losses < most_losses;) {
        auto frame = cameras[camera]->next();
        if (frame) {
            ended[camera] = false;
            add(camera, std::move(*frame));
            continue;
        }
        report.lost += frame.error().lost;
        if (frame.error().why == Pause::lost) ++losses;
        if (frame.error().why == Pause::restarted) ended[camera] = false;
        if (auto pause =
                restarted(frame.error(), places[camera].instance, cameras[camera]->reader().life()))
            return pause;
        if (auto pause = gone(frame.error(), camera)) return pause;
        if (frame.error().why == Pause::nothing || frame.error().why == Pause::gone) break;
    }
    return std::nullopt;
}

StreamOptions SetReader::State::options_of(const Place& place) const {
    StreamOptions made = options;
    made.instance = instances[place.instance].name;
    return made;
}

Expected<> SetReader::State::open(std::size_t camera) {
    const Place& place = places[camera];
    auto stream = FrameStream::open(place.name, options_of(place));
    if (!stream) return Unexpected(stream.error());
    cameras[camera].emplace(std::move(*stream));
    for (WaitSet* set : {&waiting, &cameras_waiting})
        if (auto added = set->add(cameras[camera]->reader()); !added) return added;
    ended[camera] = false;
    auto& life = instances[place.instance].life;
    if (!life) life = cameras[camera]->reader().life();
    return {};
}

/// Those that do not exist yet. Whatever else keeps one from being opened may pass, too. One that
/// appears in another life of the service is a restart that the others have not noticed yet.
std::optional<NoItem> SetReader::State::open_absent() {
    if (!is_over(retry)) return std::nullopt;
    retry = HostTime{INT64_MAX};
    std::optional<NoItem> pause;
    for (std::size_t camera = 0; camera < cameras.size(); ++camera) {
        if (cameras[camera]) continue;
        if (!open(camera))
            retry = host_now() + retry_period;
        else if (!pause)
            pause = restarted({Pause::restarted}, places[camera].instance,
                              cameras[camera]->reader().life());
    }
    return pause;
}

std::optional<NoItem> SetReader::State::collect() {
    if (auto pause = open_absent()) return pause;
    for (std::size_t camera = 0; camera < cameras.size(); ++camera)
        if (auto pause = collect(camera)) return pause;
    if (!imu) return std::nullopt;
    const auto collected = imu->collect();
    return collected ? std::nullopt
                     : restarted(collected.error(), imu_instance, imu->reader().life());
}

void SetReader::State::add(std::size_t camera, Frame frame) {
    const bool suspect = (frame.data.flags & flag_suspect) != 0 && !options.suspect;
    // Of another life: a camera that lags behind a restart, or is ahead of the others.
    if (frame.data.trigger == 0 || suspect || !has_a_place(frame, camera) ||
        is_late(frame, camera)) {
        ++report.left_out;
        return;
    }
    const Key key = key_of(frame);
    newest[camera] = std::max(newest[camera].value_or(key), key);
    set_of(frame, camera).frames[camera] = std::move(frame);
}

/// It is of this life, and where host time counts, of a time that can be.
bool SetReader::State::has_a_place(const Frame& frame, std::size_t camera) const {
    const HostTime at = frame.data.host_time;
    return frame.time.life == instances[places[camera].instance].life &&
           (!joins() || (at.ns > 0 && at <= host_now() + together));
}

/// How far the frame is from those of the set, 0 if it is of their grid point. None: it does not
/// belong there.
std::optional<Duration> SetReader::State::distance(const Pending& set, const Frame& frame,
                                                   std::size_t camera) const {
    if (set.frames[camera]) return std::nullopt;
    Duration furthest;
    for (std::size_t other = 0; other < cameras.size(); ++other) {
        const auto& member = set.frames[other];
        if (!member) continue;
        if (places[other].instance != places[camera].instance) {
            furthest = std::max(furthest, absolute(member->data.host_time - frame.data.host_time));
            continue;
        }
        if (grid_point(*member) != grid_point(frame)) return std::nullopt;
        return Duration{};
    }
    return furthest <= together ? std::optional(furthest) : std::nullopt;
}

Pending& SetReader::State::set_of(const Frame& frame, std::size_t camera) {
    Pending* nearest = nullptr;
    Duration least;
    for (auto& [key, set] : pending) {
        const auto far = distance(set, frame, camera);
        if (!far || (nearest != nullptr && *far >= least)) continue;
        nearest = &set;
        least = *far;
    }
    if (nearest != nullptr) return *nearest;
    Pending& set = pending[key_of(frame)];
    if (set.frames.empty()) {
        set.frames.resize(cameras.size());
        set.give_up = deadline_after(options.patience);
    }
    return set;
}

/// Its set was given up. A camera of another rate counts its ticks apart from the others: a frame
/// that is newer than the set before is not late, whatever its tick.
bool SetReader::State::is_late(const Frame& frame, std::size_t camera) const {
    if (instances[places[camera].instance].finished == grid_point(frame)) return true;
    const Key key = key_of(frame);
    if (!finished || key > after(*finished)) return false;
    return joins() || !finished_at->precedes(frame.time);
}

/// No frame is added to this set any more. Returns its latest stamp by the IMU's instance.
std::optional<EpochTime> SetReader::State::end(const Key& key, const Pending& set) {
    std::optional<EpochTime> latest;
    for (std::size_t camera = 0; camera < cameras.size(); ++camera) {
        const auto& frame = set.frames[camera];
        if (!frame) continue;
        instances[places[camera].instance].finished = grid_point(*frame);
        if (places[camera].instance != imu_instance) continue;
        if (!latest || latest->precedes(frame->time)) latest = frame->time;
    }
    finished = key;
    if (latest) finished_at = latest;
    return latest;
}

/// Stamps of two instances may be by two clocks: there, host time is what compares.
Duration SetReader::State::spread(const Pending& set) const {
    std::vector<EpochTime> times;
    std::vector<HostTime> host;
    for (const auto& frame : set.frames) {
        if (!frame) continue;
        times.push_back(frame->time);
        host.push_back(frame->data.host_time);
    }
    if (joins()) {
        const auto [earliest, latest] = std::minmax_element(host.begin(), host.end());
        return *latest - *earliest;
    }
    const auto [earliest, latest] = std::minmax_element(times.begin(), times.end(), precedes);
    return latest->since(*earliest).value_or(Duration{});
}

/// True when nothing more can come: each camera is there, went past it, or ended; or time is over.
bool SetReader::State::decided(const Key& key, const Pending& set) const {
    if (pending.size() > most_pending || is_over(set.give_up)) return true;
    for (std::size_t camera = 0; camera < cameras.size(); ++camera)
        if (!ended[camera] && !set.frames[camera] &&
            (!newest[camera] || after(*newest[camera]) < key))
            return false;
    return true;
}

bool SetReader::State::deliverable(const Pending& set) const {
    return options.partial || std::all_of(set.frames.begin(), set.frames.end(),
                                          [](const auto& frame) { return frame.has_value(); });
}

/// True when its samples are there, or are not waited for any more.
bool SetReader::State::covered(const Pending& set) const {
    if (!imu || is_over(set.give_up)) return true;
    for (std::size_t camera = 0; camera < cameras.size(); ++camera) {
        const auto& frame = set.frames[camera];
        const bool compares = frame && places[camera].instance == imu_instance;
        if (compares && !imu->reaches(frame->time)) return false;
    }
    return true;
}

FrameSet SetReader::State::finish(const Key& key, Pending set) {
    FrameSet made;
    const auto latest = end(key, set);
    made.spread = spread(set);
    made.frames = std::move(set.frames);
    const auto first = std::find_if(made.frames.begin(), made.frames.end(),
                                    [](const auto& frame) { return frame.has_value(); });
    made.tick = (*first)->data.tick();
    made.time = (*first)->time;
    if (imu && latest) made.imu = samples_until(*latest);
    if (latest) last = latest;
    ++report.sets;
    return made;
}

ImuSpan SetReader::State::samples_until(const EpochTime& latest) {
    EpochTime after = last.value_or(latest);
    if (!after.compares_with(latest))
        after = {latest.life, std::numeric_limits<std::int64_t>::min(), latest.epoch};
    ImuSpan span = imu->take(after, latest);
    if (!last) span.gap = SpanGap::begin;  // no set before says from where on they count
    return span;
}

std::optional<FrameSet> SetReader::State::ready() {
    while (!pending.empty()) {
        const auto first = pending.begin();
        const Pending& set = first->second;
        if (!decided(first->first, set)) return std::nullopt;
        if (!deliverable(set)) {
            ++report.incomplete;
            end(first->first, set);
            pending.erase(first);
            continue;
        }
        if (!covered(set)) return std::nullopt;
        auto node = pending.extract(first);
        FrameSet made = finish(node.key(), std::move(node.mapped()));
        if (!made.complete()) ++report.incomplete;
        return made;
    }
    return std::nullopt;
}

/// Forgets what comes before the newest set that can be delivered.
void SetReader::State::skip_older() {
    const auto newest_set = std::find_if(pending.rbegin(), pending.rend(), [&](const auto& set) {
        return decided(set.first, set.second) && deliverable(set.second) && covered(set.second);
    });
    while (newest_set != pending.rend() && pending.begin()->first < newest_set->first) {
        const auto first = pending.begin();
        ++(deliverable(first->second) ? report.skipped : report.incomplete);
        end(first->first, first->second);
        pending.erase(first);
    }
}

std::optional<HostTime> SetReader::State::next_deadline() const {
    std::optional<HostTime> earliest;
    for (const auto& [key, set] : pending)
        earliest = std::min(set.give_up, earliest.value_or(set.give_up));
    if (retry != HostTime{INT64_MAX}) earliest = std::min(retry, earliest.value_or(retry));
    return earliest;
}

Expected<SetReader> SetReader::open(const std::vector<std::string>& cameras,
                                    const SetOptions& options) {
    if (cameras.empty())
        return failure(ErrorCode::invalid, "a set of frames", "needs the names of cameras");
    auto state = std::make_unique<State>();
    state->options = options;
    for (const std::string& name : cameras) {
        const Place place = state->place(name);
        auto& places = state->places;
        if (std::find(places.begin(), places.end(), place) != places.end())
            return failure(ErrorCode::invalid, "a set of frames", "names a camera twice",
                           "name each once");
        places.push_back(place);
    }
    const std::size_t known = state->instances.size();
    const Place imu_place = options.imu.empty() ? Place{} : state->place(options.imu);
    if (state->instances.size() != known)
        return failure(ErrorCode::invalid, options.imu, "is of an instance without a camera here",
                       "name an IMU of an instance that has one of the cameras");
    state->imu_instance = imu_place.instance;
    state->cameras.resize(cameras.size());
    state->newest.resize(cameras.size());
    state->ended.resize(cameras.size(), true);
    state->retry = HostTime{INT64_MAX};
    const HostTime deadline = deadline_after(options.wait);
    for (std::size_t camera = 0; camera < cameras.size(); ++camera) {
        // With partial sets, none is waited for: those that are not there are taken in later.
        state->options.wait = options.partial ? Duration{} : left_until(deadline);
        const auto opened = state->open(camera);
        if (opened) continue;
        if (!options.partial || opened.error().code != ErrorCode::absent)
            return Unexpected(opened.error());
        state->retry = host_now() + retry_period;
    }
    state->options.wait = left_until(deadline);
    if (!options.imu.empty()) {
        auto imu = ImuWindow::open(imu_place.name, state->options_of(imu_place));
        if (!imu) return Unexpected(imu.error());
        state->imu.emplace(std::move(*imu));
    }
    state->options.wait = {};  // from here on, next() waits
    if (state->imu)
        if (auto added = state->waiting.add(state->imu->reader()); !added)
            return Unexpected(added.error());
    return SetReader(std::move(state));
}

SetReader::SetReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
SetReader::SetReader(SetReader&&) noexcept = default;
SetReader& SetReader::operator=(SetReader&&) noexcept = default;
SetReader::~SetReader() = default;

Expected<FrameSet, NoItem> SetReader::next(Duration timeout) { return take(timeout, false); }

Expected<FrameSet, NoItem> SetReader::latest(Duration timeout) { return take(timeout, true); }

Expected<FrameSet, NoItem> SetReader::take(Duration timeout, bool newest) {
    const HostTime deadline = deadline_after(timeout);
    for (bool is_last = false;;) {
        if (const auto pause = state_->collect()) return Unexpected<NoItem>(*pause);
        if (newest) state_->skip_older();
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
