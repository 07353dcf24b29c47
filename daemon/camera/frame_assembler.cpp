// SPDX-License-Identifier: BSD-3-Clause
#include "camera/frame_assembler.hpp"

#include <algorithm>
#include <cstring>

namespace versavis::daemon {

namespace {

/// Of a packet that came; less: how often it was asked for.
constexpr std::uint8_t here = 0xFF;

/// How often one packet is asked for.
constexpr std::uint8_t most_asks = 3;

/// What a camera takes to send a packet again.
constexpr Duration resend_time = milliseconds(3);

/// Silence within a frame after which its last packets are asked for.
constexpr Duration silence = milliseconds(1);

/// Part of a frame's packets that may be asked for.
constexpr std::uint32_t part_to_ask_for = 4;

/// A frame whose number is behind the newest by less is late, not new: its packets were lost on a
/// detour, or sent again too late.
constexpr std::uint64_t numbers_of_late_frames = 100;

constexpr std::size_t most_open = 4;

/// Frames after which most of a longer length is believed; a shorter one is at once.
constexpr int length_memory = 8;

/// A frame is never of more packets: numbers of 24 bits must do.
constexpr std::size_t most_packets = 1 << 24;

}  // namespace

void FrameAssembler::take(gvsp::Bytes datagram, HostTime now) {
    const auto packet = gvsp::parse_packet(datagram);
    Open* frame = packet ? find(*packet) : nullptr;
    if (frame == nullptr || frame->done) return;
    frame->newest = now;
    switch (packet->format) {
        case gvsp::Format::leader: {
            const auto leader = gvsp::parse_leader(packet->body);
            if (!leader || frame->leader) return;
            frame->leader = leader;
            frame->done = !leader->image;
            note(*frame, *packet);
            break;
        }
        case gvsp::Format::payload: take_data(*frame, *packet); break;
        case gvsp::Format::trailer:
            if (packet->id > frame->last_id()) {  // larger than announced
                frame->size = std::max<std::uint64_t>(frame->beyond, settings_.payload + 1);
                frame->complete = frame->leader.has_value();
                frame->done = true;
            } else if (packet->id > frame->newest_id && frame->trailer == 0) {
                frame->trailer = packet->id;
                note(*frame, *packet);
            }
            break;
    }
    finish_if_complete(*frame);
}

void FrameAssembler::take_data(Open& frame, const gvsp::Packet& packet) const {
    const std::size_t size = packet.body.size();
    if (size == 0 || size > frame.per_packet) return;
    if (frame.trailer != 0 && packet.id >= frame.trailer) return;
    const std::uint64_t begin = std::uint64_t{packet.id - 1} * frame.per_packet;
    if (packet.id >= frame.last_id()) {
        frame.beyond = std::max(frame.beyond, begin + size);
        return;
    }
    if (frame.packets[packet.id] == here) return;
    // The last packet may be filled up.
    const std::size_t used = std::min<std::uint64_t>(size, settings_.payload - begin);
    if (size < frame.per_packet && packet.id + 1 < frame.last_id()) {
        if (frame.short_id != 0) return;
        frame.short_id = packet.id;
    }
    std::memcpy(frame.memory.data + begin, packet.body.data(), used);
    frame.size += used;
    note(frame, packet);
}

void FrameAssembler::note(Open& frame, const gvsp::Packet& packet) const {
    if (frame.newest_id == 0) frame.first_data = frame.newest;
    frame.packets[packet.id] = here;
    ++frame.here_count;
    frame.newest_id = std::max(frame.newest_id, packet.id);
}

void FrameAssembler::finish_if_complete(Open& frame) {
    if (frame.done || frame.trailer == 0 || !frame.leader || frame.here_count <= frame.trailer)
        return;
    frame.done = true;
    frame.complete = frame.short_id == 0 || frame.short_id + 1 == frame.trailer;
    if (!frame.complete) return;
    const Duration length = frame.newest - frame.first_data;
    length_ = std::min(length, length_ + (length - length_) / length_memory);
}

FrameAssembler::Open* FrameAssembler::find(const gvsp::Packet& packet) {
    for (Open& frame : frames_)
        if (frame.block_id == packet.block_id && frame.extended == packet.extended) return &frame;
    std::uint64_t behind = newest_block_ - packet.block_id;
    if (!packet.extended) behind &= 0xFFFFU;
    const bool late = newest_block_ != 0 && behind < numbers_of_late_frames;
    return late ? nullptr : begin(packet);
}

/// Null: its packets are dropped.
FrameAssembler::Open* FrameAssembler::begin(const gvsp::Packet& packet) {
    const std::size_t per_packet = gvsp::data_per_packet(settings_.packet_size, packet.extended);
    const std::size_t data_packets =
        per_packet == 0 ? 0 : (settings_.payload + per_packet - 1) / per_packet;
    if (data_packets == 0 || data_packets > most_packets) return nullptr;
    newest_block_ = packet.block_id;
    if (frames_.size() == most_open) {
        owner_.end_frame(frames_.front());
        frames_.pop_front();
    }
    const auto memory = owner_.begin_frame();
    if (!memory) return nullptr;
    Open& frame = frames_.emplace_back();
    frame.block_id = packet.block_id;
    frame.memory = *memory;
    frame.extended = packet.extended;
    frame.per_packet = per_packet;
    frame.packets.resize(data_packets + 2);  // leader and trailer
    frame.budget =
        settings_.sends_again ? static_cast<std::uint32_t>(data_packets) / part_to_ask_for + 1 : 0;
    return &frame;
}

/// All packets up to this one should have come.
std::uint32_t FrameAssembler::due_until(const Open& frame, bool followed) {
    if (frame.trailer != 0) return frame.trailer;
    return followed ? frame.last_id() : frame.newest_id;
}

/// Packets that did not come, and are not on the way again.
void FrameAssembler::ask(Open& frame, std::uint32_t until, HostTime now) {
    const bool again = now - frame.asked >= resend_time;
    const auto wanted = [&](std::uint32_t id) {
        return frame.packets[id] == 0 ||
               (again && frame.packets[id] < most_asks);  // which `here` is not
    };
    bool asked = false;
    for (std::uint32_t first = 0; first <= until; ++first) {
        if (!wanted(first)) continue;
        std::uint32_t last = first;
        while (last < until && wanted(last + 1)) ++last;
        for (std::uint32_t id = first; id <= last; ++id) ++frame.packets[id];
        const std::uint32_t count = last - first + 1;
        if (count <= frame.budget) {
            frame.budget -= count;
            owner_.ask({frame.block_id, frame.extended, first, last});
        }
        asked = true;
        first = last;
    }
    if (asked) frame.asked = now;
}

void FrameAssembler::ask_for_missing(Open& frame, bool followed, HostTime now) {
    const std::uint32_t due = due_until(frame, followed);
    const bool gaps = frame.here_count <= due;
    if (gaps) ask(frame, due, now);
    const bool silent = frame.newest_id > 0 && now - frame.newest >= silence;
    const std::uint32_t rest = frame.last_id() - due;
    if (silent && frame.trailer == 0 && rest <= frame.budget) ask(frame, frame.last_id(), now);
    const auto gone = [&](std::uint8_t asks) { return asks == most_asks; };
    const bool unanswered = now - std::max(frame.asked, frame.newest) >= resend_time;
    frame.done = now - frame.newest >= settings_.retention ||
                 (gaps && unanswered &&
                  std::any_of(frame.packets.begin(), frame.packets.begin() + due + 1, gone));
}

void FrameAssembler::advance(HostTime now) {
    bool followed = false;
    for (auto frame = frames_.rbegin(); frame != frames_.rend(); ++frame) {
        if (!frame->done) ask_for_missing(*frame, followed, now);
        followed = followed || frame->newest_id > 0;
    }
    for (; !frames_.empty() && frames_.front().done; frames_.pop_front())
        owner_.end_frame(frames_.front());
}

std::optional<HostTime> FrameAssembler::deadline(HostTime now) const {
    std::optional<HostTime> first;
    for (const Open& frame : frames_)
        for (const HostTime at : {frame.newest + silence, frame.asked + resend_time,
                                  frame.newest + resend_time, frame.newest + settings_.retention})
            if (at > now && (!first || at < *first)) first = at;
    return first;
}

std::optional<Duration> FrameAssembler::time_left(HostTime now) const {
    if (frames_.empty() || frames_.back().done || frames_.back().trailer != 0) return std::nullopt;
    const Open& frame = frames_.back();
    if (frame.newest_id == 0) return Duration{};
    const Duration so_far = now - frame.first_data;
    const Duration left = so_far * (frame.last_id() - frame.newest_id) / frame.newest_id;
    // It may have begun slowly. Of what others took, half is sure: they were seen late, too.
    return std::max(std::min(left, so_far * 2), (length_ - so_far) / 2);
}

std::vector<std::uint32_t> FrameAssembler::close() {
    std::vector<std::uint32_t> slots;
    for (const Open& frame : frames_) slots.push_back(frame.memory.slot);
    frames_.clear();
    return slots;
}

}  // namespace versavis::daemon
