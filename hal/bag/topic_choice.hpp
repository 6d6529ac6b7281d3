// Which topics of a bag are colour, depth and the camera: those that are named, or what the bag's first seconds show,
// where that leaves no doubt. Infrared beside colour is left out, of an image that is there twice the one that is not
// packed is taken, and of several depth topics the one in colour's frame. Where more than one is left, or none, a
// sentence lists what there is. Memory: a few hundred bytes a topic.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hal/bag/bag_images.hpp"
#include "hal/bag/bag_reader.hpp"
#include "hal/bag/frame_messages.hpp"

namespace stillmesh {

// What the first message of a topic that can be read says.
struct SeenTopic {
    PixelCoding coding = PixelCoding::kOther;
    ImageSize size;
    std::string encoding;
    std::string frame_id;
    std::optional<CameraInfoMessage> camera;  // of a CameraInfo
    std::optional<float> number;              // of a Float32
};

struct TopicChoice {
    std::uint32_t colour = 0, depth = 0;            // places in BagTopics
    std::optional<std::uint32_t> info, depth_info;  // cameras of them
    std::optional<float> depth_unit_m;              // what a RealSense recording says of its depth
};

class TopicSurvey {
public:
    // `wish`: "", or COLOUR,DEPTH or COLOUR,DEPTH,INFO. `needs_info`: no calibration comes from elsewhere.
    TopicSurvey(const BagTopics& topics, std::string wish, bool needs_info)
        : topics_(topics), wish_(std::move(wish)), needs_info_(needs_info) {}

    void take(const BagMessage& message);
    // Nothing that may still come would change the choice, or enough was seen to stop looking.
    [[nodiscard]] bool is_enough() const;
    // kInvalid: `message` is a sentence with the topics that there are.
    [[nodiscard]] Status choose(TopicChoice& out, std::string& message) const;
    [[nodiscard]] const SeenTopic* seen(std::uint32_t place) const;
    [[nodiscard]] const FrameTree& frames() const { return frames_; }

private:
    using Places = std::vector<std::uint32_t>;
    [[nodiscard]] Places images(bool wants_depth) const;
    [[nodiscard]] std::optional<std::uint32_t> place_named(std::string_view name) const;
    [[nodiscard]] std::optional<std::uint32_t> info_of(std::uint32_t image, bool is_colour_image) const;
    [[nodiscard]] Status choose_named(TopicChoice& out, std::string& message) const;
    [[nodiscard]] Status choose_alone(TopicChoice& out, std::string& message) const;
    [[nodiscard]] std::string list() const;

    const BagTopics& topics_;
    std::string wish_;
    bool needs_info_;
    std::map<std::uint32_t, SeenTopic> seen_;
    FrameTree frames_;
    std::int64_t first_image_ns_ = -1, now_ns_ = 0;
};

}  // namespace stillmesh
