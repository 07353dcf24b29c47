// SPDX-License-Identifier: BSD-3-Clause
#include "client/segment.hpp"

#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <boost/interprocess/exceptions.hpp>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <string>

namespace versavis::ring {

namespace ipc = boost::interprocess;

namespace {

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

Expected<Mapping> Mapping::open_unchecked(const std::filesystem::path& path, Access access) {
    try {
        const auto mode = access == Access::read_only ? ipc::read_only : ipc::read_write;
        const ipc::file_mapping file(path.c_str(), mode);
        Mapping mapping;
        mapping.region_ = ipc::mapped_region(file, mode, 0, 0, nullptr, MAP_POPULATE);
        return mapping;
    } catch (const ipc::interprocess_exception& exception) {
        const bool forbidden = exception.get_error_code() == ipc::security_error;
        return failure(path.string(), std::string("cannot be mapped: ") + exception.what(),
                       forbidden ? "join the group that may read streams (usually 'versavis')"
                                 : "is the service running?");
    }
}

Expected<Mapping> Mapping::open(const std::filesystem::path& path, Access access) {
    auto mapping = open_unchecked(path, access);
    if (!mapping) return mapping;
    // SYNC 7: acquire here, release at the end of the writer's fill_header(): with the magic, the
    // rest of the header is complete. Without it a header could be checked and used half filled.
    if (mapping->size() < page_size ||
        mapping->header().magic.load(std::memory_order_acquire) != magic)
        return failure(path.string(), "is not a VersaVIS ring");
    const Header& header = mapping->header();
    if (header.abi_major != abi_major)
        return failure(path.string(),
                       "has layout version " + std::to_string(header.abi_major) +
                           ", this program reads version " + std::to_string(abi_major),
                       "install service and clients of the same release");
    mapping->read_constants();
    if (!well_formed(mapping->constants(), mapping->size()))
        return failure(path.string(), "has a damaged header");
    return mapping;
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
}

std::uint64_t start_ticks_of(std::uint32_t pid) {
    std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
    std::string line;
    std::getline(stat, line);
    std::size_t at = line.rfind(')');  // the command may contain spaces
    if (at != std::string::npos && line[at + 2] == 'Z') return 0;
    for (int field = 3; field <= 22 && at != std::string::npos; ++field)
        at = line.find(' ', at + 1);
    return at == std::string::npos ? 0 : std::strtoull(line.c_str() + at, nullptr, 10);
}

std::uint64_t start_ticks_of_this_process() {
    return start_ticks_of(static_cast<std::uint32_t>(::getpid()));
}

bool is_own(const Header& header) {
    return header.writer_pid == static_cast<std::uint32_t>(::getpid()) &&
           header.writer_start_ticks == start_ticks_of_this_process();
}

void retire(Header& header, WriterState state) {
    // SYNC 6: release here, acquire in Reader::writer_alive(): the last item, and the name of the
    // successor, precede the new state.
    header.state.store(static_cast<std::uint32_t>(state), std::memory_order_release);
    // SYNC 5: release here, acquire in Reader::wait(): a reader that wakes up sees the new state.
    header.wake.fetch_add(1, std::memory_order_release);
    futex_wake(header.wake);
}

void futex_wake(const std::atomic<std::uint32_t>& word) {
    syscall(SYS_futex, &word, FUTEX_WAKE, INT32_MAX, nullptr, nullptr, 0);
}

void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t value,
                std::int64_t timeout_ns) {
    const timespec timeout{timeout_ns / 1'000'000'000, timeout_ns % 1'000'000'000};
    syscall(SYS_futex, &word, FUTEX_WAIT, value, &timeout, nullptr, 0);
}

}  // namespace versavis::ring
