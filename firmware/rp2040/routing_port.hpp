// SPDX-License-Identifier: BSD-3-Clause
// What follows input levels without code: triggers of slaves, the light, the test output.
#pragma once

#include "edge_port.hpp"
#include "output_port.hpp"

namespace versavis::rp2040 {

class RoutingPort final : public firmware::Routing {
 public:
    RoutingPort(BoardClock& clock, OutputPort& outputs, EdgePort& edges)
        : clock_(clock), outputs_(outputs), edges_(edges) {}

    void set_up();

    Switched route(const firmware::Routes& routes, bool force) override;

 private:
    using Program = std::array<pio_assembly::Code, router::size>;

    void begin_to_drive(const firmware::Routes& routes);
    bool masters_expose(std::uint32_t masters) const;
    std::uint32_t changed_masters(const firmware::Routes& routes) const;
    static Program program_of(const firmware::Routes& routes);
    void load(const Program& program);
    void load_light(const firmware::Routes& routes);
    void copy_input(std::uint8_t input);

    BoardClock& clock_;
    OutputPort& outputs_;
    EdgePort& edges_;
    StateMachine router_{1, router::machine};
    StateMachine light_{1, light::machine};
    StateMachine copier_{1, copier::machine};
    firmware::Routes routes_;
    bool driven_ = false;
};

}  // namespace versavis::rp2040
