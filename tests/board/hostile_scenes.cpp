#include "tests/board/hostile_scenes.hpp"

#include <algorithm>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "engine/base/random.hpp"
#include "hal/simulated/simulated_camera.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kBefore = 12;   // frames of a room before it becomes hostile: there is a map to be matched
constexpr std::uint16_t kWall = 10000;  // 2 m

// Pictures of one size, rendered or painted.
class Studio {
public:
    Studio(std::uint32_t width, std::uint32_t height) : width_(width), height_(height) {}

    [[nodiscard]] std::uint32_t width() const { return width_; }
    // Of a room; all black if there is no such scene, which the first one that is asked for says.
    StoredFrame room(const std::string& scene, std::uint64_t seed, std::uint32_t frame) {
        SimulatedCamera* const camera = camera_of(scene, seed);
        Frame seen;
        if (camera == nullptr) return black();
        camera->seek(frame % camera->frame_count());
        if (camera->poll(seen) != Status::kOk) return black();
        StoredFrame out;
        for (std::uint32_t y = 0; y < height_; ++y) {
            out.colour.insert(out.colour.end(), seen.colour.row(y), seen.colour.row(y) + width_);
            out.depth.insert(out.depth.end(), seen.depth.row(y), seen.depth.row(y) + width_);
        }
        return out;
    }
    SimulatedCamera* camera_of(const std::string& scene, std::uint64_t seed) {
        std::unique_ptr<SimulatedCamera>& camera = cameras_[{scene, seed}];
        if (camera == nullptr) {
            SimulationOptions options;
            options.scene = scene;
            options.seed = seed;
            options.width = width_;
            options.height = height_;
            camera = std::make_unique<SimulatedCamera>(options);
            if (camera->open() != Status::kOk) camera.reset();
        }
        return camera.get();
    }
    // A wall at 2 m, painted.
    template <typename Grey>
    StoredFrame wall(Grey&& grey_at) const {
        StoredFrame out{std::vector<std::uint8_t>(std::size_t{width_} * height_),
                        std::vector<std::uint16_t>(std::size_t{width_} * height_, kWall)};
        for (std::uint32_t y = 0; y < height_; ++y) {
            for (std::uint32_t x = 0; x < width_; ++x)
                out.colour[std::size_t{y} * width_ + x] = static_cast<std::uint8_t>(grey_at(x, y));
        }
        return out;
    }
    StoredFrame black() const {
        return wall([](std::uint32_t, std::uint32_t) { return 0U; });
    }
    StoredFrame noise(std::uint64_t seed) const {
        Random random(seed);
        return wall([&](std::uint32_t, std::uint32_t) { return random.below(256); });
    }
    // One picture of `side` px again and again, moved by `shift` px: blocks of 4 px, so that it has corners on all
    // levels.
    StoredFrame tiles(std::uint32_t side, std::uint32_t shift, std::uint64_t seed) const {
        Random random(seed);
        std::vector<std::uint8_t> grey(std::size_t{side} * side);
        for (std::uint8_t& g : grey) g = static_cast<std::uint8_t>(random.below(256));
        return wall([&](std::uint32_t x, std::uint32_t y) {
            return std::uint32_t{grey[((y + shift / 2) / 4 % side) * side + (x + shift) / 4 % side]};
        });
    }
    // A stretch of a wall without end, `at` px along it; the same again after `period` px.
    StoredFrame gallery(std::uint32_t at, std::uint32_t period) const {
        const auto grey = [](std::uint32_t x, std::uint32_t y) { return Random(x * 4096ULL + y + 1).below(128); };
        return wall([&](std::uint32_t x, std::uint32_t y) {
            const std::uint32_t there = (x + at) % period;
            return grey(there / 5, y / 5) + grey(there / 16 + 2048, y / 16 + 2048);
        });
    }
    // The picture in blocks of 48 px, each moved its own way and at its own depth.
    StoredFrame swarm(const StoredFrame& picture, std::uint32_t frame) const {
        constexpr std::uint32_t kSide = 48;
        StoredFrame out = picture;
        for (std::uint32_t y = 0; y < height_; ++y) {
            for (std::uint32_t x = 0; x < width_; ++x) {
                Random random((y / kSide) * 64 + x / kSide + 1);
                const std::uint32_t dx = random.below(7) * frame, dy = random.below(7) * frame;
                const std::size_t from = std::size_t{(y / kSide * kSide + (y + dy) % kSide) % height_} * width_ +
                                         (x / kSide * kSide + (x + dx) % kSide) % width_;
                out.colour[std::size_t{y} * width_ + x] = picture.colour[from];
                out.depth[std::size_t{y} * width_ + x] =
                    static_cast<std::uint16_t>(4000 + random.below(12000) + (random.below(400) * frame));
            }
        }
        return out;
    }

private:
    std::uint32_t width_, height_;
    std::map<std::pair<std::string, std::uint64_t>, std::unique_ptr<SimulatedCamera>> cameras_;
};

struct Scene : HostileScene {
    bool has_room;  // kBefore frames of a room before it
    std::function<StoredFrame(Studio&, std::uint32_t)> frame;
};

StoredFrame clump(const Studio& studio, std::uint32_t frame) {
    Random random(7);
    return studio.wall([&](std::uint32_t x, std::uint32_t y) {
        const std::uint32_t grey = random.below(256);
        return x - 200 - frame < 128 && y - 160 < 96 ? grey : 0;
    });
}

StoredFrame steps(Studio& studio, std::uint32_t frame) {
    StoredFrame out = studio.room("walking_xyz", 1, kBefore + frame);
    Random random(frame);
    std::uint16_t block[64 * 64] = {};
    for (std::uint16_t& depth : block) depth = static_cast<std::uint16_t>(3000 + random.below(20000));
    for (std::size_t i = 0; i < out.depth.size(); ++i)
        out.depth[i] = block[i / studio.width() / 40 * 64 + i % studio.width() / 40];
    return out;
}

// How often the walls of a world repeat, px; 0: there is no such world.
std::uint32_t period_of(const std::string& world) {
    if (world == "gallery") return 1U << 20U;
    return world == "twins" ? 1600 : 0;
}

const std::vector<Scene>& scenes() {
    static const std::vector<Scene> all = {
        {{"noise", "", "every frame other noise"}, true, [](Studio& s, std::uint32_t i) { return s.noise(i); }},
        {{"noise_still", "", "the same noise: as many features as there may be, and all are found again"},
         false,
         [](Studio& s, std::uint32_t) { return s.noise(1); }},
        {{"board", "", "a checkerboard that drifts: equal descriptors"},
         false,
         [](Studio& s, std::uint32_t i) {
             return s.wall([i](std::uint32_t x, std::uint32_t y) { return ((x + i) / 12 + y / 12) % 2 * 200U + 20U; });
         }},
        {{"dots", "", "equal dots close together, that drift"},
         false,
         [](Studio& s, std::uint32_t i) {
             return s.wall(
                 [i](std::uint32_t x, std::uint32_t y) { return (x + i) % 10 < 4 && y % 10 < 4 ? 220U : 30U; });
         }},
        {{"tiles", "", "tiles of one picture, that drift"},
         false,
         [](Studio& s, std::uint32_t i) { return s.tiles(12, 2 * i, 3); }},
        {{"clump", "", "all corners in a small part of the picture"},
         false,
         [](Studio& s, std::uint32_t i) { return clump(s, i); }},
        {{"swarm", "", "every block of a picture moves its own way"},
         true,
         [](Studio& s, std::uint32_t i) { return s.swarm(s.room("walking_xyz", 1, kBefore), i); }},
        {{"steps", "", "the depth of every block jumps"}, true, [](Studio& s, std::uint32_t i) { return steps(s, i); }},
        {{"blind", "", "no depth"},
         true,
         [](Studio& s, std::uint32_t i) {
             StoredFrame out = s.room("walking_xyz", 1, kBefore + i);
             std::fill(out.depth.begin(), out.depth.end(), std::uint16_t{0});
             return out;
         }},
        {{"two_rooms", "", "two rooms in turn"},
         true,
         [](Studio& s, std::uint32_t i) { return s.room("walking_xyz", 1 + i % 2, kBefore + i); }},
        {{"rooms_in_turn", "", "two rooms in turn, some frames of each"},
         true,
         [](Studio& s, std::uint32_t i) { return s.room("walking_xyz", 1 + (i / 5 + 1) % 2, kBefore + i); }},
        {{"churn", "", "every frame another place"},
         true,
         [](Studio& s, std::uint32_t i) { return s.room("walking_xyz", 1 + i * 5 % 7, kBefore + 37 * i); }},
        {{"lost_tiles", "", "a wall of tiles is mapped, covered, and comes back as its mirror image"},
         false,
         [](Studio& s, std::uint32_t i) {
             if (i < 24) return s.tiles(12, 20 * i, 3);
             if (i < 26) return s.black();
             StoredFrame out = s.tiles(12, 20 * i, 3);
             std::reverse(out.colour.begin(), out.colour.end());
             return out;
         }},
        {{"lost_noise", "", "a room is covered, and comes back as noise"},
         true,
         [](Studio& s, std::uint32_t i) { return i < 4 ? s.black() : s.noise(i / 2); }},
        {{"map_noise", "gallery", "noise, and a full map that it may be in"},
         false,
         [](Studio& s, std::uint32_t i) { return s.noise(i); }},
        {{"map_churn", "gallery", "every frame another place of a full map"},
         false,
         [](Studio& s, std::uint32_t i) { return s.gallery(311 + 739 * i % 4000, 1U << 20U); }},
        {{"map_jumps", "gallery", "two places of a full map in turn, some frames of each: found, and never believed"},
         false,
         [](Studio& s, std::uint32_t i) { return s.gallery(300 + i + i / 5 % 2 * 1500, 1U << 20U); }},
        {{"map_twins", "twins", "a full map in which every place is there again and again"},
         false,
         [](Studio& s, std::uint32_t i) { return s.gallery(400 + i + i / 5 % 2 * 800, 1600); }},
        {{"map_tiles", "twins", "tiles, and a full map of walls that repeat"},
         false,
         [](Studio& s, std::uint32_t i) { return s.gallery(400 + 3 * i, 200); }},
    };
    return all;
}

}  // namespace

const std::vector<HostileScene>& hostile_scenes() {
    static const std::vector<HostileScene> all(scenes().begin(), scenes().end());
    return all;
}

bool make_scene(const std::string& name, std::uint32_t frames, std::uint32_t width, std::uint32_t height,
                StoredScene& out) {
    Studio studio(width, height);
    const auto found = std::find_if(scenes().begin(), scenes().end(), [&](const Scene& s) { return s.name == name; });
    const std::size_t colon = std::min(name.find(':'), name.size());
    const std::string room = found == scenes().end() ? name.substr(0, colon) : "walking_xyz";
    const std::uint64_t seed = colon == name.size() ? 1 : std::stoull(name.substr(colon + 1));
    SimulatedCamera* const camera = studio.camera_of(room, seed);
    if (camera == nullptr) return false;
    out.camera = camera->info().model;
    out.frames.clear();
    for (std::uint32_t i = 0; i < frames; ++i) {
        if (found == scenes().end()) {
            out.frames.push_back(studio.room(room, seed, i));
        } else if (found->has_room && i < kBefore) {
            out.frames.push_back(studio.room(room, 1, i));
        } else {
            out.frames.push_back(found->frame(studio, found->has_room ? i - kBefore : i));
        }
    }
    return true;
}

bool visit_world(const std::string& world, std::uint32_t width, std::uint32_t height, const See& see) {
    Studio studio(width, height);
    const std::uint32_t period = period_of(world);
    if (period == 0) return false;
    const CameraModel camera = studio.camera_of("walking_xyz", 1)->info().model;
    for (std::uint32_t i = 0; i < 600; ++i) {
        if (!see(camera, studio.gallery(12 * i, period), std::int64_t{i} * kFrame_ns)) break;
    }
    return true;
}

Frame frame_of(const StoredFrame& stored, const CameraModel& camera, std::int64_t time_ns) {
    Frame frame;
    frame.time_ns = time_ns;
    frame.colour = {stored.colour.data(), camera.width, camera.height, camera.width};
    frame.depth = {stored.depth.data(), camera.width, camera.height, camera.width};
    return frame;
}

std::vector<std::byte> bytes_of(const std::string& file) {
    std::vector<std::byte> out;
    std::FILE* const in = std::fopen(file.c_str(), "rb");
    if (in == nullptr) return out;
    std::byte piece[4096];
    while (const std::size_t size = std::fread(piece, 1, sizeof piece, in)) out.insert(out.end(), piece, piece + size);
    std::fclose(in);
    return out;
}

bool write_scene(const StoredScene& scene, const std::string& file) {
    std::FILE* const out = std::fopen(file.c_str(), "wb");
    if (out == nullptr) return false;
    const CameraModel& c = scene.camera;
    std::fprintf(out, "frames %zu %u %u %a %a %a %a\n", scene.frames.size(), c.width, c.height, c.fx, c.fy, c.cx, c.cy);
    for (const StoredFrame& frame : scene.frames) {
        static_cast<void>(std::fwrite(frame.colour.data(), 1, frame.colour.size(), out));
        static_cast<void>(std::fwrite(frame.depth.data(), 2, frame.depth.size(), out));
    }
    const bool is_whole = std::ferror(out) == 0;
    return (std::fclose(out) == 0) && is_whole;
}

bool read_scene(const std::string& file, StoredScene& out) {
    std::FILE* const in = std::fopen(file.c_str(), "rb");
    if (in == nullptr) return false;
    CameraModel& c = out.camera;
    std::size_t count = 0;
    bool is_whole = std::fscanf(in, "frames %zu %u %u %la %la %la %la", &count, &c.width, &c.height, &c.fx, &c.fy,
                                &c.cx, &c.cy) == 7 &&
                    std::fgetc(in) == '\n';
    const std::size_t pixels = std::size_t{c.width} * c.height;
    for (std::size_t i = 0; is_whole && i < count; ++i) {
        StoredFrame frame{std::vector<std::uint8_t>(pixels), std::vector<std::uint16_t>(pixels)};
        is_whole = std::fread(frame.colour.data(), 1, pixels, in) == pixels &&
                   std::fread(frame.depth.data(), 2, pixels, in) == pixels;
        out.frames.push_back(std::move(frame));
    }
    std::fclose(in);
    return is_whole;
}

}  // namespace stillmesh
