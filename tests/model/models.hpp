// SPDX-License-Identifier: BSD-3-Clause
// The ring's protocol as models, and the small changes that must, or must not, break them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "explorer.hpp"

namespace versavis::model {

/// One change of a model, by its name; without a name, none.
class Twist {
 public:
    explicit Twist(std::string name = {}) : name_(std::move(name)) {}
    /// Is it this one?
    bool operator()(const char* name) const;
    /// Relaxed if it is this one.
    Order order(const char* name, Order order) const;
    /// Was it asked for? A name that no model knows changes nothing.
    bool met() const { return met_; }

 private:
    std::string name_;
    mutable bool met_ = false;
};

struct Subject {
    std::string name;
    std::string what;
    std::function<Model(const Twist&)> make;
};

enum class Effect : std::uint8_t { breaks, none };

struct Change {
    std::string subject;
    std::string name;
    std::string pair;  ///< as in layout.hpp
    Effect effect;
};

struct Collection {
    std::vector<Subject> subjects;
    std::vector<Change> changes;
};

Collection publishing();  ///< descriptors, slots, the header
Collection waiting();     ///< sleep, end, hand-over, crowds
Collection watching();    ///< the descriptor for epoll, and the thread behind it

/// How a reader learns that item n is there.
enum class Reading : std::uint8_t { head, sequence };

/// Where a reader goes on that lost this item.
int next_after_loss(int number, int head, int retained);

}  // namespace versavis::model
