// SPDX-License-Identifier: BSD-3-Clause
#include "cdr_type.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace versavis::dds {

namespace {

constexpr std::size_t padded(std::size_t size) { return (size + 3) / 4 * 4; }

struct Sample : ddsi_serdata {
    std::size_t size = 0;
    std::unique_ptr<std::byte[]> bytes;
};

Sample& sample_of(ddsi_serdata* data) { return *static_cast<Sample*>(data); }
const Sample& sample_of(const ddsi_serdata* data) { return *static_cast<const Sample*>(data); }

Sample* make_sample(const ddsi_sertype* type, ddsi_serdata_kind kind) {
    auto* sample = new Sample;
    ddsi_serdata_init(sample, type, kind);
    sample->hash = type->serdata_basehash;  // without keys, all are one instance
    return sample;
}

/// What stands for an instance: there is one.
ddsi_serdata* make_key(const ddsi_sertype* type) {
    Sample* sample = make_sample(type, SDK_KEY);
    sample->type = nullptr;
    return sample;
}

const ddsi_serdata_ops sample_operations = [] {
    ddsi_serdata_ops operations{};
    operations.eqkey = [](const ddsi_serdata*, const ddsi_serdata*) { return true; };
    operations.get_size = [](const ddsi_serdata* data) {
        return static_cast<std::uint32_t>(sample_of(data).size);
    };
    // Nothing is received.
    operations.from_ser = [](const ddsi_sertype*, ddsi_serdata_kind, const nn_rdata*,
                             std::size_t) -> ddsi_serdata* { return nullptr; };
    operations.from_ser_iov = [](const ddsi_sertype*, ddsi_serdata_kind, ddsrt_msg_iovlen_t,
                                 const ddsrt_iovec_t*,
                                 std::size_t) -> ddsi_serdata* { return nullptr; };
    operations.from_keyhash = [](const ddsi_sertype* type, const ddsi_keyhash*) {
        return make_key(type);
    };
    operations.from_sample = [](const ddsi_sertype* type, ddsi_serdata_kind kind,
                                const void*) -> ddsi_serdata* {
        return kind == SDK_KEY ? make_key(type) : nullptr;
    };
    operations.to_ser = [](const ddsi_serdata* data, std::size_t offset, std::size_t size,
                           void* to) {
        std::memcpy(to, sample_of(data).bytes.get() + offset, size);
    };
    operations.to_ser_ref = [](const ddsi_serdata* data, std::size_t offset, std::size_t size,
                               ddsrt_iovec_t* part) {
        part->iov_base = sample_of(data).bytes.get() + offset;
        part->iov_len = size;
        return ddsi_serdata_ref(data);
    };
    operations.to_ser_unref = [](ddsi_serdata* data, const ddsrt_iovec_t*) {
        ddsi_serdata_unref(data);
    };
    operations.to_sample = [](const ddsi_serdata*, void*, void**, void*) { return false; };
    operations.to_untyped = [](const ddsi_serdata* data) { return make_key(data->type); };
    operations.untyped_to_sample = [](const ddsi_sertype*, const ddsi_serdata*, void*, void**,
                                      void*) { return false; };
    operations.free = [](ddsi_serdata* data) { delete &sample_of(data); };
    operations.print = [](const ddsi_sertype*, const ddsi_serdata* data, char* to,
                          std::size_t size) {
        const int written = std::snprintf(to, size, "%zu bytes", sample_of(data).size);
        return static_cast<std::size_t>(std::max(0, written));
    };
    operations.get_keyhash = [](const ddsi_serdata*, ddsi_keyhash* to, bool) { *to = {}; };
    return operations;
}();

const ddsi_sertype_ops type_operations = [] {
    ddsi_sertype_ops operations{};
    operations.version = ddsi_sertype_v0;
    operations.free = [](ddsi_sertype* type) {
        ddsi_sertype_fini(type);
        delete type;
    };
    operations.zero_samples = [](const ddsi_sertype*, void*, std::size_t) {};
    operations.realloc_samples = [](void**, const ddsi_sertype*, void*, std::size_t, std::size_t) {
    };
    operations.free_samples = [](const ddsi_sertype*, void**, std::size_t, dds_free_op_t) {};
    operations.equal = [](const ddsi_sertype*, const ddsi_sertype*) { return true; };
    operations.hash = [](const ddsi_sertype*) { return std::uint32_t{0}; };
    return operations;
}();

}  // namespace

ddsi_sertype* make_cdr_type(const std::string& name) {
    auto* type = new ddsi_sertype{};
    ddsi_sertype_init(type, name.c_str(), &type_operations, &sample_operations, true);
#ifdef DDS_DATA_REPRESENTATION_FLAG_XCDR1  // Cyclone DDS 0.8 knows no other
    type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
#endif
    return type;
}

CdrSample::CdrSample(std::size_t size)
    : size_(size), bytes_(std::make_unique_for_overwrite<std::byte[]>(padded(size))) {
    std::fill(bytes_.get() + size, bytes_.get() + padded(size), std::byte{0});
}

ddsi_serdata* CdrSample::release(CdrSample sample, const ddsi_sertype& type) {
    Sample* made = make_sample(&type, SDK_DATA);
    made->size = sample.size_;
    made->bytes = std::move(sample.bytes_);
    return made;
}

}  // namespace versavis::dds
