// A map that fills every pool of Limits::room(), 256 keyframes of 1000 features, 20 000 points and 256 depth images,
// made up: copied in slices, hashed and written to a file, read, checked and restored. Prints the shortest of some
// rounds, the longest slice (processor time), and whether the hash came back.
//   bench_maps [FILE [ROUNDS]]
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/record/map_copy.hpp"
#include "engine/record/map_load.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/linux/process.hpp"
#include "tests/support/map_hash.hpp"

namespace stillmesh {
namespace {

// Of this process's own time: what others do on the machine is not in it, nor what the disk takes.
std::int64_t own_ns() {
    timespec now{};
    static_cast<void>(::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}
double ms_since(std::int64_t begin_ns) {
    return static_cast<double>(own_ns() - begin_ns) * 1e-6;
}

void fill(Map& map, const Limits& limits, const CameraModel& camera) {
    Random random(1);
    std::vector<Handle<MapPoint>> points;
    for (std::uint32_t i = 0; i < limits.map_points_max; ++i) {
        points.push_back(map.add_point().value());
        MapPoint& point = *map.points().find(points.back());
        for (double& w : point.world) w = random.uniform(-3, 3);
        for (std::uint64_t& word : point.descriptor.words) word = random.next();
        point.distance_m = 2;
    }
    for (std::uint32_t k = 0; k < limits.keyframes_max; ++k) {
        const Handle<Keyframe> handle = map.add_keyframe();
        Keyframe& keyframe = *map.keyframes().find(handle);
        for (int i = 0; i < 3; ++i) keyframe.world_from_camera.translation(i) = random.uniform(-3, 3);
        keyframe.frame = std::uint64_t{10} * k;
        for (std::uint32_t f = 0; f < limits.features_max; ++f) {
            Observation o;
            o.x = static_cast<float>(random.uniform(0, camera.width - 1));
            o.y = static_cast<float>(random.uniform(0, camera.height - 1));
            o.z_m = 2;
            o.var_z = 1e-4F;
            if (f < 700) o.point = points[(std::size_t{k} * 73 + f) % points.size()];
            Descriptor descriptor;
            for (std::uint64_t& word : descriptor.words) word = random.next();
            map.add_observation(handle, o, descriptor);
        }
        map.attach(handle);
    }
}

struct Room {
    Room(const Limits& limits, const CameraModel& camera) {
        ArenaPlan plan;
        Map::plan(plan, limits);
        DepthImages::plan(plan, limits);
        if (!block.allocate(plan.used_bytes())) std::abort();
        Arena arena(block.bytes());
        map.create(arena, limits);
        images.create(arena, limits, camera);
    }
    MemoryBlock block;
    Map map;
    DepthImages images;
};

int measure(const std::string& file, int rounds) {
    const Limits limits = Limits::room();
    MapOrigin origin;
    origin.camera = {640, 480, 525, 525, 319.5, 239.5, 0, 0, 0, 0, 0};
    origin.pyramid_levels = 8;
    origin.scale_factor = 1.2;
    Room from(limits, origin.camera);
    Room to(limits, origin.camera);
    fill(from.map, limits, origin.camera);
    for (std::uint32_t i = 0; i < limits.depth_images_max; ++i) {
        const DepthImages::Owner owner = {from.map.keyframes().handle_of(i), {}, i, false};
        for (std::uint16_t& mm : from.images.put(i, owner)) mm = 2000;
    }
    MemoryBlock workspace;
    if (!workspace.allocate(map_copy_bytes(limits))) return 1;
    double copy = 1e9, slice = 1e9, hash = 1e9, write = 1e9, read = 1e9, check = 1e9, restore = 1e9, load = 1e9,
           wall = 1e9;
    std::uint64_t size = 0;
    bool is_same = true;
    for (int round = 0; round < rounds; ++round) {
        std::string message;
        MapCopy copier;
        std::int64_t begin = own_ns();
        if (copier.begin(workspace.bytes(), limits, origin) != Status::kOk) return 1;
        double longest = 0;
        for (Progress progress = Progress::kWorking; progress == Progress::kWorking;) {
            WorkBudget budget(200);
            const std::int64_t slice_begin = own_ns();
            progress = copier.step(from.map, from.images, {10000, 1'000'000'000}, budget);
            longest = std::max(longest, ms_since(slice_begin));
        }
        copy = std::min(copy, ms_since(begin));
        slice = std::min(slice, longest);
        begin = own_ns();
        MapFileWriter writer(workspace.bytes());
        hash = std::min(hash, ms_since(begin));
        begin = own_ns();
        AtomicFile out;
        std::vector<std::byte> piece(65536);
        bool is_written = out.open(file, message);
        while (const std::size_t count = is_written ? writer.next(piece) : 0) {
            is_written = out.write(std::span(piece).first(count), message);
        }
        if (!is_written || !out.commit(message)) {
            std::fprintf(stderr, "%s\n", message.c_str());
            return 1;
        }
        write = std::min(write, ms_since(begin));
        size = writer.info().size_bytes;

        const std::int64_t load_begin = own_ns();
        const std::int64_t wall_begin = monotonic_ns();
        MemoryBlock block;
        std::span<const std::byte> bytes;
        if (!read_whole_file(file, std::size_t{1} << 30U, block, bytes, message)) return 1;
        read = std::min(read, ms_since(load_begin));
        begin = own_ns();
        MapFileInfo info;
        MapFileProblem problem;
        if (check_map_file(bytes, limits, origin, to.map, info, problem) != Status::kOk) {
            std::fprintf(stderr, "refused: %s\n", problem.part);
            return 1;
        }
        check = std::min(check, ms_since(begin));
        begin = own_ns();
        restore_map(bytes, info, to.map);
        restore_depth_images(bytes, info, to.map, to.images);
        restore = std::min(restore, ms_since(begin));
        load = std::min(load, ms_since(load_begin));
        wall = std::min(wall, static_cast<double>(monotonic_ns() - wall_begin) * 1e-6);
        is_same = is_same && test::map_hash(to.map, origin.camera) == info.hash && info.hash == writer.info().hash;
    }
    std::printf("file %.1f MB; workspace %.1f MiB\n", static_cast<double>(size) * 1e-6,
                static_cast<double>(map_copy_bytes(limits)) / 1048576.0);
    std::printf("copy %.2f ms in slices of 200 units, the longest %.2f ms\n", copy, slice);
    std::printf("hash %.1f ms, write to disk %.1f ms (another thread's)\n", hash, write);
    std::printf("load %.1f ms (%.1f on the wall): read %.1f, check %.1f, restore %.1f\n", load, wall, read, check,
                restore);
    std::printf("hash came back: %s\n", is_same ? "yes" : "NO");
    return is_same ? 0 : 1;
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    return stillmesh::measure(argc > 1 ? argv[1] : "bench_maps.map", argc > 2 ? std::atoi(argv[2]) : 7);
}
