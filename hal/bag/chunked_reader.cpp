#include "hal/bag/chunked_reader.hpp"

namespace stillmesh {

Status ChunkedReader::next(BagMessage& out, std::string& message) {
    for (;;) {
        const Status status =
            chunk_next_ < chunk_.size() ? read_chunk_record(out, message) : read_file_record(out, message);
        if (status != Status::kNotFound) return status;
    }
}

Status ChunkedReader::torn(std::uint64_t at, std::string& message) {
    message = name_ + ": is torn at byte " + std::to_string(at) + " of " + std::to_string(file_.size_bytes()) +
              "; it was played up to there (a recording that was killed, or a copy that is not whole).";
    at_ = file_.size_bytes();
    chunk_.clear();
    chunk_next_ = 0;
    is_unclosed_ = false;  // said
    return Status::kCorrupt;
}

}  // namespace stillmesh
