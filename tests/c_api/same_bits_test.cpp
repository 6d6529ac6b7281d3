// The C library beside the C++ one that it is made of.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "engine/engine.hpp"
#include "engine/map_merge.hpp"
#include "engine/record/map_file.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "stillmesh.h"

namespace stillmesh::same_bits_test {
namespace {

[[nodiscard]] std::map<std::string, double> keys_of(Limits limits, Configuration configuration) {
    std::map<std::string, double> keys;
    const auto add = [&keys](const char* name, const auto& value, double, double, const char*, const char*) {
        keys[name] = static_cast<double>(value);
    };
    visit_limits(limits, add);
    visit_parameters(configuration, add);
    return keys;
}

// Promise: the settings of C are the presets of C++, key by key.
TEST(SameBits, Settings) {
    const std::map<std::string, Limits> limits = {
        {"room", Limits::room()}, {"pocket", Limits::pocket()}, {"tiny", Limits::tiny()}};
    const std::map<std::string, Configuration> scenes = {{"indoor", Configuration::indoor()},
                                                         {"outdoor", Configuration::outdoor()}};
    for (const auto& [limits_name, preset] : limits) {
        for (const auto& [scene_name, scene] : scenes) {
            sm_settings settings{sizeof(sm_settings), 0, {}};
            ASSERT_EQ(sm_settings_init(&settings, limits_name.c_str(), scene_name.c_str(), nullptr), SM_OK);
            std::map<std::string, double> keys;
            sm_key key{};
            key.size = sizeof(key);
            for (std::uint32_t i = 0; sm_settings_key(&settings, i, &key) == SM_OK; ++i) keys[key.name] = key.value;
            EXPECT_EQ(keys, keys_of(preset, scene.fitted_to(preset))) << limits_name << ' ' << scene_name;
        }
    }
}

// Promise: the same start, frames, masks, hints and steps give the same bits through either door, frame by frame.
TEST(SameBits, Frames) {
    SimulationOptions options;
    options.scene = "walking_xyz";
    SimulatedCamera source(options);
    ASSERT_EQ(source.open(), Status::kOk);
    const CameraModel& model = source.info().model;

    const Limits limits = Limits::pocket();
    MemoryBlock block, c_block;
    ASSERT_TRUE(block.allocate(bytes_needed(limits)));
    const auto made = Engine::create(block.bytes(), limits, Configuration::for_limits(limits), model, cpu_kernels());
    ASSERT_TRUE(made.is_ok());
    Engine& engine = *made.value();

    sm_problem problem{sizeof(sm_problem), 0, {}};
    sm_settings settings{sizeof(sm_settings), 0, {}};
    ASSERT_EQ(sm_settings_init(&settings, "pocket", "indoor", &problem), SM_OK);
    const sm_camera camera{sizeof(sm_camera), model.width, model.height, static_cast<std::int32_t>(model.lens),
                           model.fx,          model.fy,    model.cx,     model.cy,
                           model.k1,          model.k2,    model.p1,     model.p2,
                           model.k3,          model.k4,    model.k5,     model.k6};
    const sm_options nothing{sizeof(sm_options), 0, nullptr, 0, nullptr, nullptr};
    ASSERT_TRUE(c_block.allocate(sm_engine_bytes(&settings)));
    sm_engine* c_engine = nullptr;
    ASSERT_EQ(sm_engine_create(c_block.bytes().data(), c_block.bytes().size(), &settings, &camera, &nothing, &c_engine,
                               &problem),
              SM_OK)
        << problem.sentence;

    const RigidTransform start{{0, 0, 0, 1}, {1, 2, 3}};
    const sm_transform c_start{{0, 0, 0, 1}, {1, 2, 3}}, no_start{{0, 0, 0, 2}, {1, 2, 3}};
    ASSERT_EQ(engine.start_at(start), Status::kOk);
    EXPECT_EQ(sm_start_at(c_engine, &no_start, &problem), SM_INVALID);
    ASSERT_EQ(sm_start_at(c_engine, &c_start, &problem), SM_OK) << problem.sentence;

    std::uint32_t frames = 0;
    for (Frame frame; frames < 12 && source.poll(frame) == Status::kOk; ++frames) {
        MotionHint hint;
        hint.last_from_camera.translation_m[0] = 0.001;
        hint.sigma_m = 0.05;
        const bool has_hint = frames % 3 == 2;
        frame.mask = frames % 4 != 0 ? source.dynamic_mask() : ImageView<std::uint8_t>{};
        ASSERT_EQ(engine.submit(frame, has_hint ? &hint : nullptr), Status::kOk);
        const sm_motion_hint c_hint{sizeof(sm_motion_hint), 0, {{0, 0, 0, 1}, {0.001, 0, 0}}, 0.05, -1};
        const sm_frame c_frame{sizeof(sm_frame),        static_cast<std::int32_t>(frame.format),
                               frame.time_ns,           frame.depth_time_ns,
                               frame.colour.width,      frame.colour.height,
                               frame.colour.data,       frame.colour.stride,
                               frame.depth.data,        2 * frame.depth.stride,
                               frame.depth_units_per_m, frame.mask.data,
                               frame.mask.stride};
        ASSERT_EQ(sm_submit(c_engine, &c_frame, has_hint ? &c_hint : nullptr, &problem), SM_OK) << problem.sentence;
        EXPECT_EQ(sm_state_hash(c_engine), engine.state_hash()) << frames;
        EXPECT_EQ(sm_step(c_engine, 20000), static_cast<std::int32_t>(engine.step(20000)));
        EXPECT_EQ(sm_state_hash(c_engine), engine.state_hash()) << frames;
        sm_pose pose{};
        pose.size = sizeof(pose);
        ASSERT_EQ(sm_get_pose(c_engine, &pose), SM_OK);
        EXPECT_EQ(std::vector(pose.covariance, pose.covariance + 36),
                  std::vector(engine.pose().covariance, engine.pose().covariance + 36));
        EXPECT_EQ(pose.state, static_cast<std::int32_t>(engine.pose().state));
    }
    EXPECT_EQ(frames, 12U);
}

constexpr std::uint32_t kDayFrames = 45;

SimulatedCamera day(const char* scene, std::uint64_t seed, std::uint64_t number) {
    SimulationOptions options;
    options.scene = scene;
    options.seed = seed;
    options.day = number;
    options.width = 320;
    options.height = 240;
    options.frames = kDayFrames;
    return SimulatedCamera(options);
}

Limits merge_limits() {
    Limits limits = Limits::pocket();
    limits.keyframes_max = 80;
    limits.map_points_max = 11000;
    limits.depth_images_max = 16;
    return limits;
}

// The map of a day, through C++.
std::vector<std::byte> map_of(SimulatedCamera&& source, const std::vector<std::byte>* joined_to = nullptr,
                              MapMerge* merge = nullptr) {
    const Limits limits = merge_limits();
    MemoryBlock block, workspace;
    EXPECT_EQ(source.open(), Status::kOk);
    EXPECT_TRUE(block.allocate(bytes_needed(limits)) && workspace.allocate(map_copy_bytes(limits)));
    std::size_t vocabulary_bytes = 0;
    const void* const vocabulary = sm_default_vocabulary(&vocabulary_bytes);
    const auto made =
        Engine::create(block.bytes(), limits, Configuration::for_limits(limits), source.info().model, cpu_kernels(),
                       nullptr, {static_cast<const std::byte*>(vocabulary), vocabulary_bytes});
    Engine& engine = *made.value();
    for (Frame frame; source.poll(frame) == Status::kOk;) {
        EXPECT_EQ(engine.submit(frame), Status::kOk);
        static_cast<void>(engine.step(20000));
    }
    const auto saved = [&] {
        EXPECT_EQ(engine.begin_map_copy(workspace.bytes()), Status::kOk);
        while (engine.step_map_copy(100'000) == Progress::kWorking) {
        }
        MapFileWriter writer(workspace.bytes());
        std::vector<std::byte> out, piece(4096);
        while (const std::size_t size = writer.next(piece))
            out.insert(out.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(size));
        return out;
    };
    const std::vector<std::byte> own = saved();
    if (joined_to == nullptr) return own;
    MapFileProblem problem;
    EXPECT_EQ(engine.load_map(*joined_to, MapUse::kContinue, problem), Status::kOk) << problem.part;
    EXPECT_EQ(merge_map(engine, own, problem, *merge), Status::kOk) << merge->agreeing;
    while (engine.step(100'000) != Progress::kIdle) {
    }
    return saved();
}

// Promise: two maps joined through C are to the byte what C++ makes of them, from bytes and from a file; maps of two
// rooms are not joined, with a sentence; and a joined map is fitted into the limits of settings.
TEST(SameBits, JoinedMaps) {
    const std::vector<std::byte> first = map_of(day("static_xyz", 1, 0)), other = map_of(day("static_xyz", 4, 0));
    MapMerge merge;
    const std::vector<std::byte> second = map_of(day("sitting_xyz", 1, 7));
    const std::vector<std::byte> both = map_of(day("sitting_xyz", 1, 7), &first, &merge);
    EXPECT_GT(merge.points_fused, 10U);

    sm_problem problem{sizeof(sm_problem), 0, {}};
    sm_settings settings{sizeof(sm_settings), 0, {}};
    ASSERT_EQ(sm_settings_init(&settings, "pocket", "indoor", &problem), SM_OK);
    for (const auto& [key, value] : {std::pair("limits.keyframes_max", 80), std::pair("limits.map_points_max", 11000),
                                     std::pair("limits.depth_images_max", 16)})
        ASSERT_EQ(sm_settings_set(&settings, key, value, &problem), SM_OK) << problem.sentence;
    SimulatedCamera source = day("static_xyz", 1, 0);
    ASSERT_EQ(source.open(), Status::kOk);
    const CameraModel& model = source.info().model;
    const sm_camera camera{sizeof(sm_camera), model.width, model.height, static_cast<std::int32_t>(model.lens),
                           model.fx,          model.fy,    model.cx,     model.cy,
                           model.k1,          model.k2,    model.p1,     model.p2,
                           model.k3,          model.k4,    model.k5,     model.k6};
    MemoryBlock block, workspace;
    ASSERT_TRUE(block.allocate(sm_engine_bytes(&settings)) && workspace.allocate(sm_map_copy_bytes(&settings)));
    sm_engine* engine = nullptr;
    ASSERT_EQ(
        sm_engine_create(block.bytes().data(), block.bytes().size(), &settings, &camera, nullptr, &engine, &problem),
        SM_OK)
        << problem.sentence;
    const std::string file = testing::TempDir() + "same_bits_second.map";
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(second.data()), static_cast<std::streamsize>(second.size()));
    for (const bool is_file : {false, true}) {
        sm_map_merge out{};
        out.size = sizeof(out);
        ASSERT_EQ(sm_load_map(engine, first.data(), first.size(), SM_MAP_CONTINUE, &problem), SM_OK);
        ASSERT_EQ(is_file ? sm_merge_map_file(engine, file.c_str(), &out, &problem)
                          : sm_merge_map(engine, second.data(), second.size(), &out, &problem),
                  SM_OK)
            << problem.sentence;
        EXPECT_EQ(out.keyframes, merge.keyframes);
        EXPECT_EQ(out.found, merge.found);
        EXPECT_EQ(out.agreeing, merge.agreeing);
        EXPECT_EQ(out.points_fused, merge.points_fused);
        EXPECT_EQ(out.elsewhere_share, merge.elsewhere_share);
        EXPECT_EQ(out.map_from_second.translation_m[2], merge.map_from_second.translation_m[2]);
        while (sm_step(engine, 100'000) != SM_IDLE) {
        }
        ASSERT_EQ(sm_begin_map_copy(engine, workspace.bytes().data(), workspace.bytes().size(), &problem), SM_OK);
        while (sm_step_map_copy(engine, 100'000) == SM_WORKING) {
        }
        sm_map_writer writer{sizeof(sm_map_writer), 0, {}};
        ASSERT_EQ(sm_map_writer_init(&writer, workspace.bytes().data(), workspace.bytes().size()), SM_OK);
        std::vector<std::byte> made(both.size() + kMapPieceBytesMin);
        std::size_t size = 0;
        while (const std::size_t more = sm_map_writer_next(&writer, made.data() + size, made.size() - size))
            size += more;
        made.resize(size);
        EXPECT_TRUE(made == both) << size << " of " << both.size();
    }
    std::remove(file.c_str());
    sm_statistics all{};
    all.size = sizeof(all);
    ASSERT_EQ(sm_settings_set(&settings, "limits.keyframes_max", 5, &problem), SM_OK);
    ASSERT_EQ(sm_fit_map(engine, &settings, &problem), SM_OK);
    ASSERT_EQ(sm_get_statistics(engine, &all), SM_OK);
    EXPECT_EQ(all.keyframes_size, 5U);

    sm_map_merge none{};
    none.size = sizeof(none);
    ASSERT_EQ(sm_load_map(engine, first.data(), first.size(), SM_MAP_CONTINUE, &problem), SM_OK);
    EXPECT_EQ(sm_merge_map(engine, other.data(), other.size(), &none, &problem), SM_NOT_FOUND);
    EXPECT_NE(std::string(problem.sentence).find("the second map: cannot be joined to the map: "), std::string::npos)
        << problem.sentence;
    EXPECT_GT(none.keyframes, 0U);
    EXPECT_LT(none.agreeing, 4U);
    EXPECT_EQ(sm_merge_map(engine, first.data(), first.size(), nullptr, &problem), SM_UNAVAILABLE)
        << "it has forgotten";
}

}  // namespace
}  // namespace stillmesh::same_bits_test
