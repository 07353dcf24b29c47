// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <functional>
#include <random>
#include <system_error>
#include <thread>

#include "client/deadline.hpp"
#include "client/process.hpp"
#include "client/segment.hpp"
#include "engine/ring/foreign_segments.hpp"
#include "engine/ring/memory_budget.hpp"
#include "engine/ring/segment_lifecycle.hpp"
#include "engine/ring/segment_server.hpp"
#include "engine/ring/waiter_waker.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::ring {

struct Writer::Segment {
    std::filesystem::path path;
    FileId name;
    Mapping mapping;
    std::unique_ptr<SegmentServer> server;  ///< of a sealed one
    std::uint64_t head;
    WaiterWaker waker;  ///< before the mapping goes, its thread ends

    Segment(std::filesystem::path file, Mapping mapped, std::unique_ptr<SegmentServer> opened,
            std::uint64_t first)
        : path(std::move(file)),
          name(file_id(path)),
          mapping(std::move(mapped)),
          server(std::move(opened)),
          head(first) {}
    ~Segment() {
        const auto live = static_cast<std::uint32_t>(WriterState::live);
        // Relaxed: a successor may be retiring this segment right now. Ended twice does no harm.
        if (mapping.header().state.load(std::memory_order_relaxed) == live) end(mapping.header());
        // The name may belong to a newer writer by now: remove it only while it is this segment's.
        if (file_id(path) == name) ::unlink(path.c_str());
    }
};

namespace {

std::uint64_t round_up(std::uint64_t value, std::uint64_t multiple) {
    return (value + multiple - 1) / multiple * multiple;
}

std::string reason(int error) { return std::error_code(error, std::generic_category()).message(); }

void read_boot_id(std::uint8_t (&boot_id)[16]) {
    std::ifstream file("/proc/sys/kernel/random/boot_id");
    std::string text;
    file >> text;
    text.erase(std::remove(text.begin(), text.end(), '-'), text.end());
    text.resize(2 * sizeof boot_id, '0');
    for (std::size_t i = 0; i < sizeof boot_id; ++i)
        boot_id[i] =
            static_cast<std::uint8_t>(std::strtoul(text.substr(2 * i, 2).c_str(), nullptr, 16));
}

Expected<> reserve(const FileDescriptor& file, const std::filesystem::path& path,
                   std::uint64_t size) {
    const int error = ::posix_fallocate(file.get(), 0, static_cast<off_t>(size));
    if (error == 0) return {};
    return failure(path.string(),
                   fmt::format("cannot reserve {} MiB: {}", size >> 20U, reason(error)),
                   "lower 'slots' or 'history_s', or enlarge /dev/shm");
}

/// A file of its own, whatever lay there under this name. None of it is ever shared with somebody
/// else's: what is left there is removed, and O_EXCL follows no link.
Expected<FileDescriptor> make_file(const std::filesystem::path& path, std::uint64_t size) {
    ::unlink(path.c_str());
    FileDescriptor file(::open(path.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0640));
    if (!file || ::fchmod(file.get(), 0640) != 0)  // whatever umask says
        return failure(path.string(), fmt::format("cannot be created: {}", reason(errno)),
                       "does its directory belong to the service's user?");
    if (auto reserved = reserve(file, path, size); !reserved) {
        ::unlink(path.c_str());
        return Unexpected(reserved.error());
    }
    return file;
}

/// MFD_NOEXEC_SEAL: that it holds no program, which a host may insist on since Linux 6.3.
constexpr unsigned no_program = 1U << 3U;

Expected<FileDescriptor> make_nameless(const std::filesystem::path& path, std::uint64_t size) {
    const unsigned flags = MFD_CLOEXEC | MFD_ALLOW_SEALING;
    FileDescriptor file(::memfd_create(path.filename().c_str(), flags | no_program));
    if (!file)
        file = FileDescriptor(::memfd_create(path.filename().c_str(), flags));  // an older Linux
    if (!file) return failure(path.string(), fmt::format("cannot be created: {}", reason(errno)));
    if (auto reserved = reserve(file, path, size); !reserved) return Unexpected(reserved.error());
    return file;
}

/// From here on only existing mappings can write.
Expected<std::unique_ptr<SegmentServer>> seal(FileDescriptor file,
                                              const std::filesystem::path& path) {
    const int seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL;
    if (::fcntl(file.get(), F_ADD_SEALS, seals) != 0)
        return failure(path.string(), fmt::format("cannot be sealed: {}", reason(errno)),
                       "set 'sealed = false' in [memory], or use Linux 5.1 or newer");
    return SegmentServer::open(path, std::move(file));
}

/// For readers of a dead writer's ring to let go of it: they do at their next look, after 20 ms if
/// they sleep. If lower, one that works on an item has not yet; if higher, a service that is short
/// of memory starts later, or says so later.
constexpr Duration time_to_let_go = milliseconds(500);

constexpr auto between_tries = std::chrono::milliseconds(10);

/// Rings that were there.
struct Removed {
    bool any = false;
    std::uint64_t size = 0;  ///< of those that were files, in bytes
};

/// Takes the names of the rings that dead writers left in `directory`, so that their memory is free
/// when no reader has them mapped any more.
Removed remove_dead(const std::filesystem::path& directory) {
    Removed removed;
    const auto open = [&](const std::filesystem::path& path) {
        // A new one has a name that begins with a dot, and is not served yet.
        const bool deserted =
            is_stream_name(path.filename().string()) && SegmentServer::is_deserted(path);
        if (deserted && ::unlink(path.c_str()) == 0) removed.any = true;
        return Mapping::open(path, Mapping::Access::read_write);
    };
    for (const ForeignSegment& segment : foreign_segments(directory, open)) {
        if (segment.alive) continue;
        struct stat file {};
        if (::stat(segment.path.c_str(), &file) == 0)
            removed.size += static_cast<std::uint64_t>(file.st_blocks) * 512;
        removed.any = true;
        supersede(segment.mapping.header());
        ::unlink(segment.path.c_str());
        wake_readers(segment.mapping.header());
    }
    return removed;
}

/// Free in the directory's file system, in bytes.
std::uint64_t free_space(const std::filesystem::path& directory) {
    struct statvfs system {};
    ::statvfs(directory.c_str(), &system);
    return std::uint64_t{system.f_bfree} * system.f_frsize;
}

/// `make` has failed for lack of memory, with `why`. Tries again when dead writers' rings are
/// removed, until readers had the time to let go of them.
Expected<FileDescriptor> make_in_place_of_dead(
    const std::filesystem::path& directory, Error why,
    const std::function<Expected<FileDescriptor>()>& make) {
    const std::uint64_t before = free_space(directory);
    const Removed dead = remove_dead(directory);
    if (!dead.any) return Unexpected(std::move(why));
    auto made = make();
    for (const HostTime end = deadline_after(time_to_let_go); !made && !is_over(end); made = make())
        std::this_thread::sleep_for(between_tries);
    const std::uint64_t now = free_space(directory);
    const std::uint64_t freed = now - std::min(before, now);
    if (made || freed >= dead.size) return made;
    Error& error = made.error();
    error.what += fmt::format(", while programs still hold {} MiB of a service that died",
                              (dead.size - freed + (1 << 20U) - 1) >> 20U);
    error.cure += ", or end those that read its streams";
    return made;
}

/// Of the process that fills the header: no other one of this machine, ever, has the same.
std::uint64_t life_of(const Header& header) {
    // 0, as in segments without it, is one hash of 2^64.
    return std::hash<std::string>{}(fmt::format("{} {} {} {}", fmt::join(header.boot_id, " "),
                                                header.pid_namespace, header.writer_pid,
                                                header.writer_start_ticks));
}

void fill_header(Header& header, const Shape& shape, std::uint64_t total) {
    header.abi_major = abi_major;
    header.abi_minor = abi_minor;
    header.total_size = total;
    std::random_device random;
    header.generation = (std::uint64_t{random()} << 32U) | random();
    read_boot_id(header.boot_id);
    header.writer_pid = static_cast<std::uint32_t>(::getpid());
    header.kind = shape.kind;
    header.writer_start_ticks = start_ticks_of_this_process();
    header.descriptor_count = shape.descriptor_count;
    header.slot_count = shape.slot_count;
    header.slot_size = round_up(shape.slot_size, page_size);
    header.descriptors_at = page_size;
    header.generations_at = header.descriptors_at + shape.descriptor_count * sizeof(Descriptor);
    header.slots_at =
        round_up(header.generations_at + shape.slot_count * generation_stride, page_size);
    shape.name.copy(header.name, sizeof header.name);
    header.pid_namespace = own_namespaces().pid;
    header.time_namespace = own_namespaces().time;
    header.life = shape.life != 0 ? shape.life : life_of(header);
    header.head.store(shape.first_item, std::memory_order_relaxed);
    header.state.store(static_cast<std::uint32_t>(WriterState::live), std::memory_order_relaxed);
    header.heartbeat_ns.store(host_now().ns, std::memory_order_relaxed);
    // SYNC 7: release here, acquire in Mapping::open(): the magic says that all of the above is in
    // memory.
    header.magic.store(magic, std::memory_order_release);
}

/// In a ring that does not begin at 0, no descriptor may look as if it were ahead of its first
/// item.
void number_descriptors(const Mapping& mapping, std::uint64_t first) {
    const std::uint64_t count = mapping.constants().descriptor_count;
    for (std::uint64_t number = first; first != 0 && number < first + count; ++number)
        mapping.descriptor(number).sequence.store(2 * (number - count) + 1,
                                                  std::memory_order_relaxed);
}

std::uint64_t total_size(const Shape& shape) {
    const std::uint64_t words = page_size + shape.descriptor_count * sizeof(Descriptor) +
                                shape.slot_count * generation_stride;
    return round_up(words, page_size) + shape.slot_count * round_up(shape.slot_size, page_size);
}

}  // namespace

Expected<Writer> Writer::create(const Place& place, const Shape& shape) {
    if (!std::has_single_bit(shape.descriptor_count) || shape.name.empty() ||
        shape.name.size() >= sizeof Header::name)
        return failure(
            shape.name,
            "a ring needs a name shorter than 64 characters and a power of two of descriptors");
    const auto path = place.directory / shape.name;
    const auto temporary = place.directory / ("." + shape.name + ".new");
    const std::uint64_t size = total_size(shape);
    const auto make = [&]() -> Expected<FileDescriptor> {
        auto fits = place.sealed ? check_memory(path, size) : check_tmpfs_space(path, size);
        if (!fits) return Unexpected(fits.error());
        return place.sealed ? make_nameless(path, size) : make_file(temporary, size);
    };
    auto file = make();
    if (!file) file = make_in_place_of_dead(place.directory, file.error(), make);
    if (!file) return Unexpected(file.error());
    auto mapping = Mapping::open_unchecked(file->get(), temporary, Mapping::Access::read_write);
    if (!mapping) {
        ::unlink(temporary.c_str());
        return Unexpected(mapping.error());
    }
    if (auto populated = mapping->populate(path); !populated) {
        ::unlink(temporary.c_str());
        return Unexpected(populated.error());
    }
    fill_header(mapping->header(), shape, size);
    mapping->read_constants();
    number_descriptors(*mapping, shape.first_item);
    std::unique_ptr<SegmentServer> server;
    if (place.sealed) {
        auto opened = seal(std::move(*file), temporary);
        if (!opened) {
            ::unlink(temporary.c_str());
            return Unexpected(opened.error());
        }
        server = std::move(*opened);
    }
    // Superseded before the name changes: when this process dies in between, readers know at once
    // that nothing more comes from the old one. They are woken when there is something to find.
    auto old = Mapping::open(path, Mapping::Access::read_write);
    if (old) supersede(old->header());
    if (::rename(temporary.c_str(), path.c_str()) != 0) {
        const int error = errno;
        ::unlink(temporary.c_str());
        if (old && is_own(old->constants())) reinstate(old->header());
        return failure(path.string(),
                       fmt::format("cannot be renamed into place: {}", reason(error)));
    }
    if (old) wake_readers(old->header());
    return Writer(
        std::make_unique<Segment>(path, std::move(*mapping), std::move(server), shape.first_item),
        shape.kept);
}

Writer::Writer(std::unique_ptr<Segment> segment, std::uint32_t kept)
    : segment_(std::move(segment)), kept_(kept) {
    for (std::uint32_t slot = 0; slot < slot_count(); ++slot) free_.push_back(slot);
}
Writer::Writer(Writer&&) noexcept = default;
Writer& Writer::operator=(Writer&&) noexcept = default;
Writer::~Writer() = default;

std::byte* Writer::slot_data(std::uint32_t slot) const { return segment_->mapping.slot(slot); }
std::uint64_t Writer::slot_size() const { return segment_->mapping.constants().slot_size; }
std::uint32_t Writer::slot_count() const { return segment_->mapping.constants().slot_count; }
std::uint64_t Writer::head() const { return segment_->head; }

void Writer::heartbeat(HostTime now) {
    segment_->mapping.header().heartbeat_ns.store(now.ns, std::memory_order_relaxed);
}

std::optional<std::uint32_t> Writer::acquire() {
    if (free_.empty()) return std::nullopt;
    const auto found = kept_ != 0 && free_.size() > kept_ ? free_.end() - kept_ - 1 : free_.begin();
    const std::uint32_t slot = *found;
    free_.erase(found);
    // SYNC 4: release fence here, acquire fence in Payload::valid(): the generation is odd before
    // the first byte of the new payload is stored.
    segment_->mapping.generation(slot).fetch_add(1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    return slot;
}

void Writer::abandon(std::uint32_t slot) {
    // Belongs to no pair: no descriptor names this generation, so every reader refuses the slot.
    segment_->mapping.generation(slot).fetch_add(1, std::memory_order_release);
    // It holds nothing that a reader could want.
    free_.insert(kept_ != 0 && free_.size() > kept_ ? free_.end() - kept_ : free_.begin(), slot);
}

void Writer::publish(std::uint32_t slot, std::uint32_t length, OutputTime time,
                     const Metadata& metadata, std::uint64_t attributes) {
    segment_->mapping.attributes(slot).store(attributes, std::memory_order_relaxed);
    // Readers here learn this generation from the descriptor, so SYNC 2 orders the payload for
    // them. Release serves a reader in another language that acquires the generation by itself.
    const std::uint64_t generation =
        segment_->mapping.generation(slot).fetch_add(1, std::memory_order_release) + 1;
    free_.push_back(slot);
    write_descriptor(generation, (std::uint64_t{length} << 32U) | slot, time, metadata);
}

void Writer::publish(OutputTime time, const Metadata& metadata) {
    write_descriptor(0, no_slot, time, metadata);
}

void Writer::write_descriptor(std::uint64_t slot_generation, std::uint64_t length_and_slot,
                              OutputTime time, const Metadata& metadata) {
    Header& header = segment_->mapping.header();
    const std::uint64_t number = segment_->head++;
    Descriptor& descriptor = segment_->mapping.descriptor(number);
    descriptor.sequence.store(2 * number + 1, std::memory_order_relaxed);
    // SYNC 3: release fence here, acquire fence in Reader::read(): the sequence is odd
    // before the first word of the new item is stored.
    std::atomic_thread_fence(std::memory_order_release);
    descriptor.slot_generation.store(slot_generation, std::memory_order_relaxed);
    descriptor.length_and_slot.store(length_and_slot, std::memory_order_relaxed);
    descriptor.output_time_ns.store(time.ns, std::memory_order_relaxed);
    for (std::size_t i = 0; i < metadata_words; ++i)
        descriptor.metadata[i].store(metadata[i], std::memory_order_relaxed);
    // SYNC 2: release here, acquire in Reader::read(): words, payload and the slot's
    // generation are in memory before the sequence says so.
    descriptor.sequence.store(2 * number + 2, std::memory_order_release);
    // SYNC 1: release here, acquire in Reader::head(): the descriptor is complete before it counts.
    header.head.store(number + 1, std::memory_order_release);
    // SYNC 5: release here, acquire in Reader::next(): a reader that sees this sees the new head.
    header.wake.fetch_add(1, std::memory_order_release);
    segment_->waker.wake(header.wake);
}

}  // namespace versavis::ring
