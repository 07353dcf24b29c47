// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/ring_reader.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <numeric>
#include <thread>
#include <utility>

#include "client/clock_ns.hpp"
#include "client/deadline.hpp"
#include "client/error_code.hpp"
#include "client/futex.hpp"
#include "client/process.hpp"
#include "client/sealed.hpp"
#include "client/segment.hpp"
#include "client/trust.hpp"
#include "client/watch.hpp"
#include "versavis/metadata.hpp"

namespace versavis::ring {

namespace {

// How often a reader checks whether the writer is alive. If lower, a polling reader spends more on
// it; if higher, it notices a death later.
constexpr std::int64_t look_period_ns = 10'000'000;

// Before a successor that could not be opened is tried again. If lower, one that never can be costs
// more; if higher, a reader that had no descriptor left is blind for longer.
constexpr Duration retry_period = seconds(1);

/// A few ns to read, and some ms coarse.
std::int64_t coarse_now_ns() { return clock_ns(CLOCK_MONOTONIC_COARSE); }

/// True when some of the file's pages are not there.
bool has_holes(int file) {
    struct stat status {};
    if (::fstat(file, &status) != 0) return false;
    const off_t hole = ::lseek(file, 0, SEEK_HOLE);
    return hole >= 0 && hole < status.st_size;
}

Expected<std::shared_ptr<const Mapping>> map(const std::filesystem::path& path,
                                             const Options& options) {
    auto file = open_trusted(path, options.owner);
    if (!file) return Unexpected(file.error());
    if (options.sealed_only && !is_sealed(file->file.get()))
        return failure(ErrorCode::not_trusted, path.string(), "is not sealed",
                       "set 'sealed = true' in [memory] of the service's configuration");
    auto mapping = Mapping::open(*file, path, Mapping::Access::read_only);
    if (!mapping) return Unexpected(mapping.error());
    // To read what a dead writer left needs no haste, and may take no memory: in a ring with holes,
    // which older services made to get memory back, each page that is read would.
    Pulse pulse;
    if (writer_lives(*mapping, pulse)) {
        if (auto populated = mapping->populate(path); !populated)
            return Unexpected(populated.error());
    } else if (has_holes(file->file.get())) {
        return failure(ErrorCode::absent, path.string(),
                       "its service died and its memory was taken back",
                       "wait for the service to start");
    }
    return std::make_shared<const Mapping>(std::move(*mapping));
}

// Between two looks for a stream that is not there yet. If lower, waiting for a service costs more;
// if higher, the first items are missed.
constexpr Duration open_period = milliseconds(20);

std::uint32_t epoch_of(StreamKind kind, const Metadata& metadata) {
    switch (kind) {
        case StreamKind::frames: return unpack<FrameMetadata>(metadata).epoch;
        case StreamKind::imu: return unpack<ImuMetadata>(metadata).epoch;
        case StreamKind::events: return unpack<EventMetadata>(metadata).epoch;
        case StreamKind::nmea: return unpack<NmeaMetadata>(metadata).epoch;
        default: return no_epoch;
    }
}

bool has_epochs(StreamKind kind) {
    return kind == StreamKind::frames || kind == StreamKind::imu || kind == StreamKind::events ||
           kind == StreamKind::nmea;
}

Unexpected<NoItem> pause(Pause why, std::uint64_t lost = 0) {
    return Unexpected<NoItem>(NoItem{why, lost});
}

/// How far a descriptor of this sequence is ahead of the complete item; 0: it holds it.
std::int64_t ahead_of(std::uint64_t number, std::uint64_t sequence) {
    return static_cast<std::int64_t>(sequence - (2 * number + 2));
}

bool is(const Received& received, Pause why) { return !received && received.error().why == why; }

/// Nothing to return at once, unless it is the first time.
bool is_quiet(const Received& received) {
    return is(received, Pause::nothing) || is(received, Pause::gone);
}

}  // namespace

std::string NoItem::message() const {
    switch (why) {
        case Pause::nothing: return "nothing new in the time given";
        case Pause::lost:
            return std::to_string(lost) + " items were overwritten before they were read";
        case Pause::restarted: return "the service was restarted";
        case Pause::gone: return "the service is gone; waiting for it";
    }
    return "unknown";
}

/// What a reader remembers of its writer.
struct Reader::Contact {
    Pulse pulse;
    std::int64_t looked_ns{};  ///< coarse clock
    bool alive{};
    bool reported_gone = false;    ///< by the last look
    std::uint64_t read = 0;        ///< number behind that of the item that was handed out last
    std::unique_ptr<Watch> watch;  ///< once fd() was called

    void refuse(FileId successor) {
        refused_ = successor;
        retry_ = host_now() + retry_period;
    }
    /// When the file of this name that could not be followed is tried again; none: there is none.
    std::optional<HostTime> retry() const {
        const bool waits = refused_ != FileId{} && left_until(retry_) != Duration{};
        return waits ? std::optional(retry_) : std::nullopt;
    }
    FileId refused() const { return retry() ? refused_ : FileId{}; }

 private:
    FileId refused_{};
    HostTime retry_;
};

Expected<Reader> Reader::open(const std::filesystem::path& path, const Options& options) {
    const HostTime deadline = deadline_after(options.wait);
    auto mapping = map(path, options);
    while (!mapping && mapping.error().code == ErrorCode::absent && !is_over(deadline)) {
        std::this_thread::sleep_for(std::chrono::nanoseconds(open_period.ns));
        mapping = map(path, options);
    }
    if (!mapping) return Unexpected(mapping.error());
    Reader reader(path, options, std::move(*mapping));
    reader.seek(options.start);
    reader.writer_alive();
    return reader;
}

Reader::Reader(std::filesystem::path path, const Options& options,
               std::shared_ptr<const Mapping> mapping)
    : path_(std::move(path)),
      options_(options),
      mapping_(std::move(mapping)),
      contact_(std::make_unique<Contact>()) {}
Reader::Reader(Reader&&) noexcept = default;
Reader& Reader::operator=(Reader&&) noexcept = default;
Reader::~Reader() = default;

StreamKind Reader::kind() const { return mapping_->constants().kind; }
const char* Reader::name() const { return mapping_->constants().name.data(); }
std::uint64_t Reader::life() const { return mapping_->constants().life; }
std::uint32_t Reader::writer_pid() const { return mapping_->constants().writer_pid; }

std::uint64_t Reader::head() const {
    // SYNC 1: acquire here, release in Writer::write_descriptor(): all items below `head` are
    // complete in memory, for readers that begin by it.
    return mapping_->header().head.load(std::memory_order_acquire);
}

std::uint64_t Reader::retained() const {
    const Constants& constants = mapping_->constants();
    return constants.slot_count == 0 ? constants.descriptor_count
                                     : std::min(constants.slot_count, constants.descriptor_count);
}

HostTime Reader::last_heartbeat() const {
    return {mapping_->header().heartbeat_ns.load(std::memory_order_relaxed)};
}

bool Reader::writer_alive() {
    contact_->looked_ns = coarse_now_ns();
    contact_->alive = writer_lives(*mapping_, contact_->pulse);
    return contact_->alive;
}

/// As last seen; checked again when that is some time ago, or it was dead.
bool Reader::writer_seen() {
    const auto live = static_cast<std::uint32_t>(WriterState::live);
    const bool ended = mapping_->header().state.load(std::memory_order_relaxed) != live;
    const bool due = coarse_now_ns() - contact_->looked_ns >= look_period_ns;
    return ended || due ? writer_alive() : contact_->alive;
}

Reader::Look Reader::read(std::uint64_t number, Item& item) const {
    const Descriptor& descriptor = mapping_->descriptor(number);
    // The item's second cache line comes along with the first, not after it.
    __builtin_prefetch(&descriptor.metadata.back());
    // SYNC 2: acquire here, release in Writer::write_descriptor(): the descriptor's words, the
    // payload and the slot's generation are at least as new as this item. Otherwise the words of
    // the previous item in this place could pass for this one's.
    const auto ahead = ahead_of(number, descriptor.sequence.load(std::memory_order_acquire));
    if (ahead < 0) return Look::not_yet;
    if (ahead != 0) return Look::overwritten;
    const std::uint64_t generation = descriptor.slot_generation.load(std::memory_order_relaxed);
    const std::uint64_t length_and_slot =
        descriptor.length_and_slot.load(std::memory_order_relaxed);
    const std::int64_t time_ns = descriptor.output_time_ns.load(std::memory_order_relaxed);
    std::transform(descriptor.metadata.begin(), descriptor.metadata.end(), item.metadata.begin(),
                   [](const auto& word) { return word.load(std::memory_order_relaxed); });
    // SYNC 3: acquire fence here, release fence in Writer::write_descriptor(): if any word above
    // came from the next item, the sequence below is no longer this item's. Without it a mixture of
    // two descriptors would pass.
    std::atomic_thread_fence(std::memory_order_acquire);
    if (ahead_of(number, descriptor.sequence.load(std::memory_order_relaxed)) != 0)
        return Look::overwritten;

    const Constants& constants = mapping_->constants();
    item.number = number;
    item.time = {constants.life, time_ns, epoch_of(constants.kind, item.metadata)};
    const auto slot = static_cast<std::uint32_t>(length_and_slot);
    if (slot == no_slot) return Look::ready;
    const auto size = static_cast<std::uint32_t>(length_and_slot >> 32U);
    if (slot >= constants.slot_count || size > constants.slot_size) return Look::overwritten;
    item.payload = Payload(mapping_, slot, generation, size);
    return item.payload.valid() ? Look::ready : Look::overwritten;
}

bool Reader::readable(std::uint64_t number) const {
    Item item;
    return read(number, item) == Look::ready;
}

/// Items are lost in the order in which they came, but for a few whose slots were given back.
std::uint64_t Reader::oldest() const {
    const std::uint64_t end = head();
    std::uint64_t lost = end - std::min(end, retained());
    std::uint64_t there = end;
    while (lost < there) {
        const std::uint64_t middle = std::midpoint(lost, there);
        if (readable(middle))
            there = middle;
        else
            lost = middle + 1;
    }
    return there;
}

std::uint64_t Reader::place(Position position) const {
    const std::uint64_t end = head();
    if (position == Position::next) return end;
    if (position == Position::latest) return end - std::min<std::uint64_t>(end, 1);
    const std::uint64_t there = end - std::min(end, oldest());
    const bool full = there < end;  // the oldest is about to be overwritten
    if (position == Position::oldest) return end - (there - (full ? there / 8 : 0));
    return end - std::min(retained() / 2, there - (full ? there / 4 : 0));
}

void Reader::seek(Position position) { next_ = place(position); }

bool Reader::seek(const EpochTime& time, std::uint64_t earlier) {
    if (time.life != life() || time.epoch == no_epoch || !has_epochs(kind())) return false;
    const std::uint64_t first = oldest();
    next_ = head();
    for (Item item; next_ > first; --next_)
        if (read(next_ - 1, item) != Look::ready || item.time.precedes(time)) break;
    next_ = std::max(std::min(first, next_), next_ - std::min(next_, earlier));
    return true;
}

Received Reader::lapped() {
    const std::uint64_t to = std::max(next_ + 1, place(options_.after_loss));
    const std::uint64_t lost = to - next_;
    next_ = to;
    return pause(Pause::lost, lost);
}

Received Reader::take() {
    Item item;
    switch (read(next_, item)) {
        case Look::not_yet: return pause(Pause::nothing);
        case Look::overwritten: return lapped();
        case Look::ready: break;
    }
    contact_->read = ++next_;
    item.stale = !writer_seen();
    return item;
}

Received Reader::look() {
    auto received = take();
    if (is(received, Pause::nothing) && !writer_seen()) {
        received = take();  // published since the last look
        if (is(received, Pause::nothing)) received = hand_over();
    }
    contact_->reported_gone = is(received, Pause::gone);
    return received;
}

bool Reader::not_there() const {
    const auto& sequence = mapping_->descriptor(next_).sequence;
    return ahead_of(next_, sequence.load(std::memory_order_acquire)) < 0;
}

/// Of a segment that has lost its name: whoever took it away may need the memory, and gets it when
/// nobody has it mapped. Items that are held keep it mapped.
void Reader::let_go() {
    const FileId known = mapping_->name();
    if (known == FileId{}) return;  // it has let go
    const FileId now = file_id(path_);
    if (now == known || (now == FileId{} && errno != ENOENT)) return;
    // A writer considered dead may have published once more before the name was taken.
    if (!not_there()) return;
    if (auto left = mapping_->remains())
        mapping_ = std::make_shared<const Mapping>(std::move(*left));
}

Received Reader::gone() {
    let_go();
    return pause(Pause::gone);
}

Received Reader::hand_over() {
    if (!has_successor(path_, mapping_->name(), contact_->refused())) return gone();
    contact_->refuse(file_id(path_));
    auto successor = map(path_, options_);
    if (!successor) return gone();
    const Constants& now = (*successor)->constants();
    const Constants& before = mapping_->constants();
    // Of another kind it is another stream: its items would be read as what they are not.
    if (now.generation == before.generation || now.kind != before.kind) return gone();
    // A writer considered dead may have published once more before it was replaced.
    auto last = take();
    if (!is(last, Pause::nothing)) return last;
    mapping_ = std::move(*successor);
    next_ = 0;
    Contact anew;
    anew.watch = std::move(contact_->watch);
    *contact_ = std::move(anew);
    return pause(Pause::restarted);
}

std::optional<HostTime> Reader::retry() const { return contact_->retry(); }

Received Reader::next() {
    auto received = look();
    return contact_->watch && is_quiet(received) ? settle() : received;
}

/// Nothing is there: the descriptor is made to wait for what comes from here on.
Received Reader::settle() {
    contact_->watch->calm();
    const std::uint32_t seen = wake_word().value;
    auto received = look();
    if (is_quiet(received))
        contact_->watch->arm({target(seen)}, retry());
    else
        contact_->watch->signal();
    return received;
}

/// Where to sleep, before a look for items. One that sleeps for a successor lets go of what is left
/// of its writer first.
FutexWord Reader::wake_word() {
    if (contact_->reported_gone) let_go();
    const auto& wake = mapping_->header().wake;
    // SYNC 5: acquire here, release in Writer::write_descriptor() and wake_readers(): whatever
    // moved `wake` to the value seen is visible to the look that follows; whatever comes later
    // changes it, and the kernel does not go to sleep. Without it a reader could sleep over an
    // item.
    return {&wake, wake.load(std::memory_order_acquire)};
}

WatchTarget Reader::target(std::uint32_t seen) const {
    return {mapping_, path_, seen, contact_->reported_gone, contact_->refused(), contact_->pulse};
}

/// True when next() has something new to return.
bool Reader::ready() {
    if (!not_there()) return true;
    if (writer_seen()) return false;
    if (!contact_->reported_gone || !not_there()) return true;
    return has_successor(path_, mapping_->name(), contact_->refused());
}

Expected<int> Reader::fd() {
    if (!contact_->watch) {
        auto watch = Watch::start();
        if (!watch) return Unexpected(watch.error());
        contact_->watch = std::move(*watch);
    }
    return contact_->watch->fd();
}

Received Reader::next(Duration timeout) {
    const HostTime deadline = deadline_after(timeout);
    for (;;) {
        const FutexWord word = wake_word();
        const auto mapping = mapping_;  // a successor may take its place
        const bool reported = contact_->reported_gone;
        auto received = next();
        const bool ends = contact_->reported_gone && !reported;
        if (!is_quiet(received) || ends) return received;
        const Duration left = left_until(deadline);
        if (left == Duration{}) return received;
        futex_wait(*word.word, word.value, std::min(left.ns, longest_sleep_ns));
    }
}

void Reader::wait(Duration timeout) {
    const HostTime deadline = deadline_after(timeout);
    for (;;) {
        const FutexWord word = wake_word();
        const Duration left = left_until(deadline);
        if (ready() || left == Duration{}) return;
        futex_wait(*word.word, word.value, std::min(left.ns, longest_sleep_ns));
    }
}

Received Reader::latest(Duration timeout) {
    for (;;) {
        const std::uint64_t end = head();
        if (end > contact_->read) next_ = end - 1;
        auto received = next(timeout);
        if (received || received.error().why != Pause::lost || head() == end) return received;
    }
}

}  // namespace versavis::ring
