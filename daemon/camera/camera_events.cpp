// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_events.hpp"

#include <algorithm>
#include <array>

namespace versavis::daemon {

namespace {

constexpr std::uint32_t message_channel_count = 0x0900;

/// Until a camera that got no answer sends an event again, and how often it does.
constexpr std::uint32_t resend_after_ms = 100;
constexpr std::uint32_t resends = 2;

struct EventName {
    CameraEventKind kind;
    const char* name;
};

/// As makers' descriptions name them (Allied Vision, Basler, Baumer, Hikrobot, Point Grey, SVS).
constexpr EventName event_names[] = {
    {CameraEventKind::exposure_start, "ExposureStart"},
    {CameraEventKind::exposure_end, "ExposureEnd"},
    {CameraEventKind::trigger_missed, "FrameTriggerMissed"},
    {CameraEventKind::trigger_missed, "FrameStartOvertrigger"},
    {CameraEventKind::trigger_missed, "FrameStartOverTrigger"},
    {CameraEventKind::trigger_missed, "TriggerSkipped"},
    {CameraEventKind::ptp_lost, "PtpSyncLost"},
    {CameraEventKind::ptp_locked, "PtpSyncLocked"},
};

/// What "send it" is called.
constexpr std::array notifications{"On", "GenICamEvent", "GigEVisionEvent"};

bool contains(const std::vector<std::string>& entries, const std::string& name) {
    return std::find(entries.begin(), entries.end(), name) != entries.end();
}

/// The number of an event port, in hexadecimal; none: there is no such port.
std::optional<std::uint16_t> port_number(ArvDevice* device, const std::string& port) {
    ArvGcNode* node = arv_gc_get_node(arv_device_get_genicam(device), port.c_str());
    if (node == nullptr) return std::nullopt;
    for (ArvDomNode* child = arv_dom_node_get_first_child(ARV_DOM_NODE(node)); child != nullptr;
         child = arv_dom_node_get_next_sibling(child)) {
        if (!ARV_IS_GC_PROPERTY_NODE(child) ||
            arv_gc_property_node_get_node_type(ARV_GC_PROPERTY_NODE(child)) !=
                ARV_GC_PROPERTY_NODE_TYPE_EVENT_ID)
            continue;
        GlibError error;
        const char* text =
            arv_gc_property_node_get_string(ARV_GC_PROPERTY_NODE(child), error.out());
        const unsigned long number = text == nullptr ? 0 : std::strtoul(text, nullptr, 16);
        if (!error.set() && number > 0 && number <= UINT16_MAX)
            return static_cast<std::uint16_t>(number);
    }
    return std::nullopt;
}

/// Some descriptions give an event a port of its own, others a constant.
std::optional<std::uint16_t> number_of(const AravisNodeMap& nodes, const std::string& name) {
    ArvDevice* device = nodes.device();
    if (auto number = port_number(device, "Event" + name + "Port")) return number;
    if (auto number = port_number(device, name + "EventPort")) return number;
    const double constant = nodes.read_number("Event" + name).value_or(0);
    if (constant < 1 || constant > UINT16_MAX) return std::nullopt;
    return static_cast<std::uint16_t>(constant);
}

bool notify(NodeMap& nodes, const std::string& name) {
    if (!nodes.set("EventSelector", name)) return false;
    const auto known = nodes.values("EventNotification");
    return std::any_of(notifications.begin(), notifications.end(), [&](const char* value) {
        return contains(known, value) && nodes.set("EventNotification", value);
    });
}

std::vector<EventNumber> switch_on_events(AravisNodeMap& nodes) {
    const auto known = nodes.values("EventSelector");
    // An end without a start is no length.
    const bool both = contains(known, "ExposureStart") && contains(known, "ExposureEnd");
    std::vector<EventNumber> numbers;
    for (const auto& [kind, name] : event_names) {
        const bool of_length =
            kind == CameraEventKind::exposure_start || kind == CameraEventKind::exposure_end;
        if (!contains(known, name) || (of_length && !both)) continue;
        const auto number = number_of(nodes, name);
        if (number && notify(nodes, name)) numbers.push_back({*number, kind});
    }
    return numbers;
}

/// The port last: it is what opens the channel.
bool direct_to(ArvDevice* device, in_addr interface, std::uint16_t port) {
    const std::pair<std::uint32_t, std::uint32_t> registers[] = {
        {gvcp_message_address, ntohl(interface.s_addr)},
        {gvcp_message_timeout_ms, resend_after_ms},
        {gvcp_message_retries, resends},
        {gvcp_message_port, port}};
    return std::all_of(std::begin(registers), std::end(registers), [&](const auto& entry) {
        GlibError error;
        arv_device_write_register(device, entry.first, entry.second, error.out());
        return !error.set();
    });
}

}  // namespace

std::unique_ptr<MessageChannel> receive_events(AravisNodeMap& nodes, in_addr interface,
                                               in_addr camera, MessageChannel::Sink sink) {
    ArvDevice* device = nodes.device();
    if (!ARV_IS_GV_DEVICE(device) || nodes.values("EventSelector").empty()) return nullptr;
    GlibError error;
    std::uint32_t channels = 0;
    arv_device_read_register(device, message_channel_count, &channels, error.out());
    if (error.set() || channels == 0) return nullptr;
    const guint64 frequency =
        arv_gv_device_get_timestamp_tick_frequency(ARV_GV_DEVICE(device), error.out());
    auto numbers = switch_on_events(nodes);
    if (error.set() || frequency == 0 || numbers.empty()) return nullptr;
    auto channel =
        MessageChannel::open(interface, camera, std::move(numbers), frequency, std::move(sink));
    return channel && direct_to(device, interface, channel->port()) ? std::move(channel) : nullptr;
}

}  // namespace versavis::daemon
