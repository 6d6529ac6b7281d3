// MCAP files from front to back: records of a kind, a length and data, most of them in chunks that are packed alone
// (none, lz4, zstd) and have a checksum. Source of the format: mcap.dev/spec. The summary at the end is not needed.
// Messages are CDR (ROS 2) or of ROS 1, as their channel says; other channels are passed over.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "hal/bag/bag_file.hpp"
#include "hal/bag/bag_reader.hpp"

namespace stillmesh {

class McapReader final : public BagReader {
public:
    [[nodiscard]] Status open(const std::string& file, BagTopics& topics, std::string& message) override;
    [[nodiscard]] Status next(BagMessage& out, std::string& message) override;
    [[nodiscard]] bool is_unclosed() const override { return is_unclosed_; }

private:
    [[nodiscard]] Status read_file_record(BagMessage& out, std::string& message);
    [[nodiscard]] Status read_chunk(std::uint64_t at, std::uint64_t size, std::string& message);
    [[nodiscard]] Status read_chunk_record(BagMessage& out, std::string& message);
    [[nodiscard]] Status torn(std::uint64_t at, std::string& message);
    [[nodiscard]] Status damaged(std::uint64_t at, const char* what, std::string& message) const;
    // kOk: a wanted message.    kNotFound: something else.    kCorrupt: makes no sense.
    [[nodiscard]] Status take(std::uint8_t kind, std::span<const std::uint8_t> data, BagMessage& out);

    BagFile file_;
    std::string name_;
    BagTopics* topics_ = nullptr;
    std::map<std::uint16_t, std::string> types_;     // of a schema
    std::map<std::uint16_t, std::uint32_t> places_;  // of a channel's topic
    std::uint64_t at_ = 0;                           // of the next record in the file
    std::uint64_t chunk_at_ = 0;                     // where the chunk in memory lies in the file
    std::vector<std::uint8_t> packed_, chunk_;
    std::size_t chunk_next_ = 0;  // of the next record in it
    bool is_chunk_torn_ = false;  // the file ends within it
    bool is_unclosed_ = true;
};

}  // namespace stillmesh
