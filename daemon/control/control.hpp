// SPDX-License-Identifier: BSD-3-Clause
// What the service is asked for while it runs (docs/contracts/control.md): cameras start and stop,
// values change, the file is read again.
#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "camera/camera.hpp"
#include "control/control_socket.hpp"
#include "control/varlink.hpp"
#include "health/status.hpp"
#include "settings/configuration_document.hpp"

namespace versavis::daemon {

enum class CameraWish { start, stop, restart };

/// The service, as far as it can be changed.
class Controlled {
 public:
    virtual ~Controlled() = default;
    virtual void reconfigure(const Configuration& configuration) = 0;
    virtual void ask(const std::string& camera, CameraWish wish) = 0;
    virtual ChangeReport changes(const std::string& camera) const = 0;
    /// False: these are too many LiDARs.
    virtual bool report_lidars(const std::vector<LidarReport>& reports) = 0;
};

/// Values that were changed, and those that the next start of the service will change.
struct Reload {
    std::vector<std::string> changed;
    std::vector<std::string> need_restart;
};

/// Carries out the calls of all clients, on the main thread, in steps that wait for nobody: what a
/// camera does in its own time is answered in a later step.
class Control {
 public:
    Control(ControlSocket socket, ConfigurationDocument document, Controlled& service)
        : socket_(std::move(socket)), document_(std::move(document)), service_(service) {}

    /// Takes calls, and answers those that are done. `health`: of which subscribers are informed.
    void tick(const Summary& health, HostTime now);

    /// Reads the file again. Errors: what is wrong in it; the service goes on as it is.
    Expected<Reload, TomlProblems> reload();

 private:
    using Client = ControlSocket::Client;
    struct Method;

    /// A camera has not done yet what was asked for.
    struct Waiting {
        Client client = 0;
        std::string camera{};
        std::uint64_t number = 0;  ///< of the change
        HostTime until{};
        nlohmann::json reply = nlohmann::json::object();
        std::optional<toml::table> before{};  ///< in force again if the camera refuses
        std::uint64_t revision = 0;           ///< of the document that it refuses
    };

    void call(Client client, const std::string& message);
    void reply(Client client, const nlohmann::json& parameters);
    void fail(Client client, const char* error, const nlohmann::json& parameters);
    void get_info(Client client, const VarlinkCall& call);
    void describe_interface(Client client, const VarlinkCall& call);
    void get_state(Client client, const VarlinkCall& call);
    void start_camera(Client client, const VarlinkCall& call);
    void stop_camera(Client client, const VarlinkCall& call);
    void restart_camera(Client client, const VarlinkCall& call);
    void set_camera(Client client, const VarlinkCall& call);
    void reload(Client client, const VarlinkCall& call);
    void report_lidars(Client client, const VarlinkCall& call);
    void ask(Client client, const VarlinkCall& call, CameraWish wish);
    bool known_camera(Client client, const std::string& name);
    void adopt(ConfigurationDocument document);
    void await(Waiting waiting);
    bool answered(Waiting& waiting, HostTime now);
    void inform_subscribers(const Summary& health);

    static const Method methods[];

    ControlSocket socket_;
    ConfigurationDocument document_;
    Controlled& service_;
    std::uint64_t revision_ = 0;                    ///< of the document
    nlohmann::json state_;                          ///< as subscribers have it
    std::map<Client, nlohmann::json> subscribers_;  ///< and what each has
    std::list<Waiting> waiting_;
    std::set<Client> oneway_;  ///< they want no answer
    HostTime now_;
};

}  // namespace versavis::daemon
