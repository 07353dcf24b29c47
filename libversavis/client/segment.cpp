// SPDX-License-Identifier: BSD-3-Clause
#include "client/segment.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <boost/interprocess/anonymous_shared_memory.hpp>
#include <boost/interprocess/exceptions.hpp>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>
#include <system_error>

#include "client/error_code.hpp"

namespace versavis::ring {

namespace ipc = boost::interprocess;

namespace {

/// What Boost maps: a file that is open already, and checked.
struct OpenFile {
    int file;
    ipc::mode_t mode;

    ipc::mapping_handle_t get_mapping_handle() const { return {file, false}; }
    ipc::mode_t get_mode() const { return mode; }
};

constexpr std::size_t huge_page = 2 << 20U;  // of x86-64, and of arm64 with pages of 4 KiB

/// MADV_COLLAPSE: makes huge pages of what is there, since Linux 6.1, whatever the host has set.
constexpr int collapse = 25;

/// Where a mapping of this size can have huge pages; somebody else may take it first. nullptr: it
/// is too small, or there is no room.
void* aligned_room(std::size_t size) {
    if (size < huge_page) return nullptr;
    const std::size_t room = size + huge_page;
    void* found =
        ::mmap(nullptr, room, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (found == MAP_FAILED) return nullptr;
    ::munmap(found, room);
    const std::size_t beyond = reinterpret_cast<std::uintptr_t>(found) % huge_page;
    return static_cast<std::byte*>(found) + (huge_page - beyond) % huge_page;
}

ipc::mapped_region map(const OpenFile& file, std::size_t size) {
    if (void* aligned = aligned_room(size); aligned != nullptr) try {
            return {file, file.mode, 0, 0, aligned};
        } catch (const ipc::interprocess_exception&) {  // taken: anywhere, then
        }
    return {file, file.mode};
}

/// Older segments have nothing there.
constexpr std::uint32_t minor_with_life = 5;
constexpr std::uint32_t minor_with_attributes = 6;
constexpr std::uint32_t minor_with_time_namespace = 8;

bool inside(std::uint64_t at, std::uint64_t count, std::uint64_t size, std::uint64_t total) {
    return at <= total && (size == 0 || count <= (total - at) / size);
}

bool well_formed(const Constants& header, std::size_t size) {
    const std::uint64_t descriptors = header.descriptor_count;
    return header.total_size == size && descriptors != 0 &&
           (descriptors & (descriptors - 1)) == 0 &&
           header.descriptors_at % alignof(Descriptor) == 0 &&
           header.descriptors_at >= sizeof(Header) &&
           header.generations_at % generation_stride == 0 && header.slots_at % page_size == 0 &&
           inside(header.descriptors_at, descriptors, sizeof(Descriptor), size) &&
           inside(header.generations_at, header.slot_count, generation_stride, size) &&
           header.slot_size % page_size == 0 &&
           inside(header.slots_at, header.slot_count, header.slot_size, size) &&
           header.name.back() == '\0';
}

}  // namespace

Expected<Mapping> Mapping::open_unchecked(int file, const std::filesystem::path& path,
                                          Access access) {
    struct stat status {};
    if (::fstat(file, &status) != 0 || !S_ISREG(status.st_mode))
        return failure(ErrorCode::damaged, path.string(), "is not a VersaVIS ring");
    try {
        const auto mode = access == Access::read_only ? ipc::read_only : ipc::read_write;
        Mapping mapping;
        mapping.region_ = map({file, mode}, static_cast<std::size_t>(status.st_size));
        return mapping;
    } catch (const ipc::interprocess_exception& exception) {
        return failure(code_of(exception.get_native_error()), path.string(),
                       std::string("cannot be mapped: ") + exception.what(),
                       "is the service running?");
    }
}

Expected<Mapping> Mapping::open(const std::filesystem::path& path, Access access) {
    const int mode = access == Access::read_only ? O_RDONLY : O_RDWR;
    FileDescriptor file(::open(path.c_str(), mode | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
    if (!file)
        return failure(
            code_of(errno), path.string(),
            "cannot be opened: " + std::error_code(errno, std::generic_category()).message(),
            "is the service running?");
    struct stat status {};
    ::fstat(file.get(), &status);
    return open({std::move(file), {status.st_dev, status.st_ino}}, path, access);
}

Expected<Mapping> Mapping::open(const NamedFile& file, const std::filesystem::path& path,
                                Access access) {
    auto mapping = open_unchecked(file.file.get(), path, access);
    if (!mapping) return mapping;
    // SYNC 7: acquire here, release at the end of the writer's fill_header(): with the magic, the
    // rest of the header is complete. Without it a header could be checked and used half filled.
    if (mapping->size() < page_size ||
        mapping->header().magic.load(std::memory_order_acquire) != magic)
        return failure(ErrorCode::damaged, path.string(), "is not a VersaVIS ring");
    const Header& header = mapping->header();
    if (header.abi_major != abi_major)
        return failure(ErrorCode::unsupported, path.string(),
                       "has layout version " + std::to_string(header.abi_major) +
                           ", this program reads version " + std::to_string(abi_major),
                       "install service and clients of the same release");
    mapping->read_constants();
    if (!well_formed(mapping->constants(), mapping->size()))
        return failure(ErrorCode::damaged, path.string(), "has a damaged header");
    mapping->name_ = file.name;
    return mapping;
}

Expected<> Mapping::populate(const std::filesystem::path& path) const {
    const int how = region_.get_mode() == ipc::read_only ? MADV_POPULATE_READ : MADV_POPULATE_WRITE;
    if (::madvise(bytes(), size(), how) == 0) {
        // Fewer misses of the TLB; without them everything works as well.
        if (how == MADV_POPULATE_WRITE) ::madvise(bytes(), size(), collapse);
        return {};
    }
    // Linux before 5.14 cannot. For any other reason, touching a page may end the process.
    if (errno != EINVAL)
        return failure(ErrorCode::no_memory, path.string(),
                       "its memory cannot be mapped: " +
                           std::error_code(errno, std::generic_category()).message(),
                       "free memory: 'df /dev/shm' and 'free' show what there is");
    const volatile std::byte* page = bytes();
    for (std::size_t at = 0; at < size(); at += page_size) static_cast<void>(page[at]);
    return {};
}

Expected<Mapping> Mapping::remains() const {
    Mapping left;
    try {
        left.region_ = ipc::anonymous_shared_memory(2 * page_size);
    } catch (const ipc::interprocess_exception& exception) {
        return failure(ErrorCode::no_memory, constants_.name.data(), exception.what());
    }
    left.constants_ = constants_;
    left.constants_.descriptors_at = page_size;
    left.constants_.descriptor_count = 1;
    left.constants_.slot_count = 0;
    const Header& last = header();
    Header& copy = left.header();
    const std::uint64_t head = last.head.load(std::memory_order_acquire);
    copy.head = head;
    copy.wake = last.wake.load(std::memory_order_relaxed);
    copy.heartbeat_ns = last.heartbeat_ns.load(std::memory_order_relaxed);
    copy.state = static_cast<std::uint32_t>(WriterState::closed);
    // By this, the next item is not there, and those before it are lost.
    left.descriptor(0).sequence = 2 * head - 1;
    return left;
}

void Mapping::read_constants() {
    const Header& from = header();
    constants_.total_size = from.total_size;
    constants_.generation = from.generation;
    constants_.writer_pid = from.writer_pid;
    constants_.kind = from.kind;
    constants_.writer_start_ticks = from.writer_start_ticks;
    constants_.descriptor_count = from.descriptor_count;
    constants_.slot_count = from.slot_count;
    constants_.slot_size = from.slot_size;
    constants_.descriptors_at = from.descriptors_at;
    constants_.generations_at = from.generations_at;
    constants_.slots_at = from.slots_at;
    std::memcpy(constants_.name.data(), from.name, sizeof from.name);
    constants_.life = from.abi_minor >= minor_with_life ? from.life : 0;
    constants_.pid_namespace = from.abi_minor >= minor_with_life ? from.pid_namespace : 0;
    constants_.time_namespace =
        from.abi_minor >= minor_with_time_namespace ? from.time_namespace : 0;
    constants_.has_attributes = from.abi_minor >= minor_with_attributes;
}

FileId file_id(const std::filesystem::path& path) {
    struct stat file {};
    return ::lstat(path.c_str(), &file) == 0 ? FileId{file.st_dev, file.st_ino} : FileId{};
}

}  // namespace versavis::ring
