// A world put together by hand, without a picture: features lie where a test puts them, the depth image is what it
// paints, and points and keyframes go straight into the map.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/parameters.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/world/world.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::test {

inline CameraModel small_camera() {
    CameraModel out;
    out.width = 160;
    out.height = 120;
    out.fx = 130;
    out.fy = 128;
    out.cx = 79.5;
    out.cy = 59.5;
    return out;
}

inline Parameters small_parameters() {
    Parameters out;
    out.features.count = Limits::tiny().features_max;
    out.features.levels = Limits::tiny().pyramid_levels_max;
    return out;
}

// What the small camera sees at a pixel, z_m away.
inline Vector3 point_at_pixel(double x, double y, double z_m) {
    const CameraModel camera = small_camera();
    return {(x - camera.cx) / camera.fx * z_m, (y - camera.cy) / camera.fy * z_m, z_m};
}

// The n-th of descriptors that are all far from each other.
inline Descriptor descriptor_of(std::uint64_t n) {
    Random random(1000 + n);
    Descriptor out;
    for (std::uint64_t& word : out.words) word = random.next();
    return out;
}

class SmallWorld {
public:
    explicit SmallWorld(const Parameters& parameters = small_parameters(), const Limits& limits = Limits::tiny())
        : memory_(planned(limits)) {
        Arena arena(memory_.span());
        world_.create(arena, limits, parameters, small_camera());
    }
    [[nodiscard]] World& operator*() { return world_; }
    [[nodiscard]] World* operator->() { return &world_; }
    [[nodiscard]] Map& map() { return world_.map; }

    // A point that has stood still for long, known to a centimetre.
    Handle<MapPoint> add_point(const Vector3& p_world, const Descriptor& descriptor = {}) {
        const Handle<MapPoint> out = map().add_point().value();
        MapPoint& point = *map().points().find(out);
        store(p_world, point.world);
        store(p_world, point.anchor);
        point.var_z = point.var_lateral = point.anchor_var_z = point.anchor_var_lateral = 1e-4;
        point.descriptor = descriptor;
        point.distance_m = 2;
        point.weight_tenths = 15;
        point.seen = 20;
        return out;
    }
    [[nodiscard]] MapPoint& operator[](Handle<MapPoint> point) { return *map().points().find(point); }
    Handle<Keyframe> add_keyframe(const SE3& world_from_camera, std::uint64_t frame) {
        const Handle<Keyframe> out = map().add_keyframe();
        Keyframe& keyframe = *map().keyframes().find(out);
        keyframe.world_from_camera = world_from_camera;
        keyframe.frame = frame;
        keyframe.last_useful_frame = frame;
        map().attach(out);  // to the newest of those before
        return out;
    }
    [[nodiscard]] Keyframe& operator[](Handle<Keyframe> keyframe) { return *map().keyframes().find(keyframe); }

private:
    static std::size_t planned(const Limits& limits) {
        ArenaPlan plan;
        World::plan(plan, limits);
        return plan.used_bytes();
    }
    Memory memory_;
    World world_;
};

// A room that plans with the limits of a world, and takes limits and parameters from it.
template <typename Room>
class InWorld {
public:
    explicit InWorld(const World& world) : memory_(planned(world.limits)) {
        Arena arena(memory_.span());
        room_.create(arena, world.limits, world.parameters);
    }
    [[nodiscard]] Room* operator->() { return &room_; }
    [[nodiscard]] Room& operator*() { return room_; }

private:
    static std::size_t planned(const Limits& limits) {
        ArenaPlan plan;
        Room::plan(plan, limits);
        return plan.used_bytes();
    }
    Memory memory_;
    Room room_;
};

// Finds what it was given, whatever the picture shows.
class ScriptedExtractor final : public FeatureExtractor {
public:
    std::vector<Keypoint> keypoints;
    std::vector<Descriptor> descriptors;
    Status status = Status::kOk;

    Status extract(const GreyView&, FeatureSet& features) noexcept override {
        features.clear();
        for (const Keypoint& keypoint : keypoints) static_cast<void>(features.keypoints.push(keypoint));
        for (const Descriptor& descriptor : descriptors) static_cast<void>(features.descriptors.push(descriptor));
        return status;
    }
};

// A frame of the small camera as tracking has it before it knows the pose.
class SmallFrame {
public:
    explicit SmallFrame(World& world) : memory_(planned(world.limits)) {
        Arena arena(memory_.span());
        measured.create(arena, world.limits, world.parameters, world.camera, cpu_kernels(), &extractor);
        matcher.create(arena, world.limits, world.parameters.matching, world.camera, world.pixel_noise.scales());
        const std::size_t pixels = std::size_t{world.camera.width} * world.camera.height;
        grey_.resize(pixels);
        depth_.resize(pixels);
        frame_.format = PixelFormat::kGrey8;
        frame_.colour = {grey_.data(), world.camera.width, world.camera.height, world.camera.width};
        frame_.depth = {depth_.data(), world.camera.width, world.camera.height, world.camera.width};
        frame_.depth_units_per_m = 5000;
    }
    SmallFrame(const SmallFrame&) = delete;
    SmallFrame& operator=(const SmallFrame&) = delete;

    // The depth of a pixel and the eight around it; 0: none was measured.
    void paint(std::uint32_t x, std::uint32_t y, double z_m) {
        for (std::uint32_t v = y - 1; v <= y + 1; ++v) {
            for (std::uint32_t u = x - 1; u <= x + 1; ++u) {
                depth_[v * frame_.depth.width + u] = static_cast<std::uint16_t>(z_m * frame_.depth_units_per_m + 0.5);
            }
        }
    }
    // A feature there; its index.
    std::size_t add(std::uint32_t x, std::uint32_t y, double z_m, const Descriptor& descriptor,
                    std::uint8_t level = 0) {
        paint(x, y, z_m);
        Keypoint keypoint;
        keypoint.x = static_cast<float>(x);
        keypoint.y = static_cast<float>(y);
        keypoint.level = level;
        extractor.keypoints.push_back(keypoint);
        extractor.descriptors.push_back(descriptor);
        return extractor.keypoints.size() - 1;
    }
    // All that was added becomes the frame at hand; nothing is matched yet.
    void measure() {
        measured.extract(measured.grey_of(frame_));
        measured.measure(frame_);
        matcher.begin(measured.features());
    }
    [[nodiscard]] Frame& frame() { return frame_; }
    [[nodiscard]] std::vector<std::uint16_t>& depth() { return depth_; }

    ScriptedExtractor extractor;
    MeasuredFrame measured;
    MapMatcher matcher;

private:
    static std::size_t planned(const Limits& limits) {
        ArenaPlan plan;
        MeasuredFrame::plan(plan, limits);
        MapMatcher::plan(plan, limits);
        return plan.used_bytes();
    }
    Memory memory_;
    std::vector<std::uint8_t> grey_;
    std::vector<std::uint16_t> depth_;
    Frame frame_;
};

}  // namespace stillmesh::test
