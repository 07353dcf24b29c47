// SPDX-License-Identifier: BSD-3-Clause
// The socket that the service is controlled by, and its clients.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// Messages end with a NUL byte. A client is given the next message of another only when its own
/// was answered. None can keep the service busy, or its place: who sends too much, takes no
/// answers, or is idle when all places are taken, is disconnected.
///
/// Of one thread, which nothing here waits for.
class ControlSocket {
 public:
    using Client = std::uint64_t;  ///< never the same again

    /// Takes the place of a socket that is left there. Members of `group` may connect, where there
    /// is such a group and this process may use it; else its owner alone. Error: it cannot be made.
    static Expected<ControlSocket> create(const std::filesystem::path& path,
                                          const std::string& group);
    ControlSocket() = default;  ///< has no clients
    ControlSocket(ControlSocket&&) = default;
    ~ControlSocket();

    /// Takes new clients and what all have sent, at most one message of each, which `handle` gets.
    /// It must answer, now or later, or finish().
    void poll(HostTime now, const std::function<void(Client, const std::string&)>& handle);

    /// To a client that is gone, nothing is sent. `last`: its next message may come.
    void send(Client client, const std::string& message, bool last = true);
    void finish(Client client);
    bool connected(Client client) const { return clients_.count(client) != 0; }

    const std::filesystem::path& path() const { return path_; }

 private:
    struct Connection {
        FileDescriptor socket;
        std::string received;
        std::string to_send;
        bool waits = false;  ///< for an answer
        bool ended = false;  ///< it sends no more
        HostTime active;
    };

    ControlSocket(std::filesystem::path path, FileDescriptor socket)
        : path_(std::move(path)), socket_(std::move(socket)) {}

    void accept(HostTime now);
    void make_room();
    static void receive(Connection& client, HostTime now);
    static bool flush(Connection& client);

    std::filesystem::path path_;
    FileDescriptor socket_;
    std::map<Client, Connection> clients_;
    Client next_ = 1;
};

}  // namespace versavis::daemon
