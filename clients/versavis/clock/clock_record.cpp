// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_record.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <algorithm>
#include <cstdio>
#include <optional>

#include "base/fail.hpp"
#include "engine/clock/recording.hpp"
#include "posix/file.hpp"
#include "versavis/stream.hpp"

namespace versavis::client {

namespace {

constexpr Duration longest_wait = milliseconds(200);

/// Sorts items into files.
class Recording {
 public:
    Expected<> open(const ClockRecordSettings& settings) {
        if (auto opened = open(exchange_file_, settings.exchanges, "h1_ns,m2_ns,m3_ns,h4_ns\n");
            !opened)
            return opened;
        if (settings.one_way.empty()) return {};
        return open(one_way_file_, settings.one_way, "m_ns,h_ns\n");
    }

    /// False: the board restarted, and this item belongs to its new boot.
    bool add(const clock::ClockItem& item) {
        return std::visit([this](const auto& recorded) { return take(recorded); }, item);
    }

    void service_restarted() { service_restarted_ = true; }

    Expected<> close() {
        auto closed = exchange_file_->close();
        if (closed && one_way_file_) closed = one_way_file_->close();
        return closed;
    }

    std::uint64_t exchanges() const { return exchanges_; }
    std::uint64_t one_way() const { return one_way_; }

 private:
    static Expected<> open(std::optional<NewFile>& into, const std::string& path,
                           const char* header) {
        auto file = NewFile::create(path);
        if (!file) return Unexpected(file.error());
        file->write(header);
        into.emplace(std::move(*file));
        return {};
    }

    bool same_life(std::uint32_t nonce) {
        if (!nonce_) nonce_ = nonce;
        return nonce == *nonce_;
    }

    bool take(const clock::RecordedExchange& recorded) {
        if (!same_life(recorded.nonce)) return false;
        exchange_file_->write(fmt::format("{},{},{},{}\n", recorded.sent.ns, recorded.received.ns,
                                          recorded.answered.ns, recorded.arrived.ns));
        ++exchanges_;
        return true;
    }

    bool take(const clock::RecordedMessage& recorded) {
        if (!same_life(recorded.nonce)) return false;
        if (one_way_file_)
            one_way_file_->write(fmt::format("{},{}\n", recorded.departed.ns, recorded.arrived.ns));
        ++one_way_;
        return true;
    }

    /// A new service meets the board for the first time, too.
    bool take(const clock::RecordedRestart& recorded) {
        const bool met_again = service_restarted_ && recorded.nonce == nonce_;
        service_restarted_ = false;
        if (exchanges_ + one_way_ == 0) nonce_ = recorded.nonce;
        return met_again || exchanges_ + one_way_ == 0;
    }

    bool take(const clock::RecordedOutput& /*recorded*/) { return true; }

    std::optional<NewFile> exchange_file_;
    std::optional<NewFile> one_way_file_;
    std::optional<std::uint32_t> nonce_;
    bool service_restarted_ = false;
    std::uint64_t exchanges_ = 0;
    std::uint64_t one_way_ = 0;
};

/// False: the board restarted.
bool take(const clock::ClockStream::Result& item, Recording& recording) {
    if (!item) {
        if (item.error().why == Pause::lost)
            fmt::print(stderr, "versavis: {}\n", item.error().message());
        if (item.error().why == Pause::restarted) recording.service_restarted();
        return true;
    }
    const auto recorded = clock::from_metadata(item->data);
    return !recorded || recording.add(*recorded);
}

/// Reads until the time is up. False: the board restarted first.
bool run(clock::ClockStream& stream, Recording& recording, const ClockRecordSettings& settings) {
    const bool limited = settings.duration.ns > 0;
    const HostTime end = host_now() + settings.duration;
    while (!settings.stop() && !(limited && host_now() >= end)) {
        const Duration left = end - host_now();
        const bool short_wait = limited && left < longest_wait;
        if (!take(stream.next(short_wait ? std::max(left, Duration{}) : longest_wait), recording))
            return false;
    }
    // What had been published by then belongs to the recording.
    const std::uint64_t head = stream.reader().head();
    for (;;) {
        const auto item = stream.next();
        if (!item && item.error().why != Pause::lost) break;
        if (!take(item, recording)) return false;
        if (item && item->number + 1 >= head) break;
    }
    return true;
}

}  // namespace

int record_clock(const ClockRecordSettings& settings) {
    auto stream = clock::ClockStream::open("clock", {{}, settings.instance});
    if (!stream) return fail(stream.error());
    Recording recording;
    if (const auto opened = recording.open(settings); !opened) return fail(opened.error());
    fmt::print("recording to {}\n", settings.exchanges);
    std::fflush(stdout);
    const bool to_its_end = run(*stream, recording, settings);
    if (const auto closed = recording.close(); !closed) return fail(closed.error());
    fmt::print("{} exchanges, {} one-way messages\n", recording.exchanges(), recording.one_way());
    if (!to_its_end)
        return fail({"board", "restarted, and its clock with it",
                     "the recording ends there; start another"});
    if (recording.exchanges() == 0)
        return fail(
            {"clock", "no exchange arrived", "'versavis status' shows the state of the board"});
    return EX_OK;
}

}  // namespace versavis::client
