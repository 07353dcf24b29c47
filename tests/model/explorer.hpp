// SPDX-License-Identifier: BSD-3-Clause
// Runs the programs of a model in every order and with every value that the memory allows, and
// finds the shortest way to what must not be.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "program.hpp"

namespace versavis::model {

class Model {
 public:
    /// The new location's number.
    int place(const std::string& name, int initial = 0);
    /// Of a mutex, or of something in the kernel: everybody sees its newest state, and no other.
    int object(const std::string& name, int initial = 0);
    void run(Program program);

    const std::vector<std::string>& places() const { return places_; }
    const std::vector<std::int8_t>& initial() const { return initial_; }
    const std::vector<bool>& is_object() const { return is_object_; }
    const std::vector<Program>& programs() const { return programs_; }

 private:
    std::vector<std::string> places_;
    std::vector<std::int8_t> initial_;
    std::vector<bool> is_object_;
    std::vector<Program> programs_;
};

struct Result {
    std::size_t states = 0;
    std::string violation;  ///< empty: the model holds
    std::vector<std::string> trace;

    bool holds() const { return violation.empty(); }
};

/// A violation is: a check that fails; a state in which nobody can go on, though one has not ended
/// and may not rest there; a state from which no good end can be reached. `at_end` sees each good
/// end.
Result explore(const Model& model, const std::function<void(const State&)>& at_end = {});

}  // namespace versavis::model
