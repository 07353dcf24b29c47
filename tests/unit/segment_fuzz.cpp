// SPDX-License-Identifier: BSD-3-Clause
// Segments whose bytes somebody changed, before and after they were mapped: reader and tool may
// refuse them or read nonsense, but never crash, hang or leave their mapping.
#include <fcntl.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "commands/list.hpp"
#include "commands/tail.hpp"
#include "engine/ring/writer.hpp"
#include "versavis.h"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

/// A ring of 8 items of random bytes, with its words laid open.
class FuzzVictim {
 public:
    explicit FuzzVictim(StreamKind kind)
        : writer_(*Writer::create(directory_.path(), {"victim", kind, 8, 4, page_size})),
          mapping_(*Mapping::open(path(), Mapping::Access::read_write)) {
        for (int i = 0; i < 3; ++i) publish();
        const auto* bytes = reinterpret_cast<const char*>(&mapping_.header());
        original_.assign(bytes, bytes + mapping_.size());
    }

    std::filesystem::path path() const { return directory_.path() / "victim"; }
    std::string instance() const { return test::instance_in(directory_.path()); }

    void publish() {
        Metadata metadata;
        for (std::uint64_t& word : metadata) word = random_();
        writer_.publish(*writer_.acquire(), 300, OutputTime{7}, metadata);
    }

    /// A few bytes or words of header, descriptors and generations get other values.
    void damage() {
        char* bytes = reinterpret_cast<char*>(&mapping_.header());
        const std::size_t words_end = page_size + 8 * sizeof(Descriptor) + 4 * generation_stride;
        const std::uint64_t count = 1 + random_() % 6;
        for (std::uint64_t i = 0; i < count; ++i) {
            const bool in_header = random_() % 3 != 0;
            const std::size_t at = in_header ? random_() % 768 : random_() % words_end;
            const std::uint64_t value = interesting();
            const std::size_t width = std::size_t{1} << random_() % 4;
            std::memcpy(bytes + at / width * width, &value, width);
        }
    }

    void heal() {
        std::memcpy(static_cast<void*>(&mapping_.header()), original_.data(), original_.size());
    }

 private:
    std::uint64_t interesting() {
        switch (random_() % 6) {
            case 0: return 0;
            case 1: return ~std::uint64_t{0};
            case 2: return std::uint64_t{1} << random_() % 64;
            case 3: return mapping_.size() + random_() % 5 - 2;
            case 4: return random_() % 8 * page_size;
            default: return random_();
        }
    }

    test::TemporaryDirectory directory_{"/dev/shm"};
    std::mt19937_64 random_{20};
    Writer writer_;
    Mapping mapping_;
    std::string original_;
};

/// As a program does, with each result taken to its end.
std::uint64_t use(Reader& reader) {
    std::uint64_t sum = 0;
    for (int i = 0; i < 12; ++i) {
        const auto item = reader.next();
        if (!item) continue;
        std::vector<std::byte> copy(item->payload.size());
        if (item->payload.copy_to(copy.data()))
            for (const std::byte byte : copy) sum += static_cast<std::uint64_t>(byte);
        sum += item->valid() ? 1 : 0;
    }
    reader.seek(Position::oldest);
    sum += reader.seek(EpochTime{reader.life(), 7, 1}) ? 1 : 0;
    sum += reader.latest() ? 1 : 0;
    return sum + std::strlen(reader.name()) + reader.retained();
}

void use_from_c(const std::string& instance) {
    versavis_stream* stream = nullptr;
    versavis_options options = VERSAVIS_OPTIONS_INIT;
    options.start = VERSAVIS_OLDEST;
    if (versavis_open(instance.c_str(), "victim", &options, &stream, nullptr) != VERSAVIS_OK)
        return;
    versavis_item item = VERSAVIS_ITEM_INIT;
    for (int i = 0; i < 6; ++i) {
        versavis_next(stream, &item, 0);
        versavis_image image = VERSAVIS_IMAGE_INIT;
        if (versavis_view(&item, &image) != VERSAVIS_OK) continue;
        volatile std::uint8_t last = image.data[std::size_t{image.stride} * image.height - 1];
        static_cast<void>(last);
    }
    versavis_release(&item);
    versavis_close(stream);
}

}  // namespace

TEST_CASE("segment_fuzz: 100000 headers lead no reader astray") {
    FuzzVictim victim(StreamKind::frames);
    std::uint64_t opened = 0;
    std::uint64_t sum = 0;
    for (int i = 0; i < 100'000; ++i) {
        victim.heal();
        if (i % 2 == 0) victim.damage();
        Options options;
        options.start = Position::oldest;
        auto reader = Reader::open(victim.path(), options);
        if (!reader) continue;
        ++opened;
        if (i % 2 != 0) victim.damage();  // after it was mapped and checked
        sum += use(*reader);
        if (i % 16 == 0) use_from_c(victim.instance());
    }
    CHECK(opened > 50'000);
    CHECK(opened < 100'000);
    CHECK(sum > 0);
    victim.heal();
}

TEST_CASE("segment_fuzz: the tool lists and prints what it can, of every kind") {
    for (const StreamKind kind : {StreamKind::frames, StreamKind::imu, StreamKind::events,
                                  StreamKind::status, StreamKind::evidence, StreamKind::clock}) {
        std::fflush(nullptr);  // or the child writes what waits there once more
        CHECK(test::in_process([&] {
            if (std::freopen("/dev/null", "w", stdout) == nullptr ||
                std::freopen("/dev/null", "w", stderr) == nullptr)
                return false;
            FuzzVictim victim(kind);
            for (int i = 0; i < 1500; ++i) {
                victim.damage();
                if (!client::list_streams(victim.instance(), i % 2 == 0)) return false;
                int looks = 0;
                client::TailSettings settings{
                    victim.instance(), "victim", 3, i % 2 == 0, true, [&] { return ++looks > 4; }};
                settings.wait = Duration{};
                static_cast<void>(client::tail(settings));
                victim.heal();
            }
            return true;
        }));
    }
}
