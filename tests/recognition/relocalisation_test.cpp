#include "engine/recognition/relocalisation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "engine/engine.hpp"
#include "engine/features/orb_extractor.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/engine/engine_rig.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kWidth = 320, kHeight = 240;

Limits limits_of_test() {
    Limits limits = Limits::pocket();
    limits.image_width_max = kWidth;
    limits.image_height_max = kHeight;
    limits.pyramid_levels_max = 6;
    return limits;
}

Configuration configuration_of_test() {
    Configuration out = test::fitting(limits_of_test());
    out.recovery.matches_min = 4000;  // nobody recovers by chance
    return out;
}

// A tree over descriptors that were seen: medians are some of them. No trainer, but words that repeat.
void grow(test::Node& node, std::vector<Descriptor> seen, std::uint32_t level, Random& random) {
    constexpr std::uint32_t kBranching = 8, kLevels = 3;
    std::vector<std::vector<Descriptor>> shares(kBranching);
    for (std::uint32_t i = 0; i < kBranching; ++i) {
        test::Node child;
        child.median = seen[random.below(static_cast<std::uint32_t>(seen.size()))];
        child.weight = 1000;
        node.children.push_back(child);
    }
    const auto distance = [](const Descriptor& a, const Descriptor& b) {
        int bits = 0;
        for (int w = 0; w < 4; ++w) bits += std::popcount(a.words[w] ^ b.words[w]);
        return bits;
    };
    for (const Descriptor& d : seen) {
        std::uint32_t best = 0;
        for (std::uint32_t i = 1; i < kBranching; ++i) {
            if (distance(d, node.children[i].median) < distance(d, node.children[best].median)) best = i;
        }
        shares[best].push_back(d);
    }
    for (std::uint32_t i = 0; i < kBranching; ++i) {
        if (level < kLevels && shares[i].size() > 2 * kBranching) grow(node.children[i], shares[i], level + 1, random);
    }
}

std::vector<std::byte> vocabulary_of(const test::Sequence& sequence) {
    const Limits limits = limits_of_test();
    struct Finder {
        static void plan(ArenaPlan& plan, const Limits& l) {
            OrbExtractor::plan(plan, l);
            FeatureSet::plan(plan, l.features_max);
        }
    };
    ArenaPlan plan;
    Finder::plan(plan, limits);
    const test::Memory memory(plan.used_bytes());
    Arena arena(memory.span());
    OrbOptions options;
    options.features_max = limits.features_max;
    options.levels = limits.pyramid_levels_max;
    OrbExtractor orb;
    orb.create(arena, limits, options, cpu_kernels());
    FeatureSet features;
    features.create(arena, limits.features_max);
    std::vector<Descriptor> seen;
    for (std::size_t i = 0; i < sequence.frames.size(); i += 20) {
        const Frame frame = sequence.frames[i].frame();
        EXPECT_EQ(orb.extract(frame.colour, features), Status::kOk);
        seen.insert(seen.end(), features.descriptors.begin(), features.descriptors.end());
    }
    test::Node root;
    Random random(5);
    grow(root, seen, 1, random);
    test::TreeBytes tree(root, 8);
    VocabularyInfo info = test::info_of({8, 3, 0, 5}, tree);
    EXPECT_EQ(write_vocabulary_header(info, tree.bytes), Status::kOk);
    return tree.bytes;
}

const test::Sequence& home() {
    static const test::Sequence kept = test::rendered("static_halfsphere", 130, kWidth, kHeight, 3);
    return kept;
}

// An engine that has seen the first frames of home, and then nothing for some frames (two seconds).
class Lost {
public:
    explicit Lost(bool has_vocabulary, std::uint32_t frames = 90,
                  const Configuration& configuration = configuration_of_test(), int dark_frames = 60)
        : memory_(bytes_needed(limits_of_test())), bytes_(vocabulary_of(home())) {
        const auto made =
            Engine::create(memory_.span(), limits_of_test(), configuration, home().camera, cpu_kernels(), nullptr,
                           has_vocabulary ? std::span<const std::byte>(bytes_) : std::span<const std::byte>{});
        EXPECT_TRUE(made.is_ok());
        engine_ = made.value();
        for (std::uint32_t i = 0; i < frames; ++i) show(home().frames[i]);
        EXPECT_EQ(engine_->pose().state, PoseState::kTracked);
        test::KeptFrame dark = home().frames[0];
        std::fill(dark.colour.begin(), dark.colour.end(), std::uint8_t{0});
        std::fill(dark.depth.begin(), dark.depth.end(), std::uint16_t{0});
        before_ = engine_->pose();
        for (int i = 0; i < dark_frames; ++i) {
            show(dark);
            EXPECT_LT(engine_->pose().state, PoseState::kUnsure);
        }
        EXPECT_EQ(engine_->pose().state, dark_frames > 30 ? PoseState::kNone : PoseState::kPredicted);
        dark_ = engine_->pose();
    }
    void show(const test::KeptFrame& kept) {
        Frame frame = kept.frame();
        time_ns_ += test::kFrameGap_ns;
        frame.time_ns = frame.depth_time_ns = time_ns_;
        ASSERT_EQ(engine_->submit(frame), Status::kOk);
        static_cast<void>(engine_->step(20000));
    }
    [[nodiscard]] Engine& engine() { return *engine_; }
    [[nodiscard]] const PoseEstimate& in_the_dark() const { return dark_; }

private:
    test::Memory memory_;
    std::vector<std::byte> bytes_;
    Engine* engine_ = nullptr;
    PoseEstimate before_, dark_;
    std::int64_t time_ns_ = 0;
};

double metres_between(const RigidTransform& a, const RigidTransform& b) {
    double sum = 0;
    for (int i = 0; i < 3; ++i)
        sum += (a.translation_m[i] - b.translation_m[i]) * (a.translation_m[i] - b.translation_m[i]);
    return std::sqrt(sum);
}

// map_from_camera.
RigidTransform in_the_map(const PoseEstimate& pose) {
    const double* q = pose.map_from_odom.rotation_xyzw;
    const double* p = pose.odom_from_camera.translation_m;
    const double c[3] = {q[1] * p[2] - q[2] * p[1], q[2] * p[0] - q[0] * p[2], q[0] * p[1] - q[1] * p[0]};
    const double d[3] = {q[1] * c[2] - q[2] * c[1], q[2] * c[0] - q[0] * c[2], q[0] * c[1] - q[1] * c[0]};
    RigidTransform out;
    for (int i = 0; i < 3; ++i) {
        out.translation_m[i] = p[i] + 2 * (q[3] * c[i] + d[i]) + pose.map_from_odom.translation_m[i];
    }
    return out;
}

// Promise: after two seconds of darkness, in another part of the room, a camera with a vocabulary is back on the map
// within some frames, where it truly is; map_from_odom takes the jump. Without one it stays lost.
TEST(Relocalisation, BackOnTheMapAfterDarkness) {
    for (const std::uint32_t back_at : {20U, 45U}) {
        Lost lost(true);
        std::uint32_t tries = 0;
        std::uint32_t i = back_at;
        for (; i < back_at + 30; ++i) {
            ++tries;
            lost.show(home().frames[i]);
            if (lost.engine().pose().state >= PoseState::kUnsure) break;
        }
        ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
        EXPECT_LE(tries, 18U);
        EXPECT_GT(tries, Configuration{}.recovery.probation_frames);
        const double off =
            test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i].truth);
        EXPECT_LT(off, 0.05);
        EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 1U);
        // Odometry goes on from where it was, by what the camera moved in the frames of the probation.
        double moved = 0;
        for (int k = 0; k < 3; ++k) {
            const double d = home().frames[i].truth.t[static_cast<std::size_t>(k)] -
                             home().frames[back_at].truth.t[static_cast<std::size_t>(k)];
            moved += d * d;
        }
        EXPECT_NEAR(metres_between(lost.engine().pose().odom_from_camera, lost.in_the_dark().odom_from_camera),
                    std::sqrt(moved), 0.03);
        std::printf("frame %u: back after %u frames, %.3f m off; in the dark it was thought %.3f m away\n", i, tries,
                    off, metres_between(in_the_map(lost.engine().pose()), in_the_map(lost.in_the_dark())));
        for (std::uint32_t k = 1; k < 10; ++k) {
            lost.show(home().frames[i + k]);
            EXPECT_LT(
                test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i + k].truth),
                0.05);
        }
    }
    Lost lost(false);
    for (std::uint32_t i = 20; i < 50; ++i) lost.show(home().frames[i]);
    EXPECT_EQ(lost.engine().pose().state, PoseState::kNone);
}

// Promise: the map learns nothing from a frame that has not proven where the camera is: where each frame would be a
// keyframe, the one that ends the probation is none yet, and those after it are. A keyframe of its own is what a frame
// looks most alike: it was weighed for the place, and wrong ones of corridors were believed.
TEST(Relocalisation, NoFrameBearsWitnessForItself) {
    Configuration configuration = configuration_of_test();
    configuration.keyframes.tracked_urgent_permille = 1000;
    configuration.keyframes.gap_urgent = 1;
    configuration.keyframes.new_points_min = 1;
    Lost lost(true, 90, configuration);
    const std::uint64_t keyframes = lost.engine().statistics().keyframes_made;
    std::uint32_t i = 20;
    for (; i < 50; ++i) {
        lost.show(home().frames[i]);
        EXPECT_EQ(lost.engine().statistics().keyframes_made, keyframes);
        if (lost.engine().pose().state >= PoseState::kUnsure) break;
    }
    ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
    lost.show(home().frames[i + 1]);
    EXPECT_EQ(lost.engine().statistics().keyframes_made, keyframes + 1);
}

// Promise: a camera that was lost for a second is matched with the keyframes around it through the direct index of a
// vocabulary, and is back where it truly is, as it is without one.
TEST(Relocalisation, FoundAgainNearby) {
    for (const bool has_vocabulary : {true, false}) {
        Configuration configuration = configuration_of_test();
        configuration.recovery.matches_min = Configuration{}.recovery.matches_min;
        configuration.loop.inliers_min = 4000;  // no place is found anywhere
        Lost lost(has_vocabulary, 90, configuration, 40);
        std::uint32_t i = 90;
        for (; i < 130; ++i) {
            lost.show(home().frames[i]);
            if (lost.engine().pose().state >= PoseState::kUnsure) break;
        }
        ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
        EXPECT_EQ(lost.engine().statistics().recoveries, 1U);
        EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 0U);
        EXPECT_EQ(lost.engine().statistics().loop.matched_by_words > 0, has_vocabulary);
        EXPECT_LT(test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i].truth),
                  0.05);
    }
}

// Promise: a room that is not in the map is not recognised.
TEST(Relocalisation, AnotherRoomIsNotHome) {
    const test::Sequence other = test::rendered("static_halfsphere", 30, kWidth, kHeight, 77);
    Lost lost(true);
    for (const test::KeptFrame& frame : other.frames) {
        lost.show(frame);
        EXPECT_EQ(lost.engine().pose().state, PoseState::kNone);
    }
    EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 0U);
    EXPECT_EQ(lost.engine().statistics().loop.relocalisation_queries, other.frames.size());
}

// Promise: a camera that was found is not believed at once. If the picture then goes dark, no pose was given out, no
// keyframe made and no relocalisation counted, and it is lost where it was lost before; nor does another room finish
// what was begun. Brought home, it is found there.
TEST(Relocalisation, WhatFailsTheProbationIsUndone) {
    const test::Sequence other = test::rendered("static_halfsphere", 20, kWidth, kHeight, 77);
    Lost lost(true);
    const std::uint64_t keyframes = lost.engine().statistics().keyframes_made;
    const std::uint32_t probation = Configuration{}.recovery.probation_frames;
    const auto show_nothing_known = [&](const test::KeptFrame& frame) {
        lost.show(frame);
        EXPECT_EQ(lost.engine().pose().state, PoseState::kNone);
        EXPECT_EQ(lost.engine().statistics().keyframes_made, keyframes);
        EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 0U);
    };
    std::uint32_t matched = 0;
    for (std::uint32_t i = 20; i < 20 + probation; ++i) {
        show_nothing_known(home().frames[i]);
        matched += lost.engine().frame_statistics().static_matches > 0 ? 1U : 0U;
    }
    EXPECT_GT(matched, probation / 2) << "it was on probation";
    test::KeptFrame dark = home().frames[0];
    std::fill(dark.colour.begin(), dark.colour.end(), std::uint8_t{0});
    show_nothing_known(dark);
    EXPECT_EQ(in_the_map(lost.engine().pose()).translation_m[0], in_the_map(lost.in_the_dark()).translation_m[0]);
    for (const test::KeptFrame& frame : other.frames) show_nothing_known(frame);
    std::uint32_t i = 45;
    for (; i < 45 + 30 && lost.engine().pose().state < PoseState::kUnsure; ++i) lost.show(home().frames[i]);
    ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
    EXPECT_LT(test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i - 1].truth),
              0.05);
}

}  // namespace
}  // namespace stillmesh
