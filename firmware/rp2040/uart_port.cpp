// SPDX-License-Identifier: BSD-3-Clause
#include "uart_port.hpp"

#include <utility>

#include "clocks.hpp"
#include "pins.hpp"
#include "state_machine.hpp"

namespace versavis::rp2040 {

namespace {

enum Flag : std::uint32_t { receive_empty = 1U << 4U, transmit_full = 1U << 5U };
enum UartInterrupt : std::uint32_t {
    uart_received = 1U << 4U,
    uart_wants_more = 1U << 5U,
    uart_paused = 1U << 6U,  ///< bytes wait, and none came for four characters
};

constexpr std::uint32_t default_baud = 115'200;

}  // namespace

void UartPort::set_up() {
    set_function(pin_uart_transmit, function_uart);
    set_function(pin_uart_receive, function_uart);
    set_baud(default_baud);
}

void UartPort::set_baud(std::uint32_t baud) {
    if (std::exchange(baud_, baud) == baud) return;
    constexpr std::uint32_t bits_8_with_fifo = 3U << 5U | 1U << 4U;
    constexpr std::uint32_t on = 1U << 0U | 1U << 8U | 1U << 9U;
    restart_blocks(reset_uart0);
    const std::uint32_t in_64ths = (8 * clock_hz / (baud == 0 ? 1 : baud) + 1) / 2;
    uart0().divisor = in_64ths >> 6U;
    uart0().fraction = in_64ths & 63U;
    uart0().line = bits_8_with_fifo;
    uart0().levels = 0;  // an interrupt for each four bytes
    uart0().control = on;
    uart0().interrupt_mask = uart_received | uart_paused;
}

void UartPort::invert_transmitter(bool inverted) {
    set_function(pin_uart_transmit, function_uart, override_none,
                 inverted ? override_invert : override_none);
}

void UartPort::write(const std::uint8_t* data, std::size_t size) {
    for (std::size_t i = 0; i < size && written_ - sent_ < outgoing_room; ++i) {
        outgoing_[written_ % outgoing_room] = data[i];
        written_ = written_ + 1;
    }
    const InterruptsOff undisturbed;
    send();
}

void UartPort::send() {
    while (sent_ != written_ && (uart0().flags & transmit_full) == 0) {
        uart0().data = outgoing_[sent_ % outgoing_room];
        sent_ = sent_ + 1;
    }
    uart0().interrupt_mask =
        uart_received | uart_paused | (sent_ != written_ ? std::uint32_t{uart_wants_more} : 0U);
}

void UartPort::moved() {
    const std::uint32_t before = arrived_;
    while ((uart0().flags & receive_empty) == 0) {
        const auto byte = static_cast<std::uint8_t>(uart0().data);
        if (arrived_ - read_ == room || ended_ - begun_ == chunks) continue;  // it is lost
        incoming_[arrived_ % room] = byte;
        arrived_ = arrived_ + 1;
    }
    if (arrived_ != before) {
        chunk_[ended_ % chunks] = {clock_.now(), arrived_};
        ended_ = ended_ + 1;
        wake_flag_.ask();
    }
    uart0().interrupt_clear = uart_received | uart_paused | uart_wants_more;
    send();
}

std::size_t UartPort::read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) {
    if (begun_ == ended_) return 0;
    const Chunk& chunk = chunk_[begun_ % chunks];
    std::size_t size = 0;
    for (; size < capacity && read_ != chunk.end; ++size) {
        data[size] = incoming_[read_ % room];
        read_ = read_ + 1;
    }
    received = chunk.at;
    if (read_ == chunk.end) begun_ = begun_ + 1;
    return size;
}

}  // namespace versavis::rp2040
