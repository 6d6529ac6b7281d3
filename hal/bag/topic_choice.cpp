#include "hal/bag/topic_choice.hpp"

#include <algorithm>
#include <string_view>

#include "hal/calibration/ros_topics.hpp"

namespace stillmesh {
namespace {

constexpr std::int64_t kLook_ns = 1'000'000'000;      // from the first image on: every camera has shown itself
constexpr std::int64_t kLookMax_ns = 30'000'000'000;  // where something is missing
constexpr std::size_t kListedMax = 40;

[[nodiscard]] bool is_infrared(std::string_view name) {
    return name.find("infra") != std::string_view::npos || name.find("/ir/") != std::string_view::npos ||
           name.find("Infrared") != std::string_view::npos;
}

// Where the camera of an image is by the customs of ROS and of RealSense's own recordings.
[[nodiscard]] std::string info_name(std::string_view image) {
    constexpr std::string_view kRealSense = "/image/data";
    if (image.ends_with(kRealSense)) {
        return std::string(image.substr(0, image.size() - kRealSense.size())) + "/info/camera_info";
    }
    return info_beside(image);
}

}  // namespace

void TopicSurvey::take(const BagMessage& message) {
    const BagTopic& topic = topics_[message.topic];
    now_ns_ = std::max(now_ns_, message.time_ns);
    if (is_image_type(topic.type) && first_image_ns_ < 0) first_image_ns_ = message.time_ns;
    if (!is_image_type(topic.type)) take_transforms(topic.name, topic.type, message.bytes, topic.layout, frames_);
    if (seen_.contains(message.topic)) return;
    SeenTopic seen;
    std::string ignored;
    if (topic.type == kCameraInfoType) {
        CameraInfoMessage camera;
        if (!read_message(message.bytes, topic.layout, camera)) return;
        seen.frame_id = camera.frame_id.substr(0, kTopicNameMax);
        seen.size = {camera.width, camera.height};
        seen.camera = std::move(camera);
    } else if (topic.type == kFloatType) {
        float number = 0;
        if (!read_message(message.bytes, topic.layout, number)) return;
        seen.number = number;
    } else if (is_image_type(topic.type)) {
        BagImage image;
        if (read_bag_image(topic, message.bytes, image, ignored) != Status::kOk) return;
        seen.coding = image.coding;
        seen.size = image.size;
        seen.encoding = image.encoding.substr(0, 64);
        seen.frame_id = image.header.frame_id.substr(0, kTopicNameMax);
    }
    seen_.emplace(message.topic, std::move(seen));
}

const SeenTopic* TopicSurvey::seen(std::uint32_t place) const {
    const auto at = seen_.find(place);
    return at == seen_.end() ? nullptr : &at->second;
}

bool TopicSurvey::is_enough() const {
    if (first_image_ns_ < 0) return false;
    const std::int64_t looked_ns = now_ns_ - first_image_ns_;
    if (looked_ns > kLookMax_ns) return true;
    TopicChoice choice;
    std::string ignored;
    return looked_ns > kLook_ns && choose(choice, ignored) == Status::kOk;
}

TopicSurvey::Places TopicSurvey::images(bool wants_depth) const {
    Places out;
    for (const auto& [place, seen] : seen_) {
        if (wants_depth ? is_depth(seen.coding) : is_colour(seen.coding)) out.push_back(place);
    }
    const auto keep = [&out](auto is_kept) {  // unless that would leave none
        if (std::any_of(out.begin(), out.end(), is_kept)) std::erase_if(out, [&](auto p) { return !is_kept(p); });
    };
    keep([this](std::uint32_t p) { return !is_infrared(topics_[p].name); });
    const Places all = out;
    std::erase_if(out, [&](std::uint32_t p) {
        return topics_[p].type == kCompressedType && std::any_of(all.begin(), all.end(), [&](std::uint32_t other) {
                   return topics_[other].type == kImageType &&
                          topics_[other].name == without_transport(topics_[p].name);
               });
    });
    return out;
}

std::optional<std::uint32_t> TopicSurvey::place_named(std::string_view name) const {
    for (std::uint32_t i = 0; i < topics_.all().size(); ++i) {
        if (topics_[i].name == name) return i;
    }
    return std::nullopt;
}

// By its name; else the only one of the image's frame; else, for colour, the only one there is.
std::optional<std::uint32_t> TopicSurvey::info_of(std::uint32_t image, bool is_colour_image) const {
    const SeenTopic* const of = seen(image);
    const std::string name = info_name(topics_[image].name);
    Places same_frame, any;
    for (const auto& [place, seen] : seen_) {
        if (!seen.camera) continue;
        if (topics_[place].name == name) return place;
        any.push_back(place);
        if (of != nullptr && !seen.frame_id.empty() && seen.frame_id == of->frame_id) same_frame.push_back(place);
    }
    if (same_frame.size() == 1) return same_frame[0];
    if (is_colour_image && any.size() == 1) return any[0];
    return std::nullopt;
}

std::string TopicSurvey::list() const {
    std::string out;
    std::size_t count = 0;
    for (std::uint32_t i = 0; i < topics_.all().size() && count < kListedMax; ++i) {
        const BagTopic& topic = topics_[i];
        if (!is_image_type(topic.type) && topic.type != kCameraInfoType) continue;
        out += (count++ == 0 ? " " : ", ") + topic.name;
        const SeenTopic* const at = seen(i);
        if (at == nullptr) {
            out += " (no message yet)";
        } else {
            out += " (" + (at->camera ? std::string("CameraInfo") : at->encoding) + " " +
                   std::to_string(at->size.width) + "x" + std::to_string(at->size.height) + ")";
        }
    }
    return out.empty() ? " no images at all." : out + ".";
}

Status TopicSurvey::choose_named(TopicChoice& out, std::string& message) const {
    std::vector<std::string> names(1);
    for (const char letter : wish_) {
        if (letter == ',') {
            names.emplace_back();
        } else {
            names.back() += letter;
        }
    }
    if (names.size() != 2 && names.size() != 3) {
        message = "--topics " + wish_ + ": give COLOUR,DEPTH or COLOUR,DEPTH,INFO; the bag has" + list();
        return Status::kInvalid;
    }
    std::uint32_t places[3] = {};
    for (std::size_t i = 0; i < names.size(); ++i) {
        const auto place = place_named(names[i]);
        const SeenTopic* const at = place ? seen(*place) : nullptr;
        const bool fits = at != nullptr && (i == 0   ? is_colour(at->coding)
                                            : i == 1 ? is_depth(at->coding)
                                                     : at->camera.has_value());
        if (!fits) {
            const char* const what = i == 0 ? "colour images" : i == 1 ? "depth images" : "a CameraInfo";
            message =
                "--topics: '" + names[i] + "' is no topic with " + what + " that are read here; the bag has" + list();
            return Status::kInvalid;
        }
        places[i] = *place;
    }
    out.colour = places[0];
    out.depth = places[1];
    if (names.size() == 3) out.info = places[2];
    return Status::kOk;
}

Status TopicSurvey::choose_alone(TopicChoice& out, std::string& message) const {
    const Places colour = images(false);
    Places depth = images(true);
    if (colour.size() == 1 && depth.size() > 1) {
        const std::string& frame = seen(colour[0])->frame_id;
        const auto is_registered = [&](std::uint32_t p) { return !frame.empty() && seen(p)->frame_id == frame; };
        if (std::any_of(depth.begin(), depth.end(), is_registered))
            std::erase_if(depth, [&](std::uint32_t p) { return !is_registered(p); });
    }
    if (colour.size() == 1 && depth.size() == 1) {
        out.colour = colour[0];
        out.depth = depth[0];
        return Status::kOk;
    }
    const auto count = [](const Places& places, const char* what) {
        return (places.empty() ? std::string("no topic") : std::to_string(places.size()) + " topics") + " with " + what;
    };
    message = (colour.size() != 1 ? count(colour, "colour images") : count(depth, "depth images")) +
              " that are read here; name them with --topics COLOUR,DEPTH,INFO. The bag has" + list();
    return Status::kInvalid;
}

Status TopicSurvey::choose(TopicChoice& out, std::string& message) const {
    out = {};
    STILLMESH_TRY(wish_.empty() ? choose_alone(out, message) : choose_named(out, message));
    if (!out.info) out.info = info_of(out.colour, true);
    out.depth_info = info_of(out.depth, false);
    for (const auto& [place, seen] : seen_) {
        const std::string& name = topics_[place].name;
        const bool is_unit = name.find("/option/Depth Units") != std::string::npos ||
                             name.find("/option/Depth_Units") != std::string::npos;
        if (seen.number && is_unit) out.depth_unit_m = seen.number;
    }
    if (out.info || !needs_info_) return Status::kOk;
    message = "no CameraInfo beside " + topics_[out.colour].name +
              "; name one with --topics COLOUR,DEPTH,INFO, or give the camera with --calibration. The bag has" + list();
    return Status::kInvalid;
}

}  // namespace stillmesh
