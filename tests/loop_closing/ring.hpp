// A camera that comes home after a lap, with loop closing and the refinement after it, and their map open to the eye.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/geometry/trig.hpp"
#include "engine/loop_closing/loop_closing.hpp"
#include "engine/mapping/global_refinement.hpp"
#include "engine/mapping/mapping.hpp"
#include "engine/tracking/tracking.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::test {

inline constexpr std::uint32_t kLap = 40;  // keyframes
inline constexpr double kDrift_rad = 0.004, kDrift_m = 0.01;

inline Limits limits_of_ring() {
    Limits limits = Limits::tiny();
    limits.image_width_max = 640;
    limits.image_height_max = 480;
    limits.keyframes_max = 64;
    limits.map_points_max = 8000;
    limits.features_max = 200;
    return limits;
}

inline Parameters configuration_of_ring() {
    Parameters out;
    out.features.count = 200;
    out.features.levels = 3;
    out.loop.gap_frames = 400;
    out.weights.proven_s = 0;  // these keyframes come without a clock
    return out;
}

inline CameraModel camera_of_ring() {
    CameraModel out;
    out.width = 640;
    out.height = 480;
    out.fx = out.fy = 525;
    out.cx = 319.5;
    out.cy = 239.5;
    return out;
}

// A camera goes round in a cylindrical room, looking outward; its odometry drifts. Keyframes and points go straight
// into the map, as tracking would have put them there: a wall feature that nobody has seen for some keyframes is a new
// point. The same bits on every processor.
class Ring {
public:
    explicit Ring(const Parameters& configuration = configuration_of_ring(), bool has_vocabulary = true,
                  bool is_drifting = true, double pixel_noise = 0.0003)
        : configuration_(configuration), memory_(planned()), is_drifting_(is_drifting), pixel_noise_(pixel_noise) {
        const RandomTree shape{6, 3, 0, 3};
        bytes_ = vocabulary_bytes(shape);
        const char* sentence = nullptr;
        if (has_vocabulary) {
            EXPECT_EQ(vocabulary_.open(bytes_, limits().vocabulary_words_max, sentence), Status::kOk);
        }
        Arena arena(memory_.span());
        world_.create(arena, limits(), configuration_, camera_of_ring());
        tracking_.create(arena, world_, cpu_kernels(), nullptr);
        mapping_.create(arena, world_);
        places_.create(arena, limits(), configuration_, camera_of_ring(), vocabulary_);
        loops_.create(arena, world_, places_, mapping_.fusion());
        refinement_.create(arena, world_);
        EXPECT_EQ(arena.used_bytes(), memory_.span().size());
        // Features near the words of the tree, so that they have the same word from wherever they are seen.
        std::vector<Descriptor> leaves;
        collect(shape.grow(), leaves);
        Random random(11);
        for (int i = 0; i < 2500; ++i) {
            Feature feature;
            const double angle = random.uniform(0, 6.2831853);
            const double radius = random.uniform(2.5, 3.5);
            const SinCos at = sin_cos(angle);
            feature.world = Vector3(radius * at.sin, random.uniform(-1.0, 1.0), radius * at.cos);
            const std::uint32_t leaf = random.below(static_cast<std::uint32_t>(leaves.size()));
            feature.descriptor = disturbed(leaves[leaf], 24, random);
            wall_.push_back(feature);
        }
    }
    static Limits limits() { return limits_of_ring(); }
    Map& map() { return world_.map; }
    World& world() { return world_; }
    LoopClosing& loops() { return loops_; }
    PlaceSearch& places() { return places_; }
    GlobalRefinement& refinement() { return refinement_; }
    Mapping& mapping() { return mapping_; }

    // Keyframe i, 20 frames after the one before.
    Handle<Keyframe> add_keyframe(std::uint32_t i) {
        Random random(1000 + i);
        const double angle = 6.2831853 * i / kLap;
        SE3 truth;
        truth.rotation = so3_exp(Vector3(0, angle, 0));
        const SinCos at = sin_cos(angle);
        truth.translation = Vector3(at.sin, 0.02 * sin_cos(3 * angle).sin, at.cos);
        if (truth_.empty()) {
            estimate_ = truth;
        } else {
            Vector6 bias = Vector6::Zero();
            if (is_drifting_) {
                bias(1) = kDrift_m;  // along the motion it would make the ring larger, which no loop can tell
                bias(4) = kDrift_rad;
            }
            // As tracking does, from where the last keyframe lies by now.
            estimate_ = map().keyframes().find(map().recent_keyframe(0))->world_from_camera *
                        (truth_.back().inverse() * truth) * se3_exp(bias);
            renormalise(estimate_.rotation);
        }
        truth_.push_back(truth);
        const Handle<Keyframe> handle = map().add_keyframe();
        Keyframe& keyframe = *map().keyframes().find(handle);
        keyframe.world_from_camera = estimate_;
        keyframe.frame = 20 * i;
        keyframe.drift_m = static_cast<float>(i) * 0.02F;
        const SE3 camera_from_world = truth.inverse();
        const CameraModel camera = camera_of_ring();
        std::uint32_t seen = 0;
        for (Feature& feature : wall_) {
            const Vector3 q = camera_from_world * feature.world;
            if (q.z() < 0.5 || seen == 200) continue;
            const double x = camera.fx * q.x() / q.z() + camera.cx;
            const double y = camera.fy * q.y() / q.z() + camera.cy;
            if (x < 5 || y < 5 || x > 634 || y > 474) continue;
            if (random.below(10) == 0) continue;  // missed
            ++seen;
            Observation o;
            o.x = static_cast<float>(x);
            o.y = static_cast<float>(y);
            o.normalised_x = static_cast<float>(q.x() / q.z() + pixel_noise_ * random.normal());
            o.normalised_y = static_cast<float>(q.y() / q.z() + pixel_noise_ * random.normal());
            const double sigma = 1.425e-3 * q.z() * q.z();
            o.z_m = static_cast<float>(q.z() + sigma * random.normal());
            o.var_z = static_cast<float>(sigma * sigma);
            if (feature.last_keyframe + 6 < static_cast<std::int32_t>(i) ||
                map().points().find(feature.point) == nullptr) {
                feature.point = map().add_point().value();
                MapPoint& point = *map().points().find(feature.point);
                const auto z = static_cast<double>(o.z_m);
                store(estimate_ *
                          Vector3(static_cast<double>(o.normalised_x) * z, static_cast<double>(o.normalised_y) * z, z),
                      point.world);
                store(vector_of(point.world), point.anchor);
                point.var_z = sigma * sigma;
                point.var_lateral = 0.002 * 0.002 * q.z() * q.z();
                point.descriptor = feature.descriptor;
                point.distance_m = o.z_m;
                point.weight_tenths = 15;
                point.last_seen_frame = keyframe.frame;
                point.seen = 10;
            }
            feature.last_keyframe = static_cast<std::int32_t>(i);
            o.point = feature.point;
            map().add_observation(handle, o, disturbed(feature.descriptor, 8, random));
        }
        map().attach(handle);
        return handle;
    }
    // Everything that waits, in slices; at most so many (0: all).
    std::uint64_t work(std::uint32_t slice_units, std::uint64_t slices_max = 0) {
        std::uint64_t slices = 0;
        for (;;) {
            WorkBudget budget(slice_units);
            Progress progress = loops_.step(budget);
            EXPECT_LE(budget.units_spent(), std::uint64_t{slice_units} + loops_.piece_units_max());
            if (progress == Progress::kIdle) {
                progress = refinement_.step(budget);
                EXPECT_LE(budget.units_spent(), std::uint64_t{slice_units} + refinement_.piece_units_max());
            }
            if (progress == Progress::kIdle) {
                EXPECT_EQ(budget.units_spent(), 0U);
                return slices;
            }
            if (++slices == slices_max) return slices;
        }
    }
    // As Engine::reset() does, and the wall is new to everybody.
    void forget() {
        world_.reset();
        tracking_.reset();
        mapping_.reset();
        places_.reset();
        loops_.reset();
        refinement_.reset();
        truth_.clear();
        for (Feature& feature : wall_) {
            feature.point = {};
            feature.last_keyframe = -100;
        }
    }
    // Where a camera that began at the origin is, once it has followed the map.
    SE3 camera() { return world_.camera_move.is_any ? world_.camera_move.correction : SE3{}; }
    SE3 newest() { return map().keyframes().find(map().recent_keyframe(0))->world_from_camera; }
    // What tracking gives out when the next picture shows nothing.
    const PoseEstimate& given_out() {
        const CameraModel camera = camera_of_ring();
        const std::vector<std::uint8_t> grey(std::size_t{camera.width} * camera.height);
        const std::vector<std::uint16_t> depth(grey.size());
        Frame frame;
        frame.format = PixelFormat::kGrey8;
        frame.colour = {grey.data(), camera.width, camera.height, camera.width};
        frame.depth = {depth.data(), camera.width, camera.height, camera.width};
        frame.depth_units_per_m = 5000;
        tracking_.track(frame);
        return world_.pose;
    }
    const LoopStatistics& statistics() const { return world_.statistics.loop; }
    // Root mean square of the keyframes' distance from where they truly are.
    double off_m() {
        double sum = 0;
        std::uint32_t count = 0;
        for (std::uint32_t slot = 0; slot < map().keyframes().slots_count(); ++slot) {
            if (!map().keyframes().is_taken(slot)) continue;
            const Keyframe& keyframe = map().keyframes().at(slot);
            sum += (keyframe.world_from_camera.translation - truth_[keyframe.frame / 20].translation).squaredNorm();
            ++count;
        }
        return std::sqrt(sum / count);
    }
    const SE3& truth(std::uint32_t i) const { return truth_[i]; }

private:
    struct Feature {
        Vector3 world;
        Descriptor descriptor;
        Handle<MapPoint> point;
        std::int32_t last_keyframe = -100;
    };
    static void collect(const Node& node, std::vector<Descriptor>& leaves) {
        if (node.children.empty()) leaves.push_back(node.median);
        for (const Node& child : node.children) collect(child, leaves);
    }
    static std::size_t planned() {
        ArenaPlan plan;
        World::plan(plan, limits());
        Tracking::plan(plan, limits());
        Mapping::plan(plan, limits());
        PlaceSearch::plan(plan, limits());
        LoopClosing::plan(plan, limits());
        GlobalRefinement::plan(plan, limits());
        return plan.used_bytes();
    }
    Parameters configuration_;
    Memory memory_;
    bool is_drifting_;
    double pixel_noise_;  // of normalised coordinates
    std::vector<std::byte> bytes_;
    Vocabulary vocabulary_;
    World world_;
    Tracking tracking_;
    Mapping mapping_;
    PlaceSearch places_;
    LoopClosing loops_;
    GlobalRefinement refinement_;
    std::vector<Feature> wall_;
    std::vector<SE3> truth_;
    SE3 estimate_;
};

}  // namespace stillmesh::test
