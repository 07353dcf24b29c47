// SPDX-License-Identifier: BSD-3-Clause
// Any bytes of a client at the control socket.
#include "control/control.hpp"

#include <sys/socket.h>
#include <sys/un.h>

#include <stdexcept>

#include "../support/temporary_directory.hpp"
#include "fuzz.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr const char* configuration =
    "[[camera]]\nname = \"cam0\"\ndevice = \"10.0.0.2\"\nrate_hz = 20\n";

/// Does at once what it is asked for.
struct Service final : Controlled {
    void reconfigure(const Configuration& /*next*/) override { ++report.asked, ++report.done; }
    void ask(const std::string& /*camera*/, CameraWish /*wish*/) override {
        ++report.asked, ++report.done;
    }
    ChangeReport changes(const std::string& /*camera*/) const override { return report; }
    bool report_lidars(const std::vector<LidarReport>& reports) override {
        return lidars.add(reports, {});
    }

    ChangeReport report;
    LidarReports lidars;
};

FileDescriptor connect(const std::string& path) {
    FileDescriptor client(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    if (::connect(client.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
        throw std::runtime_error("the control socket takes no client");
    return client;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const test::TemporaryDirectory directory;
    static const auto document =
        *ConfigurationDocument::load(directory.write("versavis.toml", configuration));
    const std::string path = directory.path() / "control";
    Service service;
    Control control(std::move(*ControlSocket::create(path, "no-such-group")), document, service);
    const FileDescriptor client = connect(path);
    Summary health;
    HostTime now{1};
    fuzz::Messages messages({data, size});
    while (!messages.empty()) {
        const fuzz::Bytes bytes = messages.next();
        ::send(client.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        now = now + milliseconds(50);
        control.tick(health, now);
        char reply[4096];
        static_cast<void>(::recv(client.get(), reply, sizeof reply, MSG_DONTWAIT));
    }
    return 0;
}
