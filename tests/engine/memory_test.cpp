#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/engine/engine_rig.hpp"
#include "tests/support/heap_calls.hpp"

namespace stillmesh::memory_test {
namespace {

using test::EngineRig;
using test::fitting;
using test::KeptFrame;

CameraModel camera_of(std::uint32_t width, std::uint32_t height) {
    CameraModel camera;
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = 0.8 * width;
    camera.cx = 0.5 * width;
    camera.cy = 0.5 * height;
    return camera;
}

KeptFrame noise(std::uint32_t width, std::uint32_t height, std::int64_t time_ns, Random& random) {
    KeptFrame out;
    out.width = width;
    out.height = height;
    out.time_ns = time_ns;
    for (std::uint32_t i = 0; i < width * height; ++i) {
        out.colour.push_back(static_cast<std::uint8_t>(random.next()));
        out.depth.push_back(static_cast<std::uint16_t>(5000 + random.below(10000)));
    }
    return out;
}

// Promise: the presets keep their sizes.
TEST(Memory, PresetsKeepTheirSizes) {
    EXPECT_LE(bytes_needed(Limits::room()), std::size_t{48} << 20U);
    EXPECT_LE(bytes_needed(Limits::pocket()), std::size_t{8} << 20U);
    EXPECT_LE(bytes_needed(Limits::tiny()), std::size_t{512} << 10U);
    EXPECT_GE(Limits::room().keyframes_max, 256U);
    EXPECT_GE(Limits::room().map_points_max, 20000U);
    EXPECT_GE(Limits::room().features_max, 1000U);
    EXPECT_GE(Limits::pocket().keyframes_max, 32U);
    EXPECT_GE(Limits::pocket().map_points_max, 4000U);
    EXPECT_GE(Limits::pocket().features_max, 500U);
}

// Promise: for any limits, bytes_needed() is what is used, to the byte; one byte less is kFull; not a byte behind the
// block is touched, by create, by frames of noise that fill every pool, or by what is drawn of them.
TEST(Memory, BytesNeededIsWhatIsUsed) {
    Random random(1);
    std::vector<Limits> all = {Limits::tiny(), Limits::pocket(), Limits::room()};
    for (int i = 0; i < 300; ++i) {
        Limits limits;
        limits.image_width_max = 64 + random.below(i % 10 == 0 ? 1984 : 200);
        limits.image_height_max = 64 + random.below(i % 10 == 0 ? 1984 : 200);
        limits.pyramid_levels_max = 1 + random.below(12);
        limits.features_max = 50 + random.below(i % 7 == 0 ? 3000 : 200);
        limits.keyframes_max = 2 + random.below(40);
        limits.map_points_max = limits.features_max + random.below(2000);
        limits.groups_max = 1 + random.below(100);
        limits.store_features_max = i % 3 == 0 ? 1 + random.below(i % 2 == 0 ? 1 : 100) : 0;
        all.push_back(limits);
    }
    int tracked = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
        const Limits& limits = all[i];
        const std::size_t needed = bytes_needed(limits);
        constexpr std::size_t kGuard = 256;
        const test::Memory memory(needed + kGuard);
        std::memset(memory.span().data(), 0x5a, needed + kGuard);
        const CameraModel camera = camera_of(limits.image_width_max, limits.image_height_max);
        const Parameters configuration = fitting(limits);
        EXPECT_EQ(
            create_engine(memory.span().first(needed - 1), limits, configuration, camera, {cpu_kernels()}).status(),
            Status::kFull);
        const auto made = create_engine(memory.span().first(needed), limits, configuration, camera, {cpu_kernels()});
        ASSERT_TRUE(made.is_ok()) << i;
        EXPECT_EQ(made.value()->statistics().arena_used_bytes, needed);
        for (int k = 0; k < 4 && camera.width * camera.height < 40'000; ++k) {
            const KeptFrame frame = noise(camera.width, camera.height, k * test::kFrameGap_ns, random);
            ASSERT_EQ(made.value()->submit(frame.frame()), Status::kOk);
            static_cast<void>(made.value()->tracking_view());
            ++tracked;
        }
        for (std::size_t k = 0; k < kGuard; ++k) ASSERT_EQ(memory.span()[needed + k], std::byte{0x5a});
    }
    EXPECT_GT(tracked, 300);
}

// Promise: a block that lies as std::vector or malloc left it, not on the engine's alignment, is kInvalid and
// untouched.
TEST(Memory, ABlockMustBeAligned) {
    const Limits limits = Limits::tiny();
    const std::size_t needed = bytes_needed(limits);
    const test::Memory memory(needed + kArenaAlignment);
    std::memset(memory.span().data(), 0x5a, memory.span().size());
    for (const std::size_t offset : {std::size_t{1}, std::size_t{8}, std::size_t{16}, std::size_t{32}}) {
        const Status status =
            create_engine(memory.span().subspan(offset), limits, fitting(limits), camera_of(160, 120), {cpu_kernels()})
                .status();
        EXPECT_EQ(status, Status::kInvalid) << offset;
    }
    EXPECT_TRUE(
        std::all_of(memory.span().begin(), memory.span().end(), [](std::byte b) { return b == std::byte{0x5a}; }));
}

// Promise: limits, cameras and configurations out of range are kInvalid before anything is touched.
TEST(Memory, WhatCannotBeIsInvalid) {
    const Limits good = Limits::tiny();
    const CameraModel camera = camera_of(160, 120);
    const test::Memory memory(bytes_needed(Limits::pocket()));
    std::memset(memory.span().data(), 0x5a, memory.span().size());
    const auto refused = [&](const Limits& limits, const Parameters& parameters, const CameraModel& of) {
        const Status status = create_engine(memory.span(), limits, parameters, of, {cpu_kernels()}).status();
        const bool is_untouched =
            std::all_of(memory.span().begin(), memory.span().end(), [](std::byte b) { return b == std::byte{0x5a}; });
        return status == Status::kInvalid && is_untouched;
    };
    std::uint32_t Limits::*const fields[] = {
        &Limits::image_width_max, &Limits::image_height_max, &Limits::pyramid_levels_max, &Limits::features_max,
        &Limits::keyframes_max,   &Limits::map_points_max,   &Limits::groups_max};
    for (const auto field : fields) {
        for (const std::uint32_t value : {0U, 0xffffffffU}) {
            Limits limits = good;
            limits.*field = value;
            EXPECT_TRUE(refused(limits, fitting(good), camera))
                << "field " << (&(limits.*field) - &limits.image_width_max);
        }
    }
    EXPECT_TRUE(refused(good, Parameters{}, camera)) << "1000 features in 100";
    Parameters configuration = fitting(good);
    configuration.region.point_chi2_max = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(refused(good, configuration, camera));
    EXPECT_STREQ(validate(configuration, good).key, "region.point_chi2_max");
    EXPECT_TRUE(refused(good, fitting(good), camera_of(161, 120)));
    EXPECT_TRUE(refused(good, fitting(good), camera_of(160, 121)));
    EXPECT_TRUE(refused(good, fitting(good), camera_of(32, 32)));
    CameraModel bent = camera;
    bent.fx = std::numeric_limits<double>::infinity();
    EXPECT_TRUE(refused(good, fitting(good), bent));
    EXPECT_EQ(validate(fitting(good), good).key, nullptr);
}

// Promise: every key of the configuration is refused below its minimum and above its maximum, by its name.
TEST(Memory, EveryParameterHasItsRange) {
    std::uint32_t count = 0;
    Parameters names;
    visit_all_parameters(names, [&](const char*, auto&, double, double, const char*, const char*) { ++count; });
    EXPECT_GT(count, 130U);
    for (std::uint32_t which = 0; which < count; ++which) {
        for (const bool is_above : {false, true}) {
            Parameters configuration = fitting(Limits::room());
            std::uint32_t index = 0;
            const char* wanted = nullptr;
            visit_all_parameters(configuration,
                                 [&](const char* name, auto& value, double min, double max, const char*, const char*) {
                                     using Value = std::remove_reference_t<decltype(value)>;
                                     if (index++ != which) return;
                                     if constexpr (!std::is_same_v<Value, bool>) {
                                         if (!is_above && min <= 0 && !std::is_same_v<Value, double>)
                                             return;  // unsigned
                                         const double outside = is_above ? max + 1 + max / 1e6 : min - 1;
                                         if (outside < 0 && !std::is_same_v<Value, double>) return;
                                         value = static_cast<Value>(outside);
                                         wanted = name;
                                     } else {
                                         static_cast<void>(min);
                                         static_cast<void>(max);
                                         static_cast<void>(name);
                                     }
                                 });
            if (wanted != nullptr) {
                EXPECT_STREQ(validate(configuration, Limits::room()).key, wanted);
            }
        }
    }
}

// Promise: what contradicts itself is refused by the name of a key.
TEST(Memory, ContradictionsAreRefused) {
    const Limits limits = Limits::room();
    const auto key_of = [&](auto&& change) {
        Parameters configuration;
        change(configuration);
        const char* const key = validate(configuration, limits).key;
        return std::string(key != nullptr ? key : "none");
    };
    EXPECT_EQ(key_of([](Parameters&) {}), "none");
    EXPECT_EQ(key_of([](Parameters& c) { c.features.count = 1001; }), "features.count");
    EXPECT_EQ(key_of([](Parameters& c) { c.features.levels = 9; }), "features.levels");
    EXPECT_EQ(key_of([](Parameters& c) { c.features.fast_threshold_low = 21; }), "features.fast_threshold_low");
    EXPECT_EQ(key_of([](Parameters& c) { c.depth.z_min_m = 4, c.depth.z_max_m = 4; }), "depth.z_min_m");
    EXPECT_EQ(key_of([](Parameters& c) { c.matching.radius_wide_px = 11.9; }), "matching.radius_wide_px");
    EXPECT_EQ(key_of([](Parameters& c) { c.matching.radius_wide_px = c.matching.radius_px; }), "none");
    EXPECT_EQ(key_of([](Parameters& c) { c.pose.inlier_ratio_min = 0.51; }), "pose.inlier_ratio_min");
    Limits few = limits;
    few.keyframes_max = 9;
    EXPECT_STREQ(validate(Parameters{}, few).key, "mapping.window_keyframes");
    EXPECT_EQ(validate(Parameters{}, few).max, 9.0);
    EXPECT_EQ(key_of([](Parameters& c) { c.weights.suspicious = 21; }), "weights.max");
    EXPECT_EQ(key_of([](Parameters& c) { c.weights.eligible = 21; }), "weights.eligible");
    EXPECT_EQ(key_of([](Parameters& c) { c.weights.drift_m = 0.021; }), "weights.drift_m");
    EXPECT_EQ(key_of([](Parameters& c) { c.noise.max = 1.0, c.noise.pixel_start = 1.1; }), "noise.max");
    EXPECT_EQ(key_of([](Parameters& c) { c.noise.max = 1.0, c.noise.depth_start = 1.1; }), "noise.max");
}

// Promise: what is wrong with a block, a camera or limits is named, with its value and the range that it has to be in;
// what is just within is right.
TEST(Memory, WhatIsWrongIsNamed) {
    const Limits limits = Limits::tiny();
    const auto expect = [](const ConfigurationProblem& problem, const char* key, double value, double min, double max) {
        EXPECT_STREQ(problem.key, key);
        EXPECT_EQ(problem.value, value) << key;
        EXPECT_EQ(problem.min, min) << key;
        EXPECT_EQ(problem.max, max) << key;
    };
    const std::size_t needed = bytes_needed(limits);
    const test::Memory memory(needed + kArenaAlignment);
    const std::span<const std::byte> block = memory.span();
    const auto bytes = static_cast<double>(needed);
    EXPECT_EQ(validate(block.first(needed), limits).key, nullptr);
    EXPECT_EQ(validate(block, limits).key, nullptr);
    expect(validate(block.first(needed - 1), limits), "block.bytes", bytes - 1, bytes, bytes);
    for (const std::size_t past : {std::size_t{1}, std::size_t{32}, std::size_t{kArenaAlignment - 1}}) {
        expect(validate(block.subspan(past), limits), "block.address", static_cast<double>(past), 0, 0);
    }

    constexpr std::uint32_t kSideMin = 33;  // a patch of radius 15, and a pixel around it
    for (const std::uint32_t side : {kSideMin, 120U}) {
        EXPECT_EQ(validate(camera_of(side, 120), limits).key, nullptr) << side;
        EXPECT_EQ(validate(camera_of(160, side), limits).key, nullptr) << side;
    }
    expect(validate(camera_of(kSideMin - 1, 120), limits), "camera.width", kSideMin - 1, kSideMin, 160);
    expect(validate(camera_of(161, 120), limits), "camera.width", 161, kSideMin, 160);
    expect(validate(camera_of(160, kSideMin - 1), limits), "camera.height", kSideMin - 1, kSideMin, 120);
    expect(validate(camera_of(160, 121), limits), "camera.height", 121, kSideMin, 120);
    CameraModel camera = camera_of(160, 120);
    camera.fx = 0;
    expect(validate(camera, limits), "camera.fx", 0, 1, 1e6);
    camera = camera_of(160, 120);
    camera.fy = 0;
    expect(validate(camera, limits), "camera.fy", 0, 1, 1e6);
    camera = camera_of(160, 120);
    camera.lens = Lens::kFisheye;
    camera.k6 = 1;  // none of its kind
    expect(validate(camera, limits), "camera.lens", static_cast<double>(camera.lens), 0, 1);

    Limits few = limits;
    few.map_points_max = limits.features_max;
    EXPECT_EQ(validate(few).key, nullptr);
    --few.map_points_max;
    expect(validate(few), "limits.map_points_max", limits.features_max - 1, limits.features_max, 16777215);
}

// Promise: every parameter at either end of its range: the engine runs, mapping too, poses are finite, pools keep their
// limits.
TEST(Memory, EveryParameterAtItsEnds) {
    const test::Sequence sequence = test::rendered("sitting_xyz", 14, 160, 120);
    Parameters names;
    std::uint32_t count = 0;
    visit_all_parameters(names, [&](const char*, auto&, double, double, const char*, const char*) { ++count; });
    std::uint32_t runs = 0;
    for (std::uint32_t which = 0; which < 2 * count; ++which) {
        Parameters configuration = fitting(Limits::tiny());
        std::uint32_t index = 0;
        const char* name = nullptr;
        visit_all_parameters(
            configuration, [&](const char* key, auto& value, double min, double max, const char*, const char*) {
                if (index++ != which / 2) return;
                value = static_cast<std::remove_reference_t<decltype(value)>>(which % 2 == 0 ? min : max);
                name = key;
            });
        if (validate(configuration, Limits::tiny()).key != nullptr) continue;
        const EngineRig engine(Limits::tiny(), sequence.camera, configuration);
        ASSERT_EQ(engine.status(), Status::kOk) << name;
        for (const KeptFrame& kept : sequence.frames) {
            ASSERT_EQ(engine->submit(kept.frame()), Status::kOk) << name;
            static_cast<void>(engine->step(20'000));
        }
        for (const double t : engine->pose().odom_from_camera.translation_m) EXPECT_TRUE(std::isfinite(t)) << name;
        for (const double c : engine->pose().covariance) EXPECT_TRUE(std::isfinite(c)) << name;
        EXPECT_LE(engine->statistics().map_points.size, Limits::tiny().map_points_max) << name;
        ++runs;
    }
    EXPECT_GT(runs, 2 * count - 30) << "nearly every end is a configuration of its own, not a contradiction";
}

// Promise: after create the engine calls the heap never: not for frames, lost ones included, not for reset, statistics
// or what is drawn.
TEST(Memory, NeverCallsTheHeap) {
    if (!test::heap_calls_are_counted()) GTEST_SKIP() << "SKIPPED: sanitizers have a heap of their own";
    const test::Sequence sequence = test::rendered("walking_xyz", 40, 160, 120);
    const EngineRig engine(Limits::tiny(), sequence.camera);
    ASSERT_EQ(engine.status(), Status::kOk);
    KeptFrame black = sequence.frames[0];
    std::fill(black.colour.begin(), black.colour.end(), std::uint8_t{0});
    const std::uint64_t before = test::heap_calls();
    std::int64_t time_ns = 0;
    for (int round = 0; round < 3; ++round) {
        for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
            const bool is_lost = round == 1 && i < 36;
            Frame frame = is_lost ? black.frame() : sequence.frames[i].frame();
            frame.time_ns = time_ns += test::kFrameGap_ns;
            if (engine->submit(frame) != Status::kOk) break;
            static_cast<void>(engine->tracking_view());
            static_cast<void>(engine->statistics());
        }
        if (round == 1) engine->reset();
    }
    EXPECT_EQ(test::heap_calls() - before, 0U);
    EXPECT_EQ(time_ns, 120 * test::kFrameGap_ns);
    // The counter counts.
    std::vector<int>* const some = new std::vector<int>(100);
    delete some;
    EXPECT_GE(test::heap_calls() - before, 4U);
}

}  // namespace
}  // namespace stillmesh::memory_test
