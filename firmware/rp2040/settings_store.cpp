// SPDX-License-Identifier: BSD-3-Clause
#include "settings_store.hpp"

#include <cstring>

#include "wire/crc32.hpp"
#include "wire/flash_map.hpp"

namespace versavis::rp2040 {

namespace {

/// Bytes that one step writes or reads. If higher, a step holds the core up for 40 us.
constexpr std::size_t chunk = 32;
static_assert(wire::flash_page % chunk == 0);

constexpr std::uint32_t magic = 0x53495656;

/// For the flash chip, which counts from its own begin.
constexpr std::uint32_t address_of(unsigned place) {
    return wire::settings_begin - wire::flash_begin + place * wire::flash_sector;
}

}  // namespace

std::uint32_t SettingsStore::check_of(const Record& record) {
    const auto* head = reinterpret_cast<const std::uint8_t*>(&record.head.number);
    std::uint32_t check = wire::crc32(head, 2 * sizeof(std::uint32_t));
    check ^= wire::crc32(record.data, record.head.size);
    return check;
}

/// Into record_; false: nothing whole is stored there.
bool SettingsStore::read_place(unsigned place) {
    flash_.read(address_of(place), reinterpret_cast<std::uint8_t*>(&record_), sizeof record_);
    return record_.head.magic == magic && record_.head.size <= capacity &&
           record_.head.check == check_of(record_);
}

std::size_t SettingsStore::load(std::uint8_t* data, std::size_t room) {
    std::size_t size = 0;
    for (unsigned place = 0; place < wire::settings_places; ++place) {
        if (!read_place(place)) continue;
        const Head& head = record_.head;
        if (size != 0 && static_cast<std::int32_t>(head.number - number_) < 0) continue;
        if (head.size > room) continue;
        number_ = head.number;
        next_place_ = (place + 1) % wire::settings_places;
        size = head.size;
        std::memcpy(data, record_.data, size);
    }
    return size;
}

bool SettingsStore::store(const std::uint8_t* data, std::size_t size) {
    if (is_storing() || size > capacity) return false;
    record_.head.magic = magic;
    record_.head.number = number_ + 1;
    record_.head.size = static_cast<std::uint32_t>(size);
    std::memcpy(record_.data, data, size);
    record_.head.check = check_of(record_);
    outcome_ = Outcome::busy;
    begin(Step::erase);
    return true;
}

SettingsStore::Outcome SettingsStore::take_outcome() {
    const Outcome outcome = outcome_;
    if (outcome != Outcome::busy) outcome_ = Outcome::none;
    return outcome;
}

void SettingsStore::work() {
    if (step_ == Step::idle || flash_.busy()) return;
    const std::uint32_t place = address_of(next_place_);
    if (step_ == Step::erase) {
        flash_.erase_sector(place);
        return begin(Step::write);
    }
    const std::size_t all = sizeof record_.head + record_.head.size;
    const std::size_t size = all - done_ < chunk ? all - done_ : chunk;
    const auto address = static_cast<std::uint32_t>(place + done_);
    const std::uint8_t* const bytes = reinterpret_cast<const std::uint8_t*>(&record_) + done_;
    if (step_ == Step::write) {
        flash_.write_page(address, bytes, size);
    } else {
        std::uint8_t found[chunk];
        flash_.read(address, found, size);
        if (std::memcmp(found, bytes, size) != 0) return end(Outcome::failed);
    }
    done_ += size;
    if (done_ < all) return;
    if (step_ == Step::write) return begin(Step::verify);
    number_ = record_.head.number;
    next_place_ = (next_place_ + 1) % wire::settings_places;
    end(Outcome::stored);
}

void SettingsStore::begin(Step step) {
    step_ = step;
    done_ = 0;
}

void SettingsStore::end(Outcome outcome) {
    outcome_ = outcome;
    step_ = Step::idle;
}

}  // namespace versavis::rp2040
