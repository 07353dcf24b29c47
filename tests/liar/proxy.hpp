// SPDX-License-Identifier: BSD-3-Clause
// Stands between board and service as a unix socket: what the host says passes, what the board says
// goes through the liar.
#pragma once

#include <atomic>
#include <string>
#include <thread>

#include "damage.hpp"
#include "versavis/error.hpp"

namespace versavis::liar {

class Proxy {
 public:
    /// Listens at `path` for the service and connects to the board at `board_path` for each
    /// connection. `liar` must outlive it. Error: the socket cannot be created.
    static Expected<std::unique_ptr<Proxy>> start(const std::string& path,
                                                  const std::string& board_path, Liar& liar);
    ~Proxy();
    Proxy(const Proxy&) = delete;
    Proxy& operator=(const Proxy&) = delete;

 private:
    Proxy(int listener, std::string board_path, Liar& liar);

    void run();
    void connect_both();
    void disconnect();
    bool pass_to_board();
    bool pass_to_service();

    int listener_;
    std::string board_path_;
    Liar& liar_;
    int service_ = -1;
    int board_ = -1;
    Bytes unfinished_;  ///< of the board's packet that is being received
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace versavis::liar
