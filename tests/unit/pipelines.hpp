// SPDX-License-Identifier: BSD-3-Clause
// Rings and a clock for tests of the service's pipelines: board time is host time minus one second.
#pragma once

#include <stdexcept>
#include <string>

#include "../support/temporary_directory.hpp"
#include "engine/clock/translator.hpp"
#include "engine/ring/writer.hpp"
#include "publish/event_journal.hpp"
#include "versavis/ring_reader.hpp"

namespace versavis::test {

class Pipelines {
 public:
    Pipelines()
        : translator(*clock::OutputClock::create(clock::OutputClockKind::monotonic_raw)),
          events(writer({"events", ring::StreamKind::events, 64}), translator) {}

    /// One exchange around `host`, 20 us long.
    void exchange(HostTime host) {
        const BoardTime board = to_board(host);
        translator.add({host - microseconds(10), board, board, host + microseconds(10)});
    }

    /// From here on board time can be translated.
    void synchronise(HostTime host) {
        exchange(host);
        exchange(host);  // they agree
    }

    static BoardTime to_board(HostTime host) { return {host.ns - 1'000'000'000}; }

    ring::Writer writer(const ring::Shape& shape) const {
        auto made = ring::Writer::create(directory.path(), shape);
        if (!made) throw std::runtime_error(made.error().message());
        return std::move(*made);
    }

    ring::Reader reader(const std::string& name) const {
        auto opened = ring::Reader::open(directory.path() / name, {ring::Position::middle});
        if (!opened) throw std::runtime_error(opened.error().message());
        return std::move(*opened);
    }

    TemporaryDirectory directory{"/dev/shm"};
    clock::Translator translator;
    daemon::EventJournal events;
};

}  // namespace versavis::test
