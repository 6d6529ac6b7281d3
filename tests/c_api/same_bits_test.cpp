// The C library beside the C++ one that it is made of.
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "stillmesh.h"

namespace stillmesh {
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

}  // namespace
}  // namespace stillmesh
