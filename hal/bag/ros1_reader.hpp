// Bags of ROS 1, version 2.0, from front to back: records of a header and data, most of them in chunks that are packed
// alone (none, bz2, lz4). Source of the format: wiki.ros.org/Bags/Format/2.0. The index at the end is not needed. A
// chunk whose recorder was killed has no length yet: what lies behind its header is read as records. Our own and not
// librosbag: docs/decisions.md says why.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "hal/bag/chunked_reader.hpp"

namespace stillmesh {

class Ros1Reader final : public ChunkedReader {
public:
    [[nodiscard]] Status open(const std::string& file, BagTopics& topics, std::string& message) override;

private:
    struct Record {
        std::span<const std::uint8_t> header;
        std::span<const std::uint8_t> data;
    };
    [[nodiscard]] Status read_file_record(BagMessage& out, std::string& message) override;
    [[nodiscard]] Status read_chunk(std::uint64_t at, std::uint32_t data_bytes, std::string& message);
    [[nodiscard]] Status read_chunk_record(BagMessage& out, std::string& message) override;
    // kOk: a wanted message.    kNotFound: something else.    kCorrupt: makes no sense.
    [[nodiscard]] Status take(const Record& record, BagMessage& out);
    void take_connection(const Record& record);

    std::map<std::uint32_t, std::uint32_t> places_;  // of a connection's topic; at most kConnectionsMax
    std::vector<std::uint8_t> header_;
};

}  // namespace stillmesh
