// SPDX-License-Identifier: BSD-3-Clause
// Any packets of a board, with a valid CRC, through what the service holds their numbers and times
// against.
#include <algorithm>
#include <cstring>

#include "board/board_event.hpp"
#include "device/handshake.hpp"
#include "engine/imu/imu_model.hpp"
#include "engine/pairing/record_filter.hpp"
#include "fuzz.hpp"
#include "plausibility/arrival_check.hpp"
#include "plausibility/event_validator.hpp"
#include "plausibility/packet_check.hpp"
#include "wire/packet.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr HostTime begin{100'000'000'000};

class Service {
 public:
    Service() : translator_(*clock::OutputClock::create(clock::OutputClockKind::monotonic_raw)) {
        exchange({0, 0, begin.ns, begin.ns});
        exchange({0, 0, begin.ns, begin.ns});
    }

    void take(const wire::Packet& packet, HostTime now) {
        now_ = now;
        if (device::read_greeting(packet)) return;
        if (!sequence_.add(packet.header.sequence)) return;
        use<wire::Exposure>(packet, [&](const auto& record) { exposure(record); });
        use<wire::ImuSample>(packet, [&](const auto& sample) { imu_sample(sample); });
        use<wire::Event>(packet, [&](const auto& event) { board_event(event); });
        use<wire::ClockAnswer>(packet, [&](const auto& answer) { exchange(answer); });
        use<wire::Health>(packet, [](const auto&) {});
        use<wire::ClockFollowUp>(packet, [](const auto&) {});
        use<wire::Sentence>(packet, [](const auto&) {});
    }

 private:
    template <class T, class Use>
    static void use(const wire::Packet& packet, Use&& use) {
        T message{};
        if (packet.read(message) && possible(message)) use(message);
    }

    void exchange(const wire::ClockAnswer& answer) {
        translator_.add({now_ - microseconds(500), BoardTime{answer.received_ns},
                         BoardTime{answer.sent_ns}, now_});
    }

    void exposure(const wire::Exposure& record) {
        pairing::ReceivedRecord received;
        received.record = record;
        received.exchanges = translator_.contact().exchanges;
        const auto arrival = arrival_delay(pairing::newest_instant(record), now_, translator_);
        if (arrival && arrival->doubt) received.arrival = arrival->doubt->reason;
        if (!records_.judge(received).doubt)
            static_cast<void>(translator_.translate(BoardTime{record.start_ns}));
    }

    void imu_sample(const wire::ImuSample& sample) {
        const Pulse pulse{sample.number, BoardTime{sample.time_ns}};
        const BoardTime departed = pulse.at + Duration{sample.departure_ns};
        const auto arrival = arrival_delay(departed, now_, translator_);
        const auto contact = translator_.contact();
        if (samples_.judge(pulse, contact.exchanges, arrival ? arrival->doubt : std::nullopt) &&
            samples_.stepped(contact.exchanges))
            samples_.adopt(pulse);
        for (const std::string& name : imu::model_names())
            static_cast<void>(imu::to_si(*imu::find_model(name), sample));
        translator_.add(clock::OneWay{departed, now_});
    }

    void board_event(const wire::Event& event) {
        static_cast<void>(remark(event));
        static_cast<void>(journal_entry(event));
        records_.triggers_skipped(skipped_triggers(event));
        if (events_.judge(event, now_)) return;
        if (event.kind == wire::BoardEventKind::pps)
            translator_.pps_pulse(BoardTime{event.time_ns});
        if (event.kind == wire::BoardEventKind::utc_label)
            static_cast<void>(
                translator_.pps_label(BoardTime{event.time_ns}, event.value * 1'000'000'000));
    }

    HostTime now_ = begin;
    SequenceWatch sequence_;
    clock::Translator translator_;
    EventValidator events_{translator_};
    pairing::RecordFilter records_{{}};
    MajorityFilter<PulseHistory> samples_{PulseHistory(milliseconds(5), microseconds(50), 1000)};
};

/// As a board sends it.
void encode(fuzz::Bytes bytes, std::vector<std::uint8_t>& out) {
    std::uint8_t raw[wire::max_packet_size] = {};
    const std::size_t body = std::min(bytes.size(), sizeof raw - wire::crc_size);
    std::copy_n(bytes.begin(), body, raw);
    const std::uint32_t crc = wire::crc32(raw, body);
    std::memcpy(raw + body, &crc, wire::crc_size);
    out.resize(wire::max_frame_size);
    out.resize(wire::cobs_encode(raw, body + wire::crc_size, out.data()));
    out.push_back(0);
}

}  // namespace

/// Each message: how long after the one before it, in ms, and a packet without its CRC.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Service service;
    wire::Decoder decoder;
    fuzz::Messages messages({data, size});
    HostTime now = begin;
    std::vector<std::uint8_t> encoded;
    while (!messages.empty()) {
        now = now + milliseconds(messages.byte());
        encode(messages.next(), encoded);
        decoder.feed(encoded.data(), encoded.size(),
                     [&](const wire::Packet& packet) { service.take(packet, now); });
    }
    return 0;
}
