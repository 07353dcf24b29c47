// SPDX-License-Identifier: BSD-3-Clause
#include "models.hpp"

#include <algorithm>

namespace versavis::model {

bool Twist::operator()(const char* name) const {
    const bool same = name_ == name;
    met_ = met_ || same;
    return same;
}

Order Twist::order(const char* name, Order order) const {
    return (*this)(name) ? Order::relaxed : order;
}

int next_after_loss(int number, int head, int retained) {
    return std::max(number + 1, head - std::min(head, retained / 2));
}

}  // namespace versavis::model
