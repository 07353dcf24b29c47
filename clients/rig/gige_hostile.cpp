// SPDX-License-Identifier: BSD-3-Clause
#include "gige_hostile.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <stdexcept>

namespace versavis::rig {

namespace {

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    if (at == std::string::npos) throw std::logic_error("not in the description: " + from);
    return text.replace(at, from.size(), to);
}

std::string little_endian(std::uint64_t value, unsigned bytes) {
    std::string out;
    for (unsigned i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i));
    return out;
}

/// A part of a raw deflate stream that ends at a byte, and can be repeated.
std::string deflated(const std::string& text) {
    z_stream stream{};
    deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY);
    std::string out(text.size() + 1024, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = static_cast<uInt>(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    deflate(&stream, Z_FULL_FLUSH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

/// An archive of one file, as in PKWARE's APPNOTE.
std::string zip(const std::string& compressed, std::uint64_t size) {
    const std::string name = "rig.xml";
    const std::string fields = little_endian(20, 2) + little_endian(0, 2) + little_endian(8, 2) +
                               little_endian(0, 4) + little_endian(0, 4) +
                               little_endian(compressed.size(), 4) + little_endian(size, 4) +
                               little_endian(name.size(), 2) + little_endian(0, 2);
    const std::string local = "PK\x03\x04" + fields + name + compressed;
    const std::string directory =
        "PK\x01\x02" + little_endian(20, 2) + fields + std::string(14, '\0') + name;
    return local + directory + "PK\x05\x06" + little_endian(0, 4) + little_endian(1, 2) +
           little_endian(1, 2) + little_endian(directory.size(), 4) +
           little_endian(local.size(), 4) + little_endian(0, 2);
}

std::string bomb() {
    constexpr unsigned parts = 2000;
    constexpr std::size_t part_size = 1 << 20;
    const std::string part = deflated(std::string(part_size, ' '));
    std::string stream;
    for (unsigned i = 0; i < parts; ++i) stream += part;
    return zip(stream, std::uint64_t{parts} * part_size);
}

std::string many_paths() {
    std::string nodes;
    for (int i = 0; i < 40; ++i)
        nodes += fmt::format(
            "<IntSwissKnife Name=\"Path{0}\"><pVariable Name=\"A\">Path{1}</pVariable><pVariable "
            "Name=\"B\">Path{1}</pVariable><Formula>A+B</Formula></IntSwissKnife>\n",
            i, i + 1);
    return nodes + "<Integer Name=\"Path40\"><Value>1</Value></Integer>\n";
}

}  // namespace

GigeDescription describe_camera(Hostility hostility, const std::string& honest,
                                std::uint32_t address) {
    const std::string width = "<Integer Name=\"Width\"><pValue>WidthRegister</pValue>";
    const std::string end = "</RegisterDescription>";
    std::string text = honest;
    std::string name = "rig.xml";
    std::string size;
    switch (hostility) {
        case Hostility::none:
        case Hostility::pending:
        case Hostility::pending_at_all: break;
        case Hostility::value_loop:
            text = replaced(text, width, "<Integer Name=\"Width\"><pValue>Width</pValue>");
            break;
        case Hostility::formula_loop:
            text = replaced(text, width, "<Integer Name=\"Width\"><pValue>One</pValue>");
            text = replaced(text, end,
                            "<IntSwissKnife Name=\"One\"><pVariable Name=\"X\">Two</pVariable>"
                            "<Formula>X+1</Formula></IntSwissKnife>\n"
                            "<IntSwissKnife Name=\"Two\"><pVariable Name=\"X\">One</pVariable>"
                            "<Formula>X+1</Formula></IntSwissKnife>\n" +
                                end);
            break;
        case Hostility::offset_loop:
            text = replaced(text, "<IntReg Name=\"WidthRegister\">",
                            "<IntReg Name=\"WidthRegister\"><pIndex pOffset=\"Width\">Height"
                            "</pIndex>");
            break;
        case Hostility::many_paths:
            text = replaced(text, width, "<Integer Name=\"Width\"><pValue>Path0</pValue>");
            text = replaced(text, end, many_paths() + end);
            break;
        case Hostility::size_64_bit: size = "8000000000000000"; break;
        case Hostility::size_2_gib: size = "80000000"; break;
        case Hostility::zip_bomb:
            text = bomb();
            name = "rig.zip";
            break;
        case Hostility::truncated: text.resize(text.size() / 2); break;
        case Hostility::long_register:
            text = replaced(text, "<Length>32</Length>", "<Length>0x10000000000</Length>");
            break;
        case Hostility::local_file: return {"File:///dev/zero", text};
        case Hostility::huge_frames:
            text =
                replaced(text, "<Integer Name=\"PayloadSize\"><pValue>PayloadSizeRegister</pValue>",
                         "<Integer Name=\"PayloadSize\"><Value>1099511627776</Value>");
            break;
        case Hostility::no_numbers:
            text = replaced(text, width, "<Integer Name=\"Width\"><pValue>Nowhere</pValue>");
            text =
                replaced(text, "<Integer Name=\"PayloadSize\"><pValue>PayloadSizeRegister</pValue>",
                         "<Integer Name=\"PayloadSize\"><pValue>Nowhere</pValue>");
            break;
    }
    if (size.empty()) size = fmt::format("{:x}", text.size());
    return {fmt::format("Local:{};{:x};{}", name, address, size), text};
}

}  // namespace versavis::rig
