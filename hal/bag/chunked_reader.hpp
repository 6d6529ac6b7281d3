// What bags of ROS 1 and MCAP files have in common: records one behind the other, most of them in chunks that are
// packed alone; one chunk is in memory at a time. A file that ends within a record is torn, and played up to there.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/bag/bag_file.hpp"
#include "hal/bag/bag_reader.hpp"

namespace stillmesh {

class ChunkedReader : public BagReader {
public:
    [[nodiscard]] Status next(BagMessage& out, std::string& message) final;
    [[nodiscard]] bool is_unclosed() const final { return is_unclosed_; }

protected:
    // kOk: a wanted message.    kNotFound: something else.    kCorrupt, kEnd: as next().
    [[nodiscard]] virtual Status read_file_record(BagMessage& out, std::string& message) {
        static_cast<void>(out), static_cast<void>(message);
        return not_implemented();
    }
    [[nodiscard]] virtual Status read_chunk_record(BagMessage& out, std::string& message) {
        static_cast<void>(out), static_cast<void>(message);
        return not_implemented();
    }
    // The file ends in the record that begins here: nothing of it is read any more.
    [[nodiscard]] Status torn(std::uint64_t at, std::string& message);

    BagFile file_;
    std::string name_;
    BagTopics* topics_ = nullptr;
    std::uint64_t at_ = 0;        // of the next record in the file
    std::uint64_t chunk_at_ = 0;  // where the chunk in memory lies in the file
    std::vector<std::uint8_t> packed_, chunk_;
    std::size_t chunk_next_ = 0;  // of the next record in it
    bool is_chunk_torn_ = false;  // the file ends within it
    bool is_unclosed_ = true;     // until its end, or its header, has said otherwise
};

}  // namespace stillmesh
