// SPDX-License-Identifier: BSD-3-Clause
#include "usb_device.hpp"

#include "reboot_port.hpp"
#include "usb_descriptors.hpp"

namespace versavis::rp2040 {

namespace {

enum BufferBit : std::uint32_t {
    buffer_full = 1U << 15U,
    buffer_last = 1U << 14U,
    buffer_odd = 1U << 13U,
    buffer_stall = 1U << 11U,
    buffer_available = 1U << 10U,
    buffer_size = 0x3FFU,
};

// Buffers that are done, by the bits of the controller.
constexpr std::uint32_t control_in = 1U << 0U;
constexpr std::uint32_t control_out = 1U << 1U;
constexpr std::uint32_t data_in = 1U << (2U * usb::data_endpoint);
constexpr std::uint32_t data_out = 1U << (2U * usb::data_endpoint + 1U);

enum Toggle : unsigned { toggle_control, toggle_in, toggle_out };

enum InterruptBit : std::uint32_t {
    usb_buffer_done = 1U << 4U,
    usb_bus_reset = 1U << 12U,
    usb_setup = 1U << 16U,
    usb_frame = 1U << 17U,
};
constexpr std::uint32_t status_line = 3U << 2U;  // 0: in reset
constexpr std::uint32_t status_suspended = 1U << 4U;
constexpr std::uint32_t status_setup = 1U << 17U;
constexpr std::uint32_t status_bus_reset = 1U << 19U;
/// Checksum, bit stuffing, overflow, an acknowledgement that did not come, wrong sequence.
constexpr std::uint32_t status_errors = 0xFU << 24U | 1U << 31U;

constexpr std::uint32_t pull_up = 1U << 16U;

/// Between looks at the controller, and how long the board stays off the bus. If lower, a hub may
/// not notice; if higher, the link is away for longer.
constexpr std::uint32_t watch_us = 100'000;
/// Bad checks in a row before the controller is reset. If lower, a host that is busy at its start
/// is too slow; if higher, the link is away for longer.
constexpr unsigned patience = 20;
constexpr unsigned is_certain = 4;
constexpr unsigned is_likely = 1;
/// Frames come each millisecond; after 3 ms without a bus is suspended. If lower, that may not be
/// known.
constexpr std::uint32_t deaf_after_us = 10'000;

/// Erratum E15: a hub may corrupt what ends close to the next frame, and the controller then hangs.
/// No packet is offered in the rest of a frame. If lower, the link is slower; later, a packet (53
/// us) and the wait for the host come too close to the end.
constexpr std::uint32_t late_us = 800;
constexpr std::uint32_t frame_us = 1000;

enum Request : std::uint8_t {
    get_status = 0,
    clear_feature = 1,
    set_feature = 3,
    set_address = 5,
    get_descriptor = 6,
    get_configuration = 8,
    set_configuration = 9,
    get_interface = 10,
    set_interface = 11,
    set_line_coding = 0x20,
    get_line_coding = 0x21,
    set_control_line_state = 0x22,
    send_break = 0x23,
};

enum DescriptorType : std::uint8_t { of_device = 1, of_configuration = 2, text = 3 };

constexpr std::uint8_t to_host = 0x80;
constexpr std::uint8_t of_class = 0x20;
constexpr std::uint8_t kind_mask = 0x60;
constexpr std::uint8_t recipient_mask = 0x1F;
constexpr std::uint8_t an_endpoint = 2;
constexpr std::uint8_t endpoint_mask = 0x0F;

/// A host that sets this rate and drops DTR wants the boot loader.
constexpr std::uint32_t touch_baud = 1200;

// Where the data endpoints have their buffers in the controller's memory.
constexpr std::uint32_t memory_in = 0x180;
constexpr std::uint32_t memory_out = 0x1C0;
constexpr std::uint32_t memory_notice = 0x200;
/// Nobody else writes them while the controller does not have them.
std::uint8_t* in_packet() { return const_cast<std::uint8_t*>(usb_memory().data); }
std::uint8_t* out_packet() { return in_packet() + (memory_out - memory_in); }

/// The controller looks at the rest of the word when `available` is set, and needs 12 cycles of the
/// processor's clock to see it.
void hand_over(Register& buffer, std::uint32_t word) {
    buffer = word;
    __asm__ volatile("b 1f\n1: b 1f\n1: b 1f\n1: b 1f\n1: b 1f\n1: b 1f\n1:\n");
    buffer = word | buffer_available;
}

/// Of an endpoint as requests name them, but 0.
Register* buffer_of(std::uint16_t index) {
    UsbEndpoint& data = usb_memory().buffers[usb::data_endpoint];
    switch (index) {
        case usb::data_endpoint: return &data.out;
        case to_host | usb::data_endpoint: return &data.in;
        case to_host | usb::notice_endpoint: return &usb_memory().buffers[usb::notice_endpoint].in;
        default: return nullptr;
    }
}

const char* const texts[] = {nullptr, "VersaVIS", "VersaVIS trigger board"};

}  // namespace

void UsbDevice::begin(const char* serial) {
    serial_ = serial;
    start();
    watch();
}

void UsbDevice::start() {
    constexpr std::uint32_t to_phy = 1U << 0U;
    constexpr std::uint32_t soft_connect = 1U << 3U;
    constexpr std::uint32_t detect_supply = 1U << 2U;
    constexpr std::uint32_t detect_by_force = 1U << 3U;
    constexpr std::uint32_t interrupt_each_buffer = 1U << 29U;
    host_ = Host::silent;
    was_reset_ = has_setup_ = has_failed_ = detached_ = false;
    evidence_ = 0;
    restart_blocks(reset_usb);
    auto* const memory = &usb_memory().controls[0].in;
    for (unsigned i = 0; i < 2 * (15 + 16); ++i) memory[i] = 0;
    usb_registers().muxing = to_phy | soft_connect;
    usb_registers().power = detect_supply | detect_by_force;
    usb_registers().control = 1;
    usb_registers().serial_control = interrupt_each_buffer;
    usb_registers().interrupt_enable = usb_buffer_done | usb_bus_reset | usb_setup | usb_frame;
    set_bits(usb_registers().serial_control, pull_up);
}

void UsbDevice::note() {
    const std::uint32_t at_us = timer().low;
    const std::uint32_t causes = usb_registers().interrupt_status;
    if ((causes & usb_buffer_done) != 0) {
        const std::uint32_t done = usb_registers().buffer_status;
        usb_registers().buffer_status = done;
        done_ = done_ | done;
        if ((done & data_in) != 0) data_in_at_us_ = at_us;
        if ((done & data_out) != 0) data_out_at_us_ = at_us;
    }
    if ((causes & usb_frame) != 0) {
        static_cast<void>(usb_registers().start_of_frame);  // which takes the cause away
        frame_at_us_ = at_us;
        if (causes == usb_frame && !awaits_frame_) return;
    }
    if ((causes & usb_bus_reset) != 0) {
        usb_registers().serial_status = status_bus_reset;
        was_reset_ = true;
    }
    if ((causes & usb_setup) != 0) {
        usb_registers().serial_status = status_setup;
        has_setup_ = true;
    }
    interrupt_controller().set_pending = 1U << interrupt_usb_work;
}

void UsbDevice::work() {
    if (was_reset_) {
        was_reset_ = false;
        reset_bus();
    }
    if (done_ != 0) handle_buffers(take_done());
    if (has_setup_) {
        has_setup_ = false;
        handle_setup();
    }
    if (!configured_) return;
    receive_data();
    send_data();
}

void UsbDevice::watch() {
    timer().raw_interrupts = 1U << 3U;
    timer().alarms[3] = timer().low + watch_us;
    if (detached_) return start();
    const unsigned found = evidence();
    evidence_ = found == 0 ? 0 : evidence_ + found;
    if (evidence_ < patience) return;
    usb_registers().interrupt_enable = 0;
    clear_bits(usb_registers().serial_control, pull_up);
    reset_bus();
    detached_ = true;
}

/// Evidence of a hang, which the controller does not report. Nor does it show what the host asks
/// for: a packet that waits may be one that nobody wants. But
/// - a bus that is not suspended has frames: a controller that hears none is deaf (erratum E5,
///   too);
/// - after a reset, a host has a request;
/// - a packet that failed is asked for again at once.
unsigned UsbDevice::evidence() {
    const std::uint32_t status = usb_registers().serial_status;
    const bool deaf = timer().low - frame_at_us_ > deaf_after_us;
    usb_registers().serial_status = status & (status_errors | (deaf ? 0 : status_suspended));
    if ((status & status_errors) != 0) has_failed_ = true;
    const bool at_rest = (status & status_suspended) != 0 || (status & status_line) == 0;
    if (host_ == Host::silent || at_rest) return 0;
    if (deaf) return is_certain;
    return host_ == Host::has_reset || (has_failed_ && sending_) ? is_likely : 0;
}

void UsbDevice::reset_bus() {
    host_ = Host::has_reset;
    usb_registers().address = 0;
    address_ = 0;
    done_ = 0;
    takes_coding_ = ready_ = false;
    more_ = nullptr;
    configure(false);
}

std::uint32_t UsbDevice::take_done() {
    const InterruptsOff undisturbed;
    const std::uint32_t done = done_;
    done_ = 0;
    return done;
}

void UsbDevice::handle_buffers(std::uint32_t done) {
    has_failed_ = false;
    if ((done & control_in) != 0) {
        if (address_ != 0) {
            usb_registers().address = address_;
            address_ = 0;
        }
        if (more_ != nullptr) send_more();
    }
    if ((done & control_out) != 0 && takes_coding_) take_control_data();
    if ((done & data_in) != 0 && sending_) {
        sending_ = false;
        link_.sent(sent_size_, data_in_at_us_);
    }
    if ((done & data_out) != 0 && receiving_) {
        receiving_ = false;
        link_.receive(out_packet(), usb_memory().buffers[usb::data_endpoint].out & buffer_size,
                      data_out_at_us_);
    }
}

void UsbDevice::handle_setup() {
    const volatile std::uint8_t* bytes = usb_memory().setup;
    const auto word = [bytes](unsigned at) {
        return static_cast<std::uint16_t>(bytes[at] | bytes[at + 1] << 8U);
    };
    const Setup setup{bytes[0], bytes[1], word(2), word(4), word(6)};
    host_ = Host::asks;
    more_ = nullptr;
    takes_coding_ = false;
    toggles_[toggle_control] = buffer_odd;
    const bool known = (setup.type & kind_mask) == of_class ? answer_class(setup) : answer(setup);
    if (known) return;
    usb_registers().stall_arm = control_in | control_out;
    usb_memory().buffers[0].in = buffer_stall;
    usb_memory().buffers[0].out = buffer_stall;
}

bool UsbDevice::answer(const Setup& setup) {
    const bool endpoint = (setup.type & recipient_mask) == an_endpoint;
    switch (setup.request) {
        case get_descriptor: return describe(setup);
        case set_address:
            address_ = static_cast<std::uint8_t>(setup.value & 0x7FU);
            reply(nullptr, 0, 0);
            return true;
        case set_configuration:
            if (setup.value > 1) return false;
            configure(setup.value == 1);
            reply(nullptr, 0, 0);
            return true;
        case get_configuration:
            answer_[0] = configured_ ? 1 : 0;
            reply(answer_, 1, setup.length);
            return true;
        case get_status:
            answer_[0] = answer_[1] = 0;
            if (endpoint && (setup.index & endpoint_mask) != 0) {
                const Register* const buffer = buffer_of(setup.index);
                if (buffer == nullptr) return false;
                answer_[0] = (*buffer & buffer_stall) != 0;
            }
            reply(answer_, 2, setup.length);
            return true;
        case clear_feature:
        case set_feature:
            if (!endpoint || setup.value != 0 || !halt(setup.index, setup.request == set_feature))
                return false;
            reply(nullptr, 0, 0);
            return true;
        case get_interface:
            answer_[0] = 0;
            reply(answer_, 1, setup.length);
            return true;
        case set_interface:
            if (setup.value != 0) return false;
            if (setup.index == usb::data_interface) {
                halt(usb::data_endpoint, false);
                halt(to_host | usb::data_endpoint, false);
            }
            reply(nullptr, 0, 0);
            return true;
        default: return false;
    }
}

bool UsbDevice::answer_class(const Setup& setup) {
    switch (setup.request) {
        case set_line_coding:
            takes_coding_ = true;
            hand_over(usb_memory().buffers[0].out, buffer_odd | usb::packet_size);
            return true;
        case get_line_coding: reply(coding_, sizeof coding_, setup.length); return true;
        case set_control_line_state: {
            const bool ready = (setup.value & 1U) != 0;
            const std::uint32_t baud = coding_[0] | coding_[1] << 8U |
                                       static_cast<std::uint32_t>(coding_[2]) << 16U |
                                       static_cast<std::uint32_t>(coding_[3]) << 24U;
            if (ready_ && !ready && baud == touch_baud) enter_boot_loader();
            if (ready && !ready_) link_.forget(sending_ ? sent_size_ : 0);
            ready_ = ready;
            reply(nullptr, 0, 0);
            return true;
        }
        case send_break: reply(nullptr, 0, 0); return true;
        default: return false;
    }
}

bool UsbDevice::describe(const Setup& setup) {
    switch (setup.value >> 8U) {
        case of_device: reply(usb::device, sizeof usb::device, setup.length); return true;
        case of_configuration:
            reply(usb::configuration, sizeof usb::configuration, setup.length);
            return true;
        case text:
            if ((setup.value & 0xFFU) > usb::text_serial) return false;
            describe_text(setup.value & 0xFFU);
            reply(answer_, answer_[0], setup.length);
            return true;
        default: return false;
    }
}

void UsbDevice::describe_text(unsigned index) {
    std::size_t size = 2;
    const auto add = [&](std::uint8_t low, std::uint8_t high) {
        answer_[size++] = low;
        answer_[size++] = high;
    };
    if (index == usb::text_languages) {
        add(0x09, 0x04);  // English, United States
    } else {
        const char* from = index == usb::text_serial ? serial_ : texts[index];
        for (; *from != '\0' && size + 2 <= sizeof answer_; ++from)
            add(static_cast<std::uint8_t>(*from), 0);
    }
    answer_[0] = static_cast<std::uint8_t>(size);
    answer_[1] = text;
}

/// Either way, the next packet is DATA0.
bool UsbDevice::halt(std::uint16_t index, bool halted) {
    Register* const buffer = buffer_of(index);
    if (buffer == nullptr) return (index & endpoint_mask) == 0 && !halted;
    *buffer = halted ? std::uint32_t{buffer_stall} : 0U;
    if (index == usb::data_endpoint) {
        toggles_[toggle_out] = 0;
        receiving_ = false;
    } else if (index == (to_host | usb::data_endpoint)) {
        toggles_[toggle_in] = 0;
        if (sending_ && !halted) hand_in();  // what the host does not have yet
    }
    return true;
}

void UsbDevice::configure(bool configured) {
    constexpr std::uint32_t enable = 1U << 31U | 1U << 29U;  // with an interrupt for each buffer
    constexpr std::uint32_t bulk = 2U << 26U;
    constexpr std::uint32_t interrupt = 3U << 26U;
    UsbMemory& memory = usb_memory();
    memory.controls[usb::data_endpoint - 1].in = configured ? enable | bulk | memory_in : 0;
    memory.controls[usb::data_endpoint - 1].out = configured ? enable | bulk | memory_out : 0;
    memory.controls[usb::notice_endpoint - 1].in =
        configured ? enable | interrupt | memory_notice : 0;
    memory.buffers[usb::data_endpoint].in = 0;
    memory.buffers[usb::data_endpoint].out = 0;
    memory.buffers[usb::notice_endpoint].in = 0;
    toggles_[toggle_in] = toggles_[toggle_out] = 0;
    receiving_ = sending_ = awaits_frame_ = false;
    sent_size_ = 0;
    configured_ = configured;
    link_.forget(0);
}

/// Data for the host, at most as much as it wanted, or, without any, the end of a request.
void UsbDevice::reply(const void* data, std::size_t size, std::size_t wanted) {
    more_ = static_cast<const std::uint8_t*>(data);
    more_size_ = size < wanted ? size : wanted;
    ends_short_ = size < wanted && size % usb::packet_size == 0;
    send_more();
}

void UsbDevice::send_more() {
    const std::size_t size = more_size_ < usb::packet_size ? more_size_ : usb::packet_size;
    for (std::size_t i = 0; i < size; ++i) usb_memory().data0[i] = more_[i];
    hand_over(usb_memory().buffers[0].in,
              static_cast<std::uint32_t>(size) | buffer_full | toggles_[toggle_control]);
    toggles_[toggle_control] ^= buffer_odd;
    if (more_ == nullptr) return;
    more_ += size;
    more_size_ -= size;
    if (more_size_ > 0) return;
    if (ends_short_ && size > 0) {
        ends_short_ = false;
        return;
    }
    more_ = nullptr;
    // The host ends the request with an empty packet.
    hand_over(usb_memory().buffers[0].out, buffer_odd);
}

void UsbDevice::take_control_data() {
    takes_coding_ = false;
    for (unsigned i = 0; i < sizeof coding_; ++i) coding_[i] = usb_memory().data0[i];
    reply(nullptr, 0, 0);
}

void UsbDevice::receive_data() {
    Register& buffer = usb_memory().buffers[usb::data_endpoint].out;
    if (receiving_ || (buffer & buffer_stall) != 0 || !link_.can_receive()) return;
    receiving_ = true;
    hand_over(buffer, usb::packet_size | toggles_[toggle_out]);
    toggles_[toggle_out] ^= buffer_odd;
}

/// A host that got a full packet waits for more: another packet follows, if only an empty one.
void UsbDevice::send_data() {
    awaits_frame_ = false;
    if (sending_) return;
    if (!link_.has_more() && sent_size_ != usb::packet_size) return;
    if ((usb_memory().buffers[usb::data_endpoint].in & buffer_stall) != 0) return;
    awaits_frame_ = timer().low - frame_at_us_ - late_us < frame_us - late_us;
    if (awaits_frame_) return;
    sent_size_ = link_.fill(in_packet());
    sending_ = true;
    hand_in();
}

void UsbDevice::hand_in() {
    hand_over(usb_memory().buffers[usb::data_endpoint].in,
              static_cast<std::uint32_t>(sent_size_) | buffer_full | toggles_[toggle_in]);
    toggles_[toggle_in] ^= buffer_odd;
}

}  // namespace versavis::rp2040
