// SPDX-License-Identifier: BSD-3-Clause
// Puts the packets of plain images together, says which are to be sent again, and when a frame is
// given up. Whatever packets say, nothing is written beside a frame's own memory.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "camera/gvsp.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// Not thread-safe. Frames are handed over in the order in which the camera sent them.
class FrameAssembler {
 public:
    struct Memory {
        std::uint32_t slot = 0;
        std::uint8_t* data = nullptr;  ///< as many bytes as the payload
    };
    struct Frame {
        std::uint64_t block_id = 0;
        Memory memory;
        std::optional<gvsp::Leader> leader;
        std::uint64_t size = 0;  ///< bytes that the camera sent of it
        bool complete = false;
    };
    class Owner {
     public:
        /// None: there is no room, the frame is lost.
        virtual std::optional<Memory> begin_frame() = 0;
        virtual void end_frame(const Frame& frame) = 0;
        virtual void ask(const gvsp::PacketRange& range) = 0;

     protected:
        ~Owner() = default;
    };
    struct Settings {
        std::size_t payload = 0;      ///< bytes of a frame
        std::size_t packet_size = 0;  ///< IP header included
        bool sends_again = true;      ///< the camera does, when it is asked
        Duration retention;           ///< a frame of which nothing came for so long is given up
    };

    FrameAssembler(const Settings& settings, Owner& owner) : settings_(settings), owner_(owner) {}

    void take(gvsp::Bytes datagram, HostTime now);

    /// After what arrived so far was taken: asks, hands over, gives up.
    void advance(HostTime now);

    /// When advance() has to be called, even if nothing arrives; none: no frame is open.
    std::optional<HostTime> deadline(HostTime now) const;

    /// How long the rest of the newest frame will probably take, as fast as it came so far and as
    /// long as others took; none: nothing but what is sent again is expected.
    std::optional<Duration> time_left(HostTime now) const;

    /// Slots of frames that are open: they are the owner's again.
    std::vector<std::uint32_t> close();

 private:
    struct Open : Frame {
        bool extended = false;
        std::size_t per_packet = 0;
        std::vector<std::uint8_t> packets;  ///< by id: how often it was asked for, or `here`
        std::uint32_t here_count = 0;
        std::uint32_t newest_id = 0;  ///< the highest that came
        std::uint32_t trailer = 0;    ///< its id; 0: it did not come
        std::uint32_t short_id = 0;   ///< of data that did not fill its packet; 0: all did
        std::uint64_t beyond = 0;     ///< where data ended that has no place in the frame
        std::uint32_t budget = 0;     ///< packets that may still be asked for
        HostTime first_data;          ///< when the first of its data came
        HostTime newest;              ///< when something of it came
        HostTime asked;
        bool done = false;

        std::uint32_t last_id() const { return static_cast<std::uint32_t>(packets.size() - 1); }
    };

    Open* find(const gvsp::Packet& packet);
    Open* begin(const gvsp::Packet& packet);
    void take_data(Open& frame, const gvsp::Packet& packet) const;
    void note(Open& frame, const gvsp::Packet& packet) const;
    void finish_if_complete(Open& frame);
    void ask(Open& frame, std::uint32_t until, HostTime now);
    void ask_for_missing(Open& frame, bool followed, HostTime now);
    static std::uint32_t due_until(const Open& frame, bool followed);

    Settings settings_;
    Owner& owner_;
    std::deque<Open> frames_;
    std::uint64_t newest_block_ = 0;  ///< 0: none yet
    Duration length_;                 ///< from a frame's first data to its end, usually
};

}  // namespace versavis::daemon
