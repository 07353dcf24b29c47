// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/ring/reader.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "client/segment.hpp"

namespace versavis::ring {

namespace {

// A process with a read-only mapping can still move waiters to another futex word: no wait may be
// unbounded.
constexpr std::int64_t longest_wait_ns = 20'000'000;
constexpr std::int64_t heartbeat_limit_ns = 3'000'000'000;

/// Copies a payload that the writer may be overwriting. The writer fills slots with plain stores
/// (memcpy, or a camera's driver), so to the language such a copy is a data race even with the
/// atomic loads here. It does no harm in practice: the loads are whole words that the compiler
/// neither repeats nor leaves out, racing loads do not trap, and no word is interpreted while it is
/// copied. The copy may still mix two items: only intact() afterwards (SYNC 4) decides whether it
/// is good.
void copy_words(const std::byte* source, std::byte* destination, std::size_t size) {
    const auto* words =
        reinterpret_cast<const std::atomic<std::uint64_t>*>(source);  // slots are page-aligned
    std::size_t i = 0;
    for (; i + 8 <= size; i += 8) {
        const std::uint64_t word = words[i / 8].load(std::memory_order_relaxed);
        std::memcpy(destination + i, &word, 8);
    }
    if (i < size) {
        const std::uint64_t word = words[i / 8].load(std::memory_order_relaxed);
        std::memcpy(destination + i, &word, size - i);
    }
}

/// Tells a segment from its successor of the same name, without mapping it.
using FileId = std::pair<dev_t, ino_t>;

FileId file_id(const std::filesystem::path& path) {
    struct stat file {};
    return ::stat(path.c_str(), &file) == 0 ? FileId{file.st_dev, file.st_ino} : FileId{};
}

Expected<> check_owner(const std::filesystem::path& path) {
    struct stat file {};
    struct stat directory {};
    const auto parent = path.parent_path();
    if (::stat(path.c_str(), &file) != 0 || ::stat(parent.c_str(), &directory) != 0)
        return failure(path.string(), errno == EACCES ? "permission denied" : "no such stream",
                       errno == EACCES
                           ? "join the group that may read streams (usually 'versavis')"
                           : "is the service running? 'versavis list' shows the streams");
    if (file.st_uid != directory.st_uid || (directory.st_mode & S_IWOTH) != 0)
        return failure(path.string(), "does not belong to the owner of its directory",
                       "somebody else may have put it there: remove it");
    return {};
}

}  // namespace

struct Reader::Segment {
    Mapping mapping;
    FileId file;
};

Expected<std::unique_ptr<Reader::Segment>> Reader::map(const std::filesystem::path& path) {
    if (auto owner = check_owner(path); !owner) return Unexpected(owner.error());
    const FileId file = file_id(path);  // before mapping: a successor made in between is noticed
    auto mapping = Mapping::open(path, Mapping::Access::read_only);
    if (!mapping) return Unexpected(mapping.error());
    return std::make_unique<Segment>(Segment{std::move(*mapping), file});
}

Expected<Reader> Reader::open(const std::filesystem::path& path, From from) {
    auto segment = map(path);
    if (!segment) return Unexpected(segment.error());
    Reader reader(path, std::move(*segment));
    const std::uint64_t head = reader.head();
    reader.next_ = from == From::newest ? head : head - std::min(head, reader.retained() / 2);
    return reader;
}

Reader::Reader(std::filesystem::path path, std::unique_ptr<Segment> segment)
    : path_(std::move(path)), segment_(std::move(segment)) {}
Reader::Reader(Reader&&) noexcept = default;
Reader& Reader::operator=(Reader&&) noexcept = default;
Reader::~Reader() = default;

StreamKind Reader::kind() const { return segment_->mapping.constants().kind; }
const char* Reader::name() const { return segment_->mapping.constants().name.data(); }
std::uint64_t Reader::head() const {
    // SYNC 1: acquire here, release in Writer::write_descriptor(): all items below `head` are
    // complete in memory. Without it a new head could show an old descriptor, and an item that has
    // just been published would be taken for lost.
    return segment_->mapping.header().head.load(std::memory_order_acquire);
}
std::uint32_t Reader::writer_pid() const { return segment_->mapping.constants().writer_pid; }

bool Reader::writer_found() const {
    const Constants& constants = segment_->mapping.constants();
    return start_ticks_of(constants.writer_pid) == constants.writer_start_ticks;
}

std::uint64_t Reader::retained() const {
    const Constants& constants = segment_->mapping.constants();
    return constants.slot_count == 0 ? constants.descriptor_count
                                     : std::min(constants.slot_count, constants.descriptor_count);
}

HostTime Reader::last_heartbeat() const {
    return {segment_->mapping.header().heartbeat_ns.load(std::memory_order_relaxed)};
}

bool Reader::writer_alive() const {
    // SYNC 6: acquire here, release in retire(): whoever sees the segment closed also sees its
    // last item when it looks at `head` again. Without it that item could go unread.
    const auto state = segment_->mapping.header().state.load(std::memory_order_acquire);
    return state == static_cast<std::uint32_t>(WriterState::live) &&
           last_heartbeat().ns > host_now().ns - heartbeat_limit_ns;  // of a liar it may be any
}

Item Reader::read_descriptor(std::uint64_t number) const {
    const Descriptor& descriptor = segment_->mapping.descriptor(number);
    Item item;
    item.number = number;
    const std::uint64_t complete = 2 * number + 2;
    // SYNC 2: acquire here, release in Writer::write_descriptor(): the descriptor's words, the
    // payload and the slot's generation are at least as new as this item. Without it the words of
    // the item that lay here before could be taken for this one's.
    if (descriptor.sequence.load(std::memory_order_acquire) != complete) return item;
    item.slot_generation = descriptor.slot_generation.load(std::memory_order_relaxed);
    const std::uint64_t length_and_slot =
        descriptor.length_and_slot.load(std::memory_order_relaxed);
    item.time.ns = descriptor.output_time_ns.load(std::memory_order_relaxed);
    for (std::size_t i = 0; i < metadata_words; ++i)
        item.metadata[i] = descriptor.metadata[i].load(std::memory_order_relaxed);
    // SYNC 3: acquire fence here, release fence in Writer::write_descriptor(): if any word above
    // came from the next item, the sequence below is no longer this item's. Without it a mixture of
    // two descriptors would pass.
    std::atomic_thread_fence(std::memory_order_acquire);
    if (descriptor.sequence.load(std::memory_order_relaxed) != complete) return item;

    item.slot = static_cast<std::uint32_t>(length_and_slot);
    item.payload_size = static_cast<std::uint32_t>(length_and_slot >> 32U);
    if (item.slot != no_slot) {
        if (item.payload_size > segment_->mapping.constants().slot_size || !intact(item))
            return item;
        item.payload = segment_->mapping.slot(item.slot);
    }
    item.found = Found::item;
    return item;
}

Item Reader::lapped() {
    const std::uint64_t half_way = head() - std::min(head(), retained() / 2);
    Item item;
    item.found = Found::lost;
    item.number = std::max(next_ + 1, half_way);
    item.lost = item.number - next_;
    next_ = item.number;
    return item;
}

Item Reader::next() {
    if (next_ >= head()) return idle();
    Item item = read_descriptor(next_);
    if (item.found != Found::item) return lapped();
    ++next_;
    return item;
}

Item Reader::idle() {
    Item item;
    // A writer that was killed never marked its segment: its silence counts as well.
    if (writer_alive()) return item;
    if (next_ < head()) return item;  // published since the last look: the next look finds it
    item.found = Found::gone;
    if (file_id(path_) == segment_->file) return item;
    auto successor = map(path_);
    if (!successor) return item;
    const Constants& now = (*successor)->mapping.constants();
    const Constants& before = segment_->mapping.constants();
    // Of another kind it is another stream: its items would be read as what they are not.
    if (now.generation == before.generation || now.kind != before.kind) return item;
    segment_ = std::move(*successor);
    next_ = 0;
    item.found = Found::restarted;
    return item;
}

Item Reader::wait(Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    for (;;) {
        const auto& wake = segment_->mapping.header().wake;
        // SYNC 5: acquire here, release in Writer::write_descriptor() and retire(): whatever moved
        // `wake` to the value seen is visible to next(); whatever comes later changes it, and the
        // kernel does not go to sleep. Without it a reader could sleep over an item.
        const std::uint32_t seen = wake.load(std::memory_order_acquire);
        Item item = next();
        const bool final_result = item.found != Found::nothing && item.found != Found::gone;
        const std::int64_t left_ns = (deadline - host_now()).ns;
        if (final_result) return item;
        if (left_ns <= 0) {
            return item;
        }
        futex_wait(wake, seen, std::min(left_ns, longest_wait_ns));
    }
}

bool Reader::intact(const Item& item) const {
    if (item.slot == no_slot) return true;
    if (item.slot >= segment_->mapping.constants().slot_count)
        return false;  // the item is from an earlier segment
    // SYNC 4: acquire fence here, release fence in Writer::acquire(): if anything that was read of
    // the payload came from a newer item, the generation has changed. Without it a mixture of two
    // payloads would pass for a good one.
    std::atomic_thread_fence(std::memory_order_acquire);
    return segment_->mapping.generation(item.slot).load(std::memory_order_relaxed) ==
           item.slot_generation;
}

bool Reader::copy(const Item& item, std::byte* destination) const {
    if (item.payload == nullptr) return item.payload_size == 0;
    copy_words(item.payload, destination, item.payload_size);
    return intact(item);
}

}  // namespace versavis::ring
