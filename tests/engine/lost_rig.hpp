// An engine that has seen a part of a room, and then nothing for some frames.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/engine.hpp"
#include "engine/features/orb_extractor.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/engine/engine_rig.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::test {

inline constexpr std::uint32_t kWidth = 320, kHeight = 240;

inline Limits lost_limits() {
    Limits limits = Limits::pocket();
    limits.image_width_max = kWidth;
    limits.image_height_max = kHeight;
    limits.pyramid_levels_max = 6;
    return limits;
}

inline Parameters lost_parameters() {
    Parameters out = fitting(lost_limits());
    out.recovery.inlier_share_min = 2;  // nothing is recovered by chance
    return out;
}

// A tree over descriptors that were seen: medians are some of them. No trainer, but words that repeat.
inline void grow(Node& node, std::vector<Descriptor> seen, std::uint32_t level, Random& random) {
    constexpr std::uint32_t kBranching = 8, kLevels = 3;
    std::vector<std::vector<Descriptor>> shares(kBranching);
    for (std::uint32_t i = 0; i < kBranching; ++i) {
        Node child;
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

inline std::vector<std::byte> vocabulary_of(const Sequence& sequence) {
    const Limits limits = lost_limits();
    struct Finder {
        static void plan(ArenaPlan& plan, const Limits& l) {
            OrbExtractor::plan(plan, l);
            FeatureSet::plan(plan, l.features_max);
        }
    };
    ArenaPlan plan;
    Finder::plan(plan, limits);
    const Memory memory(plan.used_bytes());
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
    Node root;
    Random random(5);
    grow(root, seen, 1, random);
    TreeBytes tree(root, 8);
    VocabularyInfo info = info_of({8, 3, 0, 5}, tree);
    EXPECT_EQ(write_vocabulary_header(info, tree.bytes), Status::kOk);
    return tree.bytes;
}

inline const Sequence& home() {
    static const Sequence kept = rendered("static_halfsphere", 130, kWidth, kHeight, 3);
    return kept;
}

// An engine that has seen the first frames of home, and then nothing for some frames (two seconds).
class Lost {
public:
    explicit Lost(bool has_vocabulary, std::uint32_t frames = 90, const Parameters& configuration = lost_parameters(),
                  int dark_frames = 60)
        : memory_(bytes_needed(lost_limits())), bytes_(vocabulary_of(home())) {
        const auto made =
            create_engine(memory_.span(), lost_limits(), configuration, home().camera,
                          {cpu_kernels(), nullptr,
                           has_vocabulary ? std::span<const std::byte>(bytes_) : std::span<const std::byte>{}});
        EXPECT_TRUE(made.is_ok());
        engine_ = made.value();
        for (std::uint32_t i = 0; i < frames; ++i) show(home().frames[i]);
        EXPECT_EQ(engine_->pose().state, PoseState::kTracked);
        KeptFrame dark = home().frames[0];
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
    void show(const KeptFrame& kept) {
        Frame frame = kept.frame();
        time_ns_ += kFrameGap_ns;
        frame.time_ns = frame.depth_time_ns = time_ns_;
        ASSERT_EQ(engine_->submit(frame), Status::kOk);
        static_cast<void>(engine_->step(20000));
    }
    [[nodiscard]] Engine& engine() { return *engine_; }
    [[nodiscard]] const PoseEstimate& in_the_dark() const { return dark_; }

private:
    Memory memory_;
    std::vector<std::byte> bytes_;
    Engine* engine_ = nullptr;
    PoseEstimate before_, dark_;
    std::int64_t time_ns_ = 0;
};

inline double metres_between(const RigidTransform& a, const RigidTransform& b) {
    double sum = 0;
    for (int i = 0; i < 3; ++i)
        sum += (a.translation_m[i] - b.translation_m[i]) * (a.translation_m[i] - b.translation_m[i]);
    return std::sqrt(sum);
}

// map_from_camera.
inline RigidTransform in_the_map(const PoseEstimate& pose) {
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

}  // namespace stillmesh::test
