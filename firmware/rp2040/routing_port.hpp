// SPDX-License-Identifier: BSD-3-Clause
// What follows input levels without code: triggers of slaves, the light, the test output.
#pragma once

#include "edge_port.hpp"
#include "light_port.hpp"
#include "output_port.hpp"

namespace versavis::rp2040 {

class RoutingPort final : public firmware::Routing {
 public:
    RoutingPort(BoardClock& clock, OutputPort& outputs, EdgePort& edges, LightPort& light)
        : clock_(clock), outputs_(outputs), edges_(edges), light_(light) {}

    void set_up();

    Switched route(const firmware::Routes& routes, bool force) override;

 private:
    void begin_to_drive(const firmware::Routes& routes);
    bool masters_expose(std::uint32_t masters) const;
    std::uint32_t changed_masters(const firmware::Routes& routes) const;
    void copy_master(unsigned camera, const firmware::Routes& routes);
    void switch_trigger(unsigned camera, const firmware::Routes& routes);
    void configure_light(const firmware::Routes& routes);
    void copy_input(std::uint8_t input);

    BoardClock& clock_;
    OutputPort& outputs_;
    EdgePort& edges_;
    LightPort& light_;
    StateMachine slaves_[firmware::camera_count] = {{1, 0}, {1, 1}, {1, 2}, {1, 3}};
    StateMachine copier_{0, copier::machine};
    firmware::Routes routes_;
    bool driven_ = false;
};

}  // namespace versavis::rp2040
