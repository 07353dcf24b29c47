// SPDX-License-Identifier: BSD-3-Clause
// Drawings of the wiring, as SVG.
#pragma once

#include <string>
#include <vector>

#include "wiring/wired_parts.hpp"

namespace versavis::client {

/// A board at the left, what is wired to it at the right, and notes below.
class Sheet {
 public:
    Sheet(std::string title, std::string subtitle, std::string device)
        : title_(std::move(title)), subtitle_(std::move(subtitle)), device_(std::move(device)) {}

    void trigger(int y, const std::string& signal, const TriggerCircuit& circuit);
    void exposure(int y, const std::string& signal, const ExposureCircuit& circuit);
    void ground(int y);
    void imu_wire(int y, const ImuWire& wire, int pull_up_x);

    /// At the device's side; `kind`: by which it is coloured.
    void device_pin(int y, int number, const std::string& name, const std::string& below,
                    const std::string& kind);
    void open_pin(int y, int number, const std::string& what);
    void note(std::string text);
    void end_at(int y) { bottom_ = y; }

    int height() const { return bottom_ + 24 + 18 * static_cast<int>(notes_.size()); }

    /// All but the outermost element.
    std::string body() const;

 private:
    void add(std::string element) { elements_.push_back(std::move(element)); }
    void board_pin(int y, const std::string& signal);
    void wire(int x, int y, int to_x, int to_y);
    void resistor(int x, int y, int ohm, bool upright);
    void to_level(int x, int y, int ohm, const std::string& level, bool up);
    void gate(int x, int y, const std::string& name, const std::string& rail,
              const std::string& ties, bool to_right);

    std::string title_;
    std::string subtitle_;
    std::string device_;
    std::vector<std::string> elements_;
    std::vector<std::string> notes_;
    int bottom_ = 0;
};

Sheet drawing(const WiredCamera& camera);
Sheet drawing(const WiredImu& imu);
Sheet drawing(const WiredLidar& lidar);

/// Of outputs that drive their high level by themselves.
Sheet driven_outputs_drawing();

/// Of a trigger that rests high, with any buffer.
Sheet inverted_trigger_drawing();

/// One below the other.
std::string to_svg(const std::vector<Sheet>& sheets);

/// Of all parts with a circuit.
std::vector<Sheet> drawings(const WiredParts& parts);

}  // namespace versavis::client
