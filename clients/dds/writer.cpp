// SPDX-License-Identifier: BSD-3-Clause
#include "writer.hpp"

#include <dds/dds.h>
#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "cdr_type.hpp"
#include "recording/item_messages.hpp"

namespace versavis::dds {

namespace {

using Qos = std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)>;

/// What a writer waits for readers that are slow: no frame may wait for the one before.
constexpr dds_duration_t longest_block = DDS_MSECS(10);
/// What can be sent again: half a second of images at 20 Hz and of samples at 1 kHz, since a reader
/// asks for what it lacks up to 100 ms later. What all readers have is not kept.
constexpr int kept_images = 10;
constexpr int kept_messages = 500;

/// SHA-256 of the type's description in JSON (REP 2016).
constexpr std::array<std::pair<std::string_view, std::string_view>, 9> hashes{{
    {"sensor_msgs/msg/Image",
     "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"},
    {"sensor_msgs/msg/CompressedImage",
     "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"},
    {"sensor_msgs/msg/CameraInfo",
     "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"},
    {"sensor_msgs/msg/Imu",
     "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"},
    {"sensor_msgs/msg/MagneticField",
     "RIHS01_e80f32f56a20486c9923008fc1a1db07bbb273cbbf6a5b3bfa00835ee00e4dff"},
    {"sensor_msgs/msg/Temperature",
     "RIHS01_72514a14126ab9f8a9abec974c78e5610a367b59db5da355ff1fb982d5bad4b8"},
    {"sensor_msgs/msg/TimeReference",
     "RIHS01_dd66e84cf40bbb5d5a40472e6ecf2675a031334d4c426abdb2ad41801a8efc99"},
    {"nmea_msgs/msg/Sentence",
     "RIHS01_67d3d300e23d1d018584731cd9642ffb4c78d12da1f483d3f2be3a9396c40984"},
    {"diagnostic_msgs/msg/DiagnosticArray",
     "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"},
}};

/// As ROS 2's nodes offer it: readers that want every message are served, and others, too.
Qos writer_qos(std::string_view type) {
    Qos qos(dds_create_qos(), dds_delete_qos);
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, longest_block);
    const bool images = type.ends_with("Image");
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, images ? kept_images : kept_messages);
    dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
    const std::string data = fmt::format("typehash={};", type_hash(type));
    dds_qset_userdata(qos.get(), data.data(), data.size());
    return qos;
}

Unexpected<> refused(const std::string& what, dds_return_t result, const std::string& cure) {
    return failure(what, std::string("Cyclone DDS: ") + dds_strretcode(result), cure);
}

}  // namespace

Entity::~Entity() {
    if (handle_ > 0) dds_delete(handle_);
}

std::string cyclone_configuration(const NetworkSettings& settings) {
    std::string interfaces;
    for (const std::string& one : settings.interfaces) {
        const bool address = one.find_first_of(".:") != std::string::npos;
        interfaces +=
            fmt::format("<NetworkInterface {}=\"{}\"/>", address ? "address" : "name", one);
    }
    if (!interfaces.empty()) interfaces = "<Interfaces>" + interfaces + "</Interfaces>";
    // Fragments as large as a datagram: with those of the default, of 1344 bytes, most large images
    // are lost on their way.
    std::string text = fmt::format(
        "<Domain id=\"any\"><General>{}<MaxMessageSize>65500B</MaxMessageSize>"
        "<FragmentSize>65000B</FragmentSize></General></Domain>",
        interfaces);
    if (const char* own = std::getenv("CYCLONEDDS_URI"); own != nullptr && *own != '\0')
        text += std::string(",") + own;
    return text;
}

Expected<Participant> Participant::create(const NetworkSettings& settings) {
    const std::string cure =
        "see its lines above, the interfaces of this host ('ip link') and "
        "$CYCLONEDDS_URI";
    const auto domain = dds_create_domain(settings.domain, cyclone_configuration(settings).c_str());
    if (domain < 0) return refused(fmt::format("domain {}", settings.domain), domain, cure);
    Entity owned(domain);
    const auto participant = dds_create_participant(settings.domain, nullptr, nullptr);
    if (participant < 0)
        return refused(fmt::format("domain {}", settings.domain), participant, cure);
    return Participant(std::move(owned), Entity(participant));
}

std::string dds_type_name(std::string_view type) {
    const std::size_t slash = type.rfind('/');
    std::string scope(type.substr(0, slash));
    for (std::size_t at = 0; (at = scope.find('/', at)) != std::string::npos;)
        scope.replace(at, 1, "::");
    return fmt::format("{}::dds_::{}_", scope, type.substr(slash + 1));
}

std::string_view type_hash(std::string_view type) {
    for (const auto& [name, hash] : hashes)
        if (name == type) return hash;
    return "";
}

Expected<Writer> Writer::create(const Participant& participant, const std::string& topic,
                                std::string_view type) {
    ddsi_sertype* cdr = make_cdr_type(dds_type_name(type));
    const auto made = dds_create_topic_sertype(participant.handle(), ("rt" + topic).c_str(), &cdr,
                                               nullptr, nullptr, nullptr);
    if (made < 0) {
        ddsi_sertype_unref(cdr);
        return refused(topic, made, "rename the stream");
    }
    const auto writer =
        dds_create_writer(participant.handle(), made, writer_qos(type).get(), nullptr);
    if (writer < 0) return refused(topic, writer, "");
    return Writer(topic, Entity(writer), cdr);
}

bool Writer::has_readers() const {
    dds_publication_matched_status_t status{};
    return dds_get_publication_matched_status(writer_.handle(), &status) == DDS_RETCODE_OK &&
           status.current_count > 0;
}

Expected<> Writer::sent(std::int32_t result) const {
    // A reader that is slow: the next message is newer.
    if (result >= 0 || result == DDS_RETCODE_TIMEOUT) return {};
    return refused(topic_, result, "");
}

Expected<> Writer::write(std::string_view message) const {
    CdrSample sample(message.size());
    std::memcpy(sample.bytes().data(), message.data(), message.size());
    return sent(dds_writecdr(writer_.handle(), CdrSample::release(std::move(sample), *type_)));
}

Expected<bool> Writer::write(std::string_view head, const ring::Payload& payload) const {
    CdrSample sample(head.size() + payload.size());
    std::memcpy(sample.bytes().data(), head.data(), head.size());
    if (!payload.copy_to(sample.bytes().data() + head.size())) return false;
    const auto done =
        sent(dds_writecdr(writer_.handle(), CdrSample::release(std::move(sample), *type_)));
    if (!done) return Unexpected(done.error());
    return true;
}

}  // namespace versavis::dds
