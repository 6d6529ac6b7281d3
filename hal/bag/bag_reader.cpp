#include "hal/bag/bag_reader.hpp"

#include <algorithm>
#include <array>

#include "hal/bag/bag_file.hpp"
#include "hal/bag/bag_files.hpp"
#include "hal/bag/db3_reader.hpp"
#include "hal/bag/mcap_reader.hpp"
#include "hal/bag/ros1_reader.hpp"

namespace stillmesh {
namespace {

// "sensor_msgs/msg/Image" is "sensor_msgs/Image".
[[nodiscard]] std::string plain_type(std::string_view type) {
    std::string out(type.substr(0, kTopicNameMax));
    const std::size_t at = out.find("/msg/");
    if (at != std::string::npos) out.erase(at, 4);
    return out;
}

}  // namespace

std::optional<std::uint32_t> BagTopics::place_of(std::string_view name, std::string_view type, MessageLayout layout) {
    name = name.substr(0, kTopicNameMax);
    const std::string plain = plain_type(type);
    for (std::uint32_t i = 0; i < topics_.size(); ++i) {
        const BagTopic& topic = topics_[i];
        if (topic.name == name && topic.type == plain && topic.layout == layout) return i;
    }
    if (topics_.size() == kTopicsMax) return std::nullopt;
    topics_.push_back({std::string(name), plain, layout, !is_chosen_ && is_read_type(plain)});
    return static_cast<std::uint32_t>(topics_.size() - 1);
}

void BagTopics::want(std::span<const std::uint32_t> places) {
    is_chosen_ = true;
    for (BagTopic& topic : topics_) topic.is_wanted = false;
    for (const std::uint32_t place : places) topics_[place].is_wanted = true;
}

std::unique_ptr<BagReader> open_bag_file(const std::string& file, BagTopics& topics, std::string& message) {
    std::unique_ptr<BagReader> reader;
    switch (bag_format_of(file)) {
        case BagFormat::kRos1: reader = std::make_unique<Ros1Reader>(); break;
        case BagFormat::kMcap: reader = std::make_unique<McapReader>(); break;
        case BagFormat::kDb3: reader = std::make_unique<Db3Reader>(); break;
        case BagFormat::kZstd:
            message = file + ": the whole file is packed; unpack it first: zstd -d '" + file + "'.";
            return nullptr;
        case BagFormat::kNone: {
            BagFile probe;
            if (probe.open(file, message) == Status::kOk) {
                message = file + ": is no bag of ROS 1, SQLite or MCAP, or its beginning is lost.";
            }
            return nullptr;
        }
    }
    if (reader->open(file, topics, message) != Status::kOk) return nullptr;
    return reader;
}

Status BagSequence::open(const std::vector<std::string>& files, std::string& message) {
    files_ = files;
    file_ = 0;
    is_unclosed_ = false;
    reader_ = files_.empty() ? nullptr : open_bag_file(files_[0], topics_, message);
    return reader_ == nullptr ? Status::kInvalid : Status::kOk;
}

Status BagSequence::next(BagMessage& out, std::string& message) {
    while (file_ < files_.size()) {
        if (reader_ == nullptr) {
            reader_ = open_bag_file(files_[file_], topics_, message);
            if (reader_ == nullptr) {
                ++file_;
                return Status::kCorrupt;
            }
        }
        const Status status = reader_->next(out, message);
        if (status != Status::kEnd) return status;
        is_unclosed_ = is_unclosed_ || reader_->is_unclosed();
        reader_.reset();
        ++file_;
    }
    return Status::kEnd;
}

}  // namespace stillmesh
