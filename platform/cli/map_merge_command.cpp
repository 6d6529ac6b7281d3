#include "platform/cli/map_merge_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "engine/engine.hpp"
#include "engine/map_merge.hpp"
#include "hal/calibration/calibration.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/destinations.hpp"
#include "platform/cli/engine_session.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/record/map_content.hpp"
#include "platform/record/map_saver.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kSliceUnits = 1'000'000;
constexpr std::uint32_t kDepthImagesMax = 1024;  // as limits.depth_images_max

// A map as it lies on the disk, and what is in it.
struct Input {
    MemoryBlock block;
    std::span<const std::byte> bytes;
    SavedMap content;

    [[nodiscard]] bool read(const std::string& file, std::string& message) {
        return read_whole_file(file, kMapFileBytesMax, block, bytes, message) &&
               parse_map_content(bytes, file, content, message) == Status::kOk;
    }
};

// An engine for the camera and the features that a map was made with.
class Joiner {
public:
    // False: `message`.
    [[nodiscard]] bool create(const MapMergeOptions& options, const SavedMap& first, const SavedMap& second,
                              std::string& message) {
        CameraInfo camera;
        camera.model = first.camera;
        camera.readout_s = first.readout_s;
        if (!options.calibration.empty()) {
            if (load_calibration(options.calibration, camera, message) != Status::kOk) return false;
        } else if (first.info.lens_crc != 0) {
            message = options.first + ": holds no more than a checksum of its camera's lens; give --calibration.";
            return false;
        }
        SessionOptions session;
        session.limits = options.limits;
        session.assignments = {fmt::format("features.levels={}", first.info.pyramid_levels),
                               fmt::format("features.scale_factor={}", first.info.scale_factor)};
        session.assignments.insert(session.assignments.end(), options.assignments.begin(), options.assignments.end());
        Configuration configuration;
        if (session_configuration(session, camera, limits_, configuration, message) != Status::kOk) return false;
        message.clear();
        room_ = limits_;  // while both are there
        room_.keyframes_max = std::max(limits_.keyframes_max, first.info.keyframes + second.info.keyframes);
        room_.map_points_max = std::max(limits_.map_points_max, first.info.points + second.info.points);
        if (limits_.depth_images_max > 0) {
            room_.depth_images_max = std::clamp(first.info.depth_images + second.info.depth_images,
                                                limits_.depth_images_max, kDepthImagesMax);
        }
        if (const ConfigurationProblem problem = validate(room_); problem.key != nullptr) {
            message = fmt::format("{}, {}: both together need {} = {:g}; at most {:g} is possible.", options.first,
                                  options.second, problem.key, problem.value, problem.max);
            return false;
        }
        if (!vocabulary_.open(options.vocabulary, limits_.vocabulary_words_max, message)) return false;
        if (!block_.allocate(bytes_needed(room_))) {
            message = fmt::format("the system has no {:.1f} MiB of memory left for both maps.",
                                  static_cast<double>(bytes_needed(room_)) / 1048576.0);
            return false;
        }
        const Result<Engine*> made = Engine::create(block_.bytes(), room_, configuration, camera.model, cpu_kernels(),
                                                    nullptr, vocabulary_.bytes());
        if (!made.is_ok()) {
            message = options.first + ": the engine refuses its camera; give --calibration.";
            return false;
        }
        engine_ = made.value();
        return true;
    }
    [[nodiscard]] Engine& engine() const { return *engine_; }
    [[nodiscard]] const Limits& limits() const { return limits_; }  // of what comes out
    [[nodiscard]] const Limits& room() const { return room_; }

private:
    Limits limits_, room_;
    VocabularyFile vocabulary_;
    MemoryBlock block_;
    Engine* engine_ = nullptr;
};

[[nodiscard]] double degrees_of(const RigidTransform& transform) {
    const auto& q = transform.rotation_xyzw;
    return 2 * std::atan2(std::hypot(q[0], q[1], q[2]), std::abs(q[3])) * 57.295779513082323;
}

// Both maps together, before they were fitted into limits.
struct Both {
    EngineStatistics whole;
    std::uint32_t depth_images = 0;
};

[[nodiscard]] int tell(const MapMergeOptions& options, const MapMerge& merge, const MapFileInfo& info,
                       const Both& both) {
    const EngineStatistics& whole = both.whole;
    const auto& t = merge.map_from_second.translation_m;
    const std::uint32_t keyframes_left_out = whole.keyframes.size - info.keyframes;
    const std::uint32_t points_left_out = whole.map_points.size - info.points;
    const std::uint32_t images_left_out = both.depth_images - info.depth_images;
    if (options.is_json) {
        const nlohmann::ordered_json json = {
            {"file", options.out},
            {"keyframes", info.keyframes},
            {"points", info.points},
            {"second_keyframes", merge.keyframes},
            {"second_found", merge.found},
            {"second_agreeing", merge.agreeing},
            {"elsewhere_share", merge.elsewhere_share},
            {"points_fused", whole.points_fused},
            {"keyframes_left_out", keyframes_left_out},
            {"points_left_out", points_left_out},
            {"depth_images", info.depth_images},
            {"depth_images_left_out", images_left_out},
            {"loops_closed", whole.loop.closed},
            {"p", {t[0], t[1], t[2]}},
            {"q",
             {merge.map_from_second.rotation_xyzw[0], merge.map_from_second.rotation_xyzw[1],
              merge.map_from_second.rotation_xyzw[2], merge.map_from_second.rotation_xyzw[3]}}};
        return answer(json.dump(2) + "\n");
    }
    return answer(fmt::format(
        "joined        {} and {}, now {}: {} keyframes, {} points, {} depth images{}\n"
        "seen twice    {} of {} keyframes of the second; {} points that both had are one\n"
        "lies          the second at {:.3f} {:.3f} {:.3f} m, turned by {:.1f} degrees, in the first\n",
        printable(options.first), printable(options.second), printable(options.out), info.keyframes, info.points,
        info.depth_images,
        keyframes_left_out + points_left_out + images_left_out == 0
            ? ""
            : fmt::format(" ({} keyframes, {} points and {} depth images left out: the limits '{}')",
                          keyframes_left_out, points_left_out, images_left_out, options.limits),
        merge.agreeing, merge.keyframes, whole.points_fused, t[0], t[1], t[2], degrees_of(merge.map_from_second)));
}

}  // namespace

CLI::App* add_map_merge_command(CLI::App& map_command, MapMergeOptions& options) {
    CLI::App* const app = map_command.add_subcommand("merge", "two maps of one place become one");
    app->add_option("first", options.first, "a map; its coordinates stay")->required()->type_name("FILE");
    app->add_option("second", options.second, "another one, of the same camera")->required()->type_name("FILE");
    app->add_option("--out", options.out, "the map that both become")->required()->type_name("FILE");
    app->add_option("--limits", options.limits, "that it keeps to: room (default) or pocket")
        ->check(CLI::IsMember({"room", "pocket"}).description(""))
        ->type_name("NAME");
    app->add_option("--set", options.assignments, "one parameter, as limits.keyframes_max=512; may be repeated")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app->add_option("--vocabulary", options.vocabulary, "places are recognised by: default, or a file")
        ->type_name("FILE");
    app->add_option("--calibration", options.calibration, "of the camera, where its lens is not in the maps")
        ->type_name("FILE|NAME");
    app->add_flag("--json", options.is_json, "as JSON");
    app->footer(
        "Where both show the same place is found by words and verified by geometry; if none is certain, nothing is "
        "written.\n"
        "Exit codes: 0 joined; 1 no place that is the same for certain, or could not be written; 2 no maps, maps that "
        "do not go together or into the limits, or bad usage.");
    return app;
}

int map_merge_command(const MapMergeOptions& options) {
    const Destination destinations[] = {{"--out", options.out, DestinationKind::kFile}};
    const Origin origins[] = {{"the first map", options.first}, {"the second map", options.second}};
    if (const std::string problem = check_destinations(destinations, origins); !problem.empty()) {
        return refuse(problem);
    }
    if (options.vocabulary == "none") return refuse("--vocabulary none: without one no place is recognised.");
    std::string message;
    Input first, second;
    Joiner joiner;
    if (!first.read(options.first, message) || !second.read(options.second, message) ||
        !joiner.create(options, first.content, second.content, message)) {
        return refuse(message);
    }
    Engine& engine = joiner.engine();
    const std::uint8_t extractor = first.content.info.extractor;
    MapFileProblem problem;
    if (engine.load_map(first.bytes, MapUse::kContinue, problem, extractor) != Status::kOk) {
        return refuse(map_sentence(options.first, problem));
    }
    MapMerge merge;
    const Status status = merge_map(engine, second.bytes, problem, merge, extractor);
    if (status == Status::kNotFound) {
        complain(merge_sentence(options.second, options.first, merge));
        return kExitFailed;
    }
    if (status == Status::kUnavailable) return refuse("--set: with these keys no place is recognised.");
    if (status != Status::kOk) return refuse(map_sentence(options.second, problem));
    while (engine.step(kSliceUnits) != Progress::kIdle) {
    }
    const EngineStatistics whole = engine.statistics();
    fit_map(engine, joiner.limits());
    MapSaver saver;
    if (!saver.open(options.out, joiner.room(), extractor, 0, message)) return refuse(message);
    message = saver.finish(engine);
    if (!message.empty()) {
        complain(message);
        return kExitFailed;
    }
    const std::uint32_t depth_images = first.content.info.depth_images + second.content.info.depth_images;
    return tell(options, merge, saver.info(), {whole, depth_images});
}

}  // namespace stillmesh
