// SPDX-License-Identifier: BSD-3-Clause
#include "simulated_usb_device.hpp"

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <mutex>
#include <utility>

namespace versavis::test {

namespace {

constexpr std::uint8_t interrupt_in = 0x81;
constexpr std::uint8_t bulk_out = 0x02;
constexpr std::uint8_t bulk_in = 0x82;

UsbDescription describe(const std::string& serial) {
    UsbDescription usb;
    // clang-format off
    usb.device = {
        18, 1, 0x00, 0x02,  // USB 2.0
        0xef, 2, 1,         // class by interface association
        64, 0x09, 0x12, 0x53, 0x56, 0x00, 0x01,
        1, 2, 3,            // manufacturer, product, serial
        1};
    usb.configuration = {
        9, 2, 75, 0, 2, 1, 0, 0x80, 50,
        8, 11, 0, 2, 2, 2, 0, 0,            // association: interfaces 0 and 1 are one ACM
        9, 4, 0, 0, 1, 2, 2, 0, 0,          // interface 0: communication, ACM
        5, 0x24, 0x00, 0x20, 0x01,          // CDC 1.2
        5, 0x24, 0x01, 0x00, 1,             // call management: none
        4, 0x24, 0x02, 0x02,                // line coding and line state
        5, 0x24, 0x06, 0, 1,                // union of 0 and 1
        7, 5, interrupt_in, 3, 8, 0, 16,
        9, 4, 1, 0, 2, 10, 0, 0, 0,         // interface 1: data
        7, 5, bulk_out, 2, 64, 0, 0,
        7, 5, bulk_in, 2, 64, 0, 0};
    // clang-format on
    usb.strings = {"Simulated", "Simulated CDC-ACM device", serial};
    return usb;
}

}  // namespace

class CdcAcmFunction final : public UsbFunction {
 public:
    CdcAcmFunction(const std::string& serial, SimulatedUsbDevice::OnReceive on_receive,
                   std::function<void()> on_touch)
        : description_{describe(serial)},
          on_receive_{std::move(on_receive)},
          on_touch_{std::move(on_touch)} {}

    const UsbDescription& description() const override { return description_; }
    int control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                Bytes& reply) override;
    void receive(std::uint8_t /*endpoint*/, std::span<const std::uint8_t> bytes) override {
        const std::lock_guard lock{receive_mutex_};
        if (on_receive_) on_receive_(std::as_bytes(bytes));
    }
    void plugged(bool in) override {
        if (!in) line_state_set_ = false;
    }
    // No callback runs once this has returned.
    void silence() {
        const std::lock_guard lock{receive_mutex_};
        on_receive_ = nullptr;
        on_touch_ = nullptr;
    }
    bool line_state_set() const { return line_state_set_; }
    void send(std::span<const std::byte> bytes) {
        const auto* begin = reinterpret_cast<const std::uint8_t*>(bytes.data());
        node()->send(bulk_in, Bytes(begin, begin + bytes.size()));
    }

 private:
    void line_state_changed(bool dtr);

    const UsbDescription description_;
    Bytes line_coding_{0x00, 0xc2, 0x01, 0x00, 0, 0, 8};  // 115200 8N1
    std::atomic<bool> line_state_set_ = false;
    std::mutex receive_mutex_;
    SimulatedUsbDevice::OnReceive on_receive_;
    std::function<void()> on_touch_;
};

void CdcAcmFunction::line_state_changed(bool dtr) {
    const Bytes touch{0xb0, 0x04, 0x00, 0x00, 0, 0, 8};  // 1200 8N1
    line_state_set_ = dtr;
    const std::lock_guard lock{receive_mutex_};
    if (!dtr && line_coding_ == touch && on_touch_) on_touch_();
}

int CdcAcmFunction::control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                            Bytes& reply) {
    switch (setup[0] << 8 | setup[1]) {
        case 0x2120:  // SET_LINE_CODING
            if (out.size() != line_coding_.size()) return -EPIPE;
            line_coding_.assign(out.begin(), out.end());
            return 0;
        case 0xa121:  // GET_LINE_CODING
            reply = line_coding_;
            return 0;
        case 0x2122:  // SET_CONTROL_LINE_STATE; bit 0 is DTR
            line_state_changed((setup[2] & 1) != 0);
            return 0;
        default: return -EPIPE;
    }
}

SimulatedUsbDevice::SimulatedUsbDevice(UMockdevTestbed* testbed, std::string serial,
                                       OnReceive on_receive, const std::string& port,
                                       std::function<void()> on_touch)
    : function_{std::make_shared<CdcAcmFunction>(serial, std::move(on_receive),
                                                 std::move(on_touch))},
      device_{testbed, port, function_} {}

SimulatedUsbDevice::~SimulatedUsbDevice() {
    device_.unplug();
    function_->silence();
}

void SimulatedUsbDevice::send(std::span<const std::byte> bytes) { function_->send(bytes); }

bool SimulatedUsbDevice::line_state_set() const { return function_->line_state_set(); }

}  // namespace versavis::test
