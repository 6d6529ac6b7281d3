// The port to a bag: its next message, in the order in which the file has them, which is that of their recording. Three
// formats stand behind it: ROS 1 (v2.0), and of ROS 2 SQLite (.db3) and MCAP. Whole images are passed on as the bag has
// them; what they mean is known elsewhere (ros_messages.hpp). No index is read, so that a recording that was killed
// plays up to where it is torn, and a file of 10 GB needs no more memory than one of 10 MB.
// Memory: a chunk packed and one unpacked, each at most kBagPieceBytesMax; kTopicsMax names. Any bytes are safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/check.hpp"
#include "engine/base/status.hpp"
#include "hal/bag/ros_messages.hpp"

namespace stillmesh {

inline constexpr std::size_t kTopicsMax = 1024;
inline constexpr std::size_t kTopicNameMax = 512;  // bytes; those behind are left out

struct BagTopic {
    std::string name;
    std::string type;  // "sensor_msgs/Image", also where ROS 2 says sensor_msgs/msg/Image
    MessageLayout layout = MessageLayout::kRos1;
    bool is_wanted = false;  // messages of others are passed over, unread where that saves time
};

// The topics of a bag, of all its files. Those of types that are read here are wanted at first.
class BagTopics {
public:
    // Its place; the same for the same name and type. Empty: there are too many.
    [[nodiscard]] std::optional<std::uint32_t> place_of(std::string_view name, std::string_view type,
                                                        MessageLayout layout);
    // From now on these alone.
    void want(std::span<const std::uint32_t> places);
    [[nodiscard]] const std::vector<BagTopic>& all() const noexcept { return topics_; }
    [[nodiscard]] const BagTopic& operator[](std::uint32_t place) const { return topics_[place]; }

private:
    std::vector<BagTopic> topics_;
    bool is_chosen_ = false;
};

struct BagMessage {
    std::uint32_t topic = 0;              // place in BagTopics
    std::int64_t time_ns = 0;             // when it was recorded
    std::span<const std::uint8_t> bytes;  // until the next call
};

// Bodies fail a CHECK instead of being pure: see docs/decisions.md (ports without __cxa_pure_virtual).
class BagReader {
public:
    virtual ~BagReader() = default;
    // kUnavailable: no such file, or it cannot be read.    kInvalid: another format, or a version of it that is not
    // known.    `message` is a sentence for the user.
    [[nodiscard]] virtual Status open(const std::string& file, BagTopics& topics, std::string& message) {
        static_cast<void>(file), static_cast<void>(topics), static_cast<void>(message);
        return not_implemented();
    }
    // The next wanted message. kOk.    kEnd: there is none.    kCorrupt: a piece of the bag is damaged and was passed
    // over, or the file is torn here; `message` says where. Calling again goes on behind it, or gives kEnd.
    [[nodiscard]] virtual Status next(BagMessage& out, std::string& message) {
        static_cast<void>(out), static_cast<void>(message);
        return not_implemented();
    }
    // Whether the recorder never closed the file; known at the end.
    [[nodiscard]] virtual bool is_unclosed() const { return false; }

protected:
    [[noreturn]] static Status not_implemented() noexcept {
        check_failed("BagReader not implemented", __FILE__, __LINE__);
    }
};

// By the file's first bytes. Null: it cannot be read (kUnavailable), or is no bag; `message` says why.
[[nodiscard]] std::unique_ptr<BagReader> open_bag_file(const std::string& file, BagTopics& topics,
                                                       std::string& message);

// All files of a bag, one behind the other. Calls as BagReader has them.
class BagSequence {
public:
    [[nodiscard]] Status open(const std::vector<std::string>& files, std::string& message);
    [[nodiscard]] Status next(BagMessage& out, std::string& message);
    [[nodiscard]] BagTopics& topics() noexcept { return topics_; }
    [[nodiscard]] bool is_unclosed() const noexcept { return is_unclosed_; }

private:
    std::vector<std::string> files_;
    std::size_t file_ = 0;  // that is being read
    BagTopics topics_;
    std::unique_ptr<BagReader> reader_;
    bool is_unclosed_ = false;
};

}  // namespace stillmesh
