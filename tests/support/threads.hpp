// SPDX-License-Identifier: BSD-3-Clause
// The threads of this process, and whether one of them rests.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <thread>

namespace versavis::test {

inline std::set<std::string> threads() {
    std::set<std::string> found;
    for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task"))
        found.insert(thread.path().filename());
    return found;
}

/// Waits until there are these threads and one more, which it returns. One that has been joined
/// may still be seen for a moment.
inline std::string wait_for_one_more(const std::set<std::string>& before) {
    for (;; std::this_thread::yield()) {
        const auto now = threads();
        std::set<std::string> more;
        std::set_difference(now.begin(), now.end(), before.begin(), before.end(),
                            std::inserter(more, more.end()));
        if (more.size() == 1) return *more.begin();
    }
}

/// Waits until a thread sleeps, and takes no processor.
class Rest {
 public:
    explicit Rest(const std::string& thread) : stat_("/proc/self/task/" + thread + "/stat") {}

    void wait() {
        for (char state = 'R'; state != 'S'; std::this_thread::yield()) {
            stat_.clear();
            stat_.seekg(0);
            stat_.ignore(4096, ')') >> state;
        }
    }

 private:
    std::ifstream stat_;
};

}  // namespace versavis::test
