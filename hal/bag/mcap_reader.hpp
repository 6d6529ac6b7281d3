// MCAP files from front to back: records of a kind, a length and data, most of them in chunks that are packed alone
// (none, lz4, zstd) and have a checksum. Source of the format: mcap.dev/spec. The summary at the end is not needed.
// Messages are CDR (ROS 2) or of ROS 1, as their channel says; other channels are passed over.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "hal/bag/chunked_reader.hpp"

namespace stillmesh {

class McapReader final : public ChunkedReader {
public:
    [[nodiscard]] Status open(const std::string& file, BagTopics& topics, std::string& message) override;

private:
    [[nodiscard]] Status read_file_record(BagMessage& out, std::string& message) override;
    [[nodiscard]] Status read_chunk(std::uint64_t at, std::uint64_t size, std::string& message);
    [[nodiscard]] Status read_chunk_record(BagMessage& out, std::string& message) override;
    [[nodiscard]] Status damaged(std::uint64_t at, const char* what, std::string& message) const;
    // kOk: a wanted message.    kNotFound: something else.    kCorrupt: makes no sense.
    [[nodiscard]] Status take(std::uint8_t kind, std::span<const std::uint8_t> data, BagMessage& out);

    std::map<std::uint16_t, std::string> types_;     // of a schema
    std::map<std::uint16_t, std::uint32_t> places_;  // of a channel's topic
};

}  // namespace stillmesh
