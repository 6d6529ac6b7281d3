// Matching a frame against a keyframe when its pose is poorly known: through the direct index, beside comparing all
// pairs of descriptors and searching around projections. Matches, how many of them are true (the point lies where the
// true poses and its depth put it), and time; means over pairs of views of one place.
//   place_matching [--vocabulary FILE] [--views N] [--pairs N] [--cache FILE]
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "bench/place/views.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/matching/map_matcher.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"
#include "tests/support/memory.hpp"

namespace {

using namespace stillmesh;
using bench::PlaceView;

double now_ms() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

constexpr double kScales[] = {1.0, 1.2, 1.44, 1.728, 2.0736, 2.48832, 2.985984, 3.5831808};

// Matcher, map and features in one block, made anew for every camera.
struct Rig {
    static constexpr void plan(ArenaPlan& arena, const Limits& limits, const CameraModel&) noexcept {
        MapMatcher::plan(arena, limits);
        Map::plan(arena, limits);
        FeatureSet::plan(arena, limits.features_max);
    }
    void create(Arena& arena, const Limits& limits, const CameraModel& camera) noexcept {
        matcher.create(arena, limits, MatchingParameters{}, camera, kScales);
        map.create(arena, limits);
        features.create(arena, limits.features_max);
    }
    MapMatcher matcher;
    Map map;
    FeatureSet features;
};

struct Row {
    std::string name;
    std::function<void(Rig&, const PlaceView&, const PlaceView&, Handle<Keyframe>)> match;
    double matches = 0, right = 0, time_ms = 0;
};

SE3 pushed(const SE3& pose, double metres, double degrees) {
    Vector6 xi;
    const double radians = degrees * 0.017453292519943295;
    xi << metres * 0.8, 0, metres * 0.6, radians * 0.36, radians * 0.8, radians * 0.48;
    return pose * se3_exp(xi);
}

}  // namespace

int main(int argc, char** argv) {
    std::string file;
    std::string cache;
    std::uint32_t count = 40;
    std::size_t pairs_max = 150;
    for (int i = 1; i + 1 < argc; i += 2) {
        const std::string option = argv[i];
        if (option == "--vocabulary") file = argv[i + 1];
        if (option == "--cache") cache = argv[i + 1];
        if (option == "--views") count = static_cast<std::uint32_t>(std::atoi(argv[i + 1]));
        if (option == "--pairs") pairs_max = static_cast<std::size_t>(std::atoi(argv[i + 1]));
    }
    VocabularyFile opened;
    std::string message;
    if (!opened.open(file, kVocabularyWordsMax, message)) {
        std::printf("%s\n", message.c_str());
        return 2;
    }
    const Vocabulary& vocabulary = opened.vocabulary();
    std::vector<PlaceView> views;
    if (cache.empty() || !bench::load_views(cache, views)) {
        bench::add_rendered("static_loop", 1, 0, count, views);
        bench::add_rendered("walking_loop", 4, 0, count, views);
        const char* const data = std::getenv("STILLMESH_TEST_DATA");
        if (data != nullptr && !bench::add_recorded(std::string(data) + "/fr1_rpy_a", 9, views)) return 2;
        if (!cache.empty()) bench::save_views(cache, views);
    }
    std::vector<bench::ViewPair> pairs = bench::choose_pairs(views, pairs_max, 0);

    const MatchingParameters parameters;
    test::InMemory<FrameWords> words_a{1000U};
    test::InMemory<FrameWords> words_b{1000U};
    std::vector<Row> rows;
    rows.push_back(
        {"all pairs of descriptors", [](Rig& rig, const PlaceView&, const PlaceView&, Handle<Keyframe> keyframe) {
             rig.matcher.by_descriptor(rig.map, keyframe);
         }});
    for (std::uint32_t level = 1; level <= vocabulary.info().levels; ++level) {
        rows.push_back({"words, nodes of level " + std::to_string(level),
                        [&, level](Rig& rig, const PlaceView&, const PlaceView& b, Handle<Keyframe> keyframe) {
                            words_b->find(vocabulary, b.descriptors);  // the keyframe's are kept, the frame's are new
                            rig.matcher.by_words(rig.map, keyframe, vocabulary, level, words_b->by_word(),
                                                 words_a->by_word());
                        }});
    }
    const double off[][2] = {{0.02, 1}, {0.1, 5}, {0.3, 15}};
    for (const auto& [metres, degrees] : off) {
        for (const double radius : {parameters.radius_px, parameters.radius_wide_px}) {
            char name[80];
            std::snprintf(name, sizeof(name), "projection, %2.0f px, pose off %2.0f cm %2.0f deg", radius, 100 * metres,
                          degrees);
            rows.push_back({name, [metres = metres, degrees = degrees, radius](Rig& rig, const PlaceView&,
                                                                               const PlaceView& b, Handle<Keyframe>) {
                                rig.matcher.by_projection(rig.map, nullptr,
                                                          pushed(b.world_from_camera, metres, degrees), radius);
                            }});
        }
    }
    Limits limits = Limits::room();
    limits.keyframes_max = 2;
    limits.map_points_max = 1000;
    for (const bench::ViewPair& pair : pairs) {
        const PlaceView& a = views[pair.a];
        const PlaceView& b = views[pair.b];
        test::InMemory<Rig> memory{limits, b.camera};
        Rig& rig = *memory;
        const Handle<Keyframe> keyframe = rig.map.add_keyframe();
        rig.map.keyframes().find(keyframe)->world_from_camera = a.world_from_camera;
        for (std::size_t i = 0; i < a.keypoints.size(); ++i) {
            Observation observation;
            const double z = static_cast<double>(a.z_m[i]);
            if (z > 0 && a.is_still[i] != 0) {
                const Vector2 n = undistort_to_normalised(
                    a.camera, {static_cast<double>(a.keypoints[i].x), static_cast<double>(a.keypoints[i].y)});
                observation.point = rig.map.points().take().value();
                MapPoint& point = *rig.map.points().find(observation.point);
                store(a.world_from_camera * Vector3(n.x() * z, n.y() * z, z), point.world);
                point.descriptor = a.descriptors[i];
                point.distance_m = static_cast<float>(z);
                point.angle_rad = a.keypoints[i].angle_rad;
                point.level = a.keypoints[i].level;
            }
            rig.map.add_observation(keyframe, observation, a.descriptors[i]);
        }
        for (std::size_t i = 0; i < b.keypoints.size(); ++i) {
            static_cast<void>(rig.features.keypoints.push(b.keypoints[i]));
            static_cast<void>(rig.features.descriptors.push(b.descriptors[i]));
        }
        words_a->find(vocabulary, a.descriptors);
        rig.matcher.begin(rig.features);
        const SE3 b_from_world = b.world_from_camera.inverse();
        for (Row& row : rows) {
            double best_ms = 1e9;
            for (int round = 0; round < 3; ++round) {
                const double begin = now_ms();
                row.match(rig, a, b, keyframe);
                best_ms = std::min(best_ms, now_ms() - begin);
            }
            row.time_ms += best_ms;
            for (std::size_t i = 0; i < rig.features.size(); ++i) {
                if (rig.matcher.claim(i).is_free()) continue;
                const MapPoint& point = rig.map.points().at(rig.matcher.claim(i).point_slot());
                const Vector3 q = b_from_world * vector_of(point.world);
                row.matches += 1;
                if (q.z() < 0.1) continue;
                const Vector2 pixel = distort_to_pixel(b.camera, {q.x() / q.z(), q.y() / q.z()});
                const Vector2 seen(static_cast<double>(b.keypoints[i].x), static_cast<double>(b.keypoints[i].y));
                row.right += (pixel - seen).norm() < 6.0 * kScales[b.keypoints[i].level];
            }
        }
    }
    const double n = static_cast<double>(pairs.size());
    std::printf("%zu pairs of views of one place, more than 2 s apart, overlapping by 40 %% or more\n", pairs.size());
    std::printf("%-44s %8s %8s %8s %8s\n", "", "matches", "true", "share", "ms");
    for (const Row& row : rows) {
        std::printf("%-44s %8.1f %8.1f %8.3f %8.3f\n", row.name.c_str(), row.matches / n, row.right / n,
                    row.matches > 0 ? row.right / row.matches : 0, row.time_ms / n);
    }
    return 0;
}
