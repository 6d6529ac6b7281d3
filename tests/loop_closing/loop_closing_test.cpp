#include "engine/loop_closing/loop_closing.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "engine/mapping/mapping.hpp"
#include "engine/tracking/tracking.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kLap = 40;  // keyframes
constexpr double kDrift_rad = 0.004, kDrift_m = 0.01;

Limits limits_of_ring() {
    Limits limits = Limits::tiny();
    limits.image_width_max = 640;
    limits.image_height_max = 480;
    limits.keyframes_max = 64;
    limits.map_points_max = 8000;
    limits.features_max = 200;
    return limits;
}

Configuration configuration_of_ring() {
    Configuration out;
    out.features.count = 200;
    out.features.levels = 3;
    out.loop.gap_frames = 400;
    out.loop.settle_s = 0;  // these keyframes come without a clock
    return out;
}

CameraModel camera_of_ring() {
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
// point.
class Ring {
public:
    explicit Ring(const Configuration& configuration = configuration_of_ring(), bool has_vocabulary = true,
                  bool is_drifting = true, double pixel_noise = 0.0003)
        : configuration_(configuration), memory_(planned()), is_drifting_(is_drifting), pixel_noise_(pixel_noise) {
        const test::RandomTree shape{6, 3, 0, 3};
        bytes_ = test::vocabulary_bytes(shape);
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
        EXPECT_EQ(arena.used_bytes(), memory_.span().size());
        // Features near the words of the tree, so that they have the same word from wherever they are seen.
        std::vector<Descriptor> leaves;
        collect(shape.grow(), leaves);
        Random random(11);
        for (int i = 0; i < 2500; ++i) {
            Feature feature;
            const double angle = random.uniform(0, 6.2831853);
            const double radius = random.uniform(2.5, 3.5);
            feature.world = Vector3(radius * std::sin(angle), random.uniform(-1.0, 1.0), radius * std::cos(angle));
            const std::uint32_t leaf = random.below(static_cast<std::uint32_t>(leaves.size()));
            feature.descriptor = test::disturbed(leaves[leaf], 24, random);
            wall_.push_back(feature);
        }
    }
    static Limits limits() { return limits_of_ring(); }
    Map& map() { return world_.map; }
    World& world() { return world_; }
    LoopClosing& loops() { return loops_; }

    // Keyframe i, 20 frames after the one before.
    Handle<Keyframe> add_keyframe(std::uint32_t i) {
        Random random(1000 + i);
        const double angle = 6.2831853 * i / kLap;
        SE3 truth;
        truth.rotation = so3_exp(Vector3(0, angle, 0));
        truth.translation = Vector3(std::sin(angle), 0.02 * std::sin(3 * angle), std::cos(angle));
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
            map().add_observation(handle, o, test::disturbed(feature.descriptor, 8, random));
        }
        map().attach(handle);
        return handle;
    }
    // Everything that waits, in slices; at most so many (0: all).
    std::uint64_t work(std::uint32_t slice_units, std::uint64_t slices_max = 0) {
        std::uint64_t slices = 0;
        for (;;) {
            WorkBudget budget(slice_units);
            const Progress progress = loops_.step(budget);
            EXPECT_LE(budget.units_spent(), std::uint64_t{slice_units} + loops_.piece_units_max());
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
    LoopStatistics statistics() const {
        EngineStatistics out;
        loops_.fill(out);
        return out.loop;
    }
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
    static void collect(const test::Node& node, std::vector<Descriptor>& leaves) {
        if (node.children.empty()) leaves.push_back(node.median);
        for (const test::Node& child : node.children) collect(child, leaves);
    }
    static std::size_t planned() {
        ArenaPlan plan;
        World::plan(plan, limits());
        Tracking::plan(plan, limits());
        Mapping::plan(plan, limits());
        PlaceSearch::plan(plan, limits());
        LoopClosing::plan(plan, limits());
        return plan.used_bytes();
    }
    Configuration configuration_;
    test::Memory memory_;
    bool is_drifting_;
    double pixel_noise_;  // of normalised coordinates
    std::vector<std::byte> bytes_;
    Vocabulary vocabulary_;
    World world_;
    Tracking tracking_;
    Mapping mapping_;
    PlaceSearch places_;
    LoopClosing loops_;
    std::vector<Feature> wall_;
    std::vector<SE3> truth_;
    SE3 estimate_;
};

// Promise: coming home after a lap closes the loop once, takes the drift away, makes duplicates one, moves the camera
// with the newest keyframe and gives the jump to map_from_odom alone; what the map keeps incrementally stays right.
TEST(LoopClosing, ComingHomeTakesTheDriftAway) {
    auto ring = std::make_unique<Ring>();
    double before = 0;
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        static_cast<void>(ring->add_keyframe(i));
        before = std::max(before, ring->off_m());
        const SE3 newest_before = ring->newest();
        const SE3 camera_before = ring->camera();
        ring->work(2000);
        // Whenever the map moved, the camera did what the newest keyframe did.
        const SE3 left = ring->newest() * newest_before.inverse() * camera_before;
        const SE3 camera = ring->camera();
        EXPECT_LT((camera.translation - left.translation).squaredNorm(), 1e-20) << i;
        EXPECT_LT((camera.rotation - left.rotation).squaredNorm(), 1e-20) << i;
    }
    const double camera_jumped_m = std::sqrt(ring->camera().translation.squaredNorm());
    const PoseEstimate& pose = ring->given_out();
    double odometry_jumped_m = 0, map_jumped_m = 0;
    for (int k = 0; k < 3; ++k) {
        odometry_jumped_m += std::abs(pose.odom_from_camera.translation_m[k]);
        map_jumped_m += std::abs(pose.map_from_odom.translation_m[k]);
    }
    EXPECT_GT(camera_jumped_m, 0.05);
    EXPECT_GE(map_jumped_m, camera_jumped_m * 0.99);
    EXPECT_LT(odometry_jumped_m, 1e-9);
    const LoopStatistics s = ring->statistics();
    std::printf(
        "off %.3f m before, %.3f m after; correction %.3f m, fused %llu, candidates %llu; refused: matches %llu, pose "
        "%llu, inliers %llu, spread %llu, far %llu, unlikely %llu\n",
        before, ring->off_m(), s.largest_correction_m, static_cast<unsigned long long>(s.points_fused),
        static_cast<unsigned long long>(s.candidates), static_cast<unsigned long long>(s.refused_matches),
        static_cast<unsigned long long>(s.refused_pose), static_cast<unsigned long long>(s.refused_inliers),
        static_cast<unsigned long long>(s.refused_spread), static_cast<unsigned long long>(s.refused_far),
        static_cast<unsigned long long>(s.refused_unlikely));
    EXPECT_EQ(s.closed, 1U);
    EXPECT_GT(before, 0.1);
    EXPECT_LT(ring->off_m(), 0.25 * before);
    EXPECT_GT(s.largest_correction_m, 0.1);
    EXPECT_GT(s.points_fused, 30U);
    EXPECT_EQ(ring->map().find_fault(), nullptr) << ring->map().find_fault();
}

// Promise: any slicing gives the same map, and no slice goes beyond its budget by more than the stated ceiling.
TEST(LoopClosing, AnySlicingGivesTheSameBits) {
    std::vector<std::uint64_t> wanted;
    for (const std::uint32_t slice : {1'000'000U, 1U, 777U}) {
        auto ring = std::make_unique<Ring>();
        std::vector<std::uint64_t> hashes;
        for (std::uint32_t i = 0; i < kLap + 10; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(slice);
            hashes.push_back(ring->map().changes_hash());
        }
        hashes.push_back(ring->statistics().closed);
        if (wanted.empty()) wanted = hashes;
        ASSERT_EQ(hashes, wanted) << slice;
        EXPECT_EQ(ring->statistics().closed, 1U);
    }
}

// Promise: keyframes made while the graph is being solved follow their parent; those that leave meanwhile do no harm.
TEST(LoopClosing, TheMapMayChangeMeanwhile) {
    auto ring = std::make_unique<Ring>();
    std::uint32_t made = 0;
    Random random(3);
    while (ring->loops().stage() != LoopClosing::Stage::kSolve && made < kLap + 12) {
        static_cast<void>(ring->add_keyframe(made++));
        for (int i = 0; i < 20000 && ring->loops().stage() != LoopClosing::Stage::kSolve; ++i) {
            WorkBudget budget(100);
            if (ring->loops().step(budget) == Progress::kIdle) break;
        }
    }
    ASSERT_EQ(ring->loops().stage(), LoopClosing::Stage::kSolve);
    const double before = ring->off_m();
    const Handle<Keyframe> new_one = ring->add_keyframe(made++);
    for (int i = 0; i < 6; ++i) {
        const std::uint32_t slot = 5 + random.below(20);
        if (ring->map().keyframes().is_taken(slot))
            ring->map().release_keyframe(ring->map().keyframes().handle_of(slot));
    }
    ring->work(500);
    EXPECT_EQ(ring->statistics().closed, 1U);
    EXPECT_EQ(ring->map().find_fault(), nullptr) << ring->map().find_fault();
    EXPECT_LT(ring->off_m(), 0.4 * before);
    ASSERT_NE(ring->map().keyframes().find(new_one), nullptr);
    const Vector3 off =
        ring->map().keyframes().find(new_one)->world_from_camera.translation - ring->truth(made - 1).translation;
    EXPECT_LT(std::sqrt(off.squaredNorm()), 0.1);
}

// Promise: whatever leaves the map at whatever moment, nothing breaks and no fault is left behind.
TEST(LoopClosing, AnythingMayLeaveAtAnyTime) {
    std::uint32_t left_while_searching = 0, left_while_moving = 0;
    std::uint64_t closed = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        auto ring = std::make_unique<Ring>();
        Random random(seed);
        for (std::uint32_t i = 0; i < kLap + 12; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            for (int round = 0; round < 6; ++round) {
                ring->work(30, i < kLap ? 0 : 1 + random.below(40));
                const LoopClosing::Stage stage = ring->loops().stage();
                // A map that is being moved is a rare sight.
                const bool is_moving = stage >= LoopClosing::Stage::kBuild;
                if (i < kLap || (!is_moving && random.below(4) != 0)) continue;
                const std::uint32_t slot = random.below(static_cast<std::uint32_t>(kLap));
                if (!ring->map().keyframes().is_taken(slot)) continue;
                ring->map().release_keyframe(ring->map().keyframes().handle_of(slot));
                if (is_moving) {
                    ++left_while_moving;
                } else if (stage != LoopClosing::Stage::kIdle) {
                    ++left_while_searching;
                }
            }
        }
        ring->work(1000);
        EXPECT_EQ(ring->map().find_fault(), nullptr) << ring->map().find_fault();
        closed += ring->statistics().closed;
    }
    // It was not all over when they left.
    EXPECT_GE(left_while_searching, 3U);
    EXPECT_GE(left_while_moving, 3U);
    EXPECT_GE(closed, 3U);
}

// Promise: a place farther than odometry can have drifted is none, however alike; nor one farther than the distance
// limit; nor one that fewer queries agree on than asked. Without a vocabulary, or switched off, there is no work at
// all.
TEST(LoopClosing, RefusesWhatCannotBe) {
    const auto go = [](Configuration configuration, bool has_vocabulary, std::uint32_t keyframes) {
        auto ring = std::make_unique<Ring>(configuration, has_vocabulary);
        for (std::uint32_t i = 0; i < keyframes; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(100'000);
        }
        return ring->statistics();
    };
    Configuration configuration = configuration_of_ring();
    configuration.loop.drift_m = 0;
    configuration.loop.drift_share = 0;
    auto ring = std::make_unique<Ring>(configuration);
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        const Handle<Keyframe> handle = ring->add_keyframe(i);
        ring->map().keyframes().find(handle)->drift_m = 0.001F * static_cast<float>(i);
        ring->work(100'000);
    }
    EXPECT_GT(ring->statistics().refused_unlikely, 0U);
    EXPECT_EQ(ring->statistics().closed, 0U);

    configuration = configuration_of_ring();
    configuration.loop.distance_max_m = 0.01;
    LoopStatistics s = go(configuration, true, kLap + 10);
    EXPECT_EQ(s.closed, 0U);
    EXPECT_GT(s.refused_far, 0U);

    configuration = configuration_of_ring();
    configuration.loop.consistency = 0;
    const std::uint64_t at_once = go(configuration, true, kLap).candidates;
    EXPECT_GT(at_once, go(configuration_of_ring(), true, kLap).candidates);

    EXPECT_EQ(go(configuration_of_ring(), false, kLap + 10).queries, 0U);
    configuration = configuration_of_ring();
    configuration.loop.is_enabled = false;
    EXPECT_EQ(go(configuration, true, kLap + 10).queries, 0U);
}

// Promise: without drift a place is confirmed, and the map stays where it is.
TEST(LoopClosing, ConfirmsWhereNothingDrifted) {
    auto ring = std::make_unique<Ring>(configuration_of_ring(), true, false);
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        static_cast<void>(ring->add_keyframe(i));
        ring->work(5000);
    }
    const LoopStatistics s = ring->statistics();
    EXPECT_EQ(s.closed, 0U);
    EXPECT_EQ(s.confirmed, 1U);
    EXPECT_LT(ring->off_m(), 1e-9);
}

// Promise: what verification cannot tell from no drift at all is confirmed, however many millimetres it says: the map
// knows better. (A place seen by some points far away was "corrected" by 2.3 cm with a deviation of 2.)
TEST(LoopClosing, WhatIsWithinItsNoiseIsNoDrift) {
    Configuration configuration = configuration_of_ring();
    configuration.loop.correction_min_m = 0.0005;
    configuration.loop.correction_min_rad = 0.0005;
    const auto go = [&](double chi2_min) {
        configuration.loop.correction_chi2_min = chi2_min;
        auto ring = std::make_unique<Ring>(configuration, true, false, 0.001);
        for (std::uint32_t i = 0; i < kLap + 10; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(5000);
        }
        return std::pair(ring->statistics(), ring->off_m());
    };
    const auto [held, held_off_m] = go(LoopParameters().correction_chi2_min);
    EXPECT_EQ(held.closed, 0U);
    EXPECT_EQ(held.confirmed, 1U);
    EXPECT_LT(held_off_m, 1e-9);
    const auto [moved, moved_off_m] = go(0);  // the same place, taken at its word
    EXPECT_EQ(moved.closed, 1U);
    EXPECT_GT(moved_off_m, 0.001);
}

// Promise: nothing is looked up, and no place known, before what a keyframe saw has had the time to prove that it
// stands.
TEST(LoopClosing, WaitsUntilThePastHasSpoken) {
    Configuration configuration = configuration_of_ring();
    configuration.loop.settle_s = 0.7;
    auto ring = std::make_unique<Ring>(configuration, true, false);  // its clock stands still
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        static_cast<void>(ring->add_keyframe(i));
        ring->work(5000);
    }
    EXPECT_EQ(ring->statistics().queries, 0U);
    EXPECT_EQ(ring->statistics().confirmed, 0U);
}

// Promise: reset() forgets everything, also in the middle of a loop: the same lap gives the same map again.
TEST(LoopClosing, ResetForgets) {
    auto used = std::make_unique<Ring>();
    std::uint32_t made = 0;
    while (used->loops().stage() < LoopClosing::Stage::kBuild && made < kLap + 12) {
        static_cast<void>(used->add_keyframe(made++));
        for (int i = 0; i < 20000 && used->loops().stage() < LoopClosing::Stage::kBuild; ++i) {
            if (used->work(100, 1) == 0) break;
        }
    }
    ASSERT_GE(used->loops().stage(), LoopClosing::Stage::kBuild);
    used->forget();
    EXPECT_EQ(used->statistics().queries, 0U);
    EXPECT_EQ(used->loops().stage(), LoopClosing::Stage::kIdle);
    auto fresh = std::make_unique<Ring>();
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        for (Ring* const ring : {used.get(), fresh.get()}) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(5000);
        }
        ASSERT_EQ(used->map().changes_hash(), fresh->map().changes_hash()) << i;
    }
    EXPECT_EQ(used->statistics().closed, 1U);
    EXPECT_EQ(used->statistics().queries, fresh->statistics().queries);
    EXPECT_EQ(used->statistics().candidates, fresh->statistics().candidates);
}

}  // namespace
}  // namespace stillmesh
