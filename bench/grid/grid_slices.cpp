// What a grid of 256 depth images takes, in the slices in which the program makes it between frames: one look a second
// of a simulated camera, at its true poses. Prints, in processor time and the shortest of some rounds: the longest
// slice of each kind of work, all of it, what handing the finished grid over takes, and a checksum of grid and cloud:
// what makes it faster leaves that as it is.
//   bench_grid [SCENE [SEED [IMAGES [ROUNDS]]]]
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "hal/simulated/simulated_camera.hpp"
#include "platform/grid/grid_files.hpp"
#include "platform/grid/grid_job.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kFramesApart = 30, kCell_px = 8;

// Of this thread's own time: what others do on the machine is not in it.
double own_ms() {
    timespec now{};
    static_cast<void>(::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now));
    return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

struct Looks {
    struct Look {
        std::vector<std::uint16_t> depth_mm;
        RigidTransform map_from_camera;
    };
    std::uint32_t columns = 0, rows = 0;
    std::vector<float> rays;
    std::vector<Look> looks;

    [[nodiscard]] DepthImage depth_image(std::uint32_t index) const {
        if (index >= looks.size()) return {};
        const Look& look = looks[index];
        return {columns, rows, look.depth_mm, rays, std::uint64_t{index} * kFramesApart, look.map_from_camera};
    }
};

RigidTransform transform_of(const SimulatedPose& pose) {
    return {{pose.q[0], pose.q[1], pose.q[2], pose.q[3]}, {pose.t[0], pose.t[1], pose.t[2]}};
}

bool look_around(const SimulationOptions& options, std::uint32_t images, Looks& out) {
    SimulatedCamera camera(options);
    if (camera.open() != Status::kOk) {
        std::fprintf(stderr, "%s\n", camera.message().c_str());
        return false;
    }
    const CameraModel& model = camera.info().model;
    out.columns = model.width / kCell_px;
    out.rows = model.height / kCell_px;
    const auto middle = [](std::uint32_t cell) { return cell * kCell_px + 0.5 * (kCell_px - 1); };
    for (std::uint32_t row = 0; row < out.rows; ++row) {
        for (std::uint32_t column = 0; column < out.columns; ++column) {
            out.rays.push_back(static_cast<float>((middle(column) - model.cx) / model.fx));
            out.rays.push_back(static_cast<float>((middle(row) - model.cy) / model.fy));
        }
    }
    RigidTransform map_from_world;
    for (std::uint32_t i = 0; i < images; ++i) {
        camera.seek(i * kFramesApart);
        Frame frame;
        if (camera.poll(frame) != Status::kOk) return false;
        const RigidTransform world_from_camera = transform_of(camera.true_pose());
        if (i == 0) map_from_world = inverse_of(world_from_camera);
        Looks::Look& look = out.looks.emplace_back();
        look.map_from_camera = compose(map_from_world, world_from_camera);
        for (std::uint32_t row = 0; row < out.rows; ++row) {
            for (std::uint32_t column = 0; column < out.columns; ++column) {
                const std::uint32_t x = column * kCell_px + kCell_px / 2, y = row * kCell_px + kCell_px / 2;
                const double mm = 1e3 * frame.depth.at(x, y) / frame.depth_units_per_m;
                auto cell = static_cast<std::uint16_t>(std::min(mm, static_cast<double>(DepthImage::kDepth)));
                if (cell != 0 && camera.dynamic_mask().at(x, y) != 0) cell |= DepthImage::kMoving;
                look.depth_mm.push_back(cell);
            }
        }
    }
    return true;
}

struct Times {
    double begin = 1e9, all = 1e9, without_floor = 1e9, hand_over = 1e9;  // ms
    double longest_floor = 1e9, longest = 1e9;                            // slices
};

void measure(const Looks& looks, GridJob& job, Times& times) {
    double at = own_ms();
    job.begin(looks);
    times.begin = std::min(times.begin, own_ms() - at);
    double all = 0, floor = 0, longest = 0, longest_floor = 0;
    for (bool is_working = true; is_working;) {
        const bool is_of_floor = !job.floor().is_known;
        at = own_ms();
        is_working = job.step(looks);
        const double slice = own_ms() - at;
        all += slice;
        floor += is_of_floor ? slice : 0;
        (is_of_floor ? longest_floor : longest) = std::max(is_of_floor ? longest_floor : longest, slice);
    }
    times.all = std::min(times.all, all);
    times.without_floor = std::min(times.without_floor, all - floor);
    times.longest = std::min(times.longest, longest);
    times.longest_floor = std::min(times.longest_floor, longest_floor);
    at = own_ms();
    const std::size_t cells = grid_pgm(job.grid()).size();
    times.hand_over = cells == 0 ? 0 : std::min(times.hand_over, own_ms() - at);
}

// FNV-1a.
std::uint64_t checksum_of(const Looks& looks, const GridJob& job) {
    std::uint64_t sum = 14695981039346656037U;
    for (const char c : grid_pgm(job.grid()) + cloud_ply(looks, job, job.floor().level_from_map)) {
        sum = (sum ^ static_cast<unsigned char>(c)) * 1099511628211U;
    }
    return sum;
}

int run(const std::string& scene, std::uint64_t seed, std::uint32_t images, int rounds) {
    SimulationOptions options;
    options.scene = scene;
    options.seed = seed;
    options.frames = images * kFramesApart;
    Looks looks;
    std::string message;
    Limits limits;
    limits.depth_images_max = images;
    GridJob job;
    if (!look_around(options, images, looks) || !job.open(limits, GridOptions{}, message)) return 1;
    Times times;
    for (int round = 0; round < rounds; ++round) measure(looks, job, times);
    if (!job.has_grid()) {
        std::fprintf(stderr, "no grid: %s\n", why_no_grid(job).c_str());
        return 1;
    }
    std::printf("%s:%llu, %u depth images, %ux%u cells, checksum %016llx\n", scene.c_str(),
                static_cast<unsigned long long>(seed), images, job.grid().width(), job.grid().height(),
                static_cast<unsigned long long>(checksum_of(looks, job)));
    std::printf("all %.1f ms, without the floor %.1f; begin %.2f ms, hand over %.2f ms\n", times.all,
                times.without_floor, times.begin, times.hand_over);
    std::printf("the longest slice: %.2f ms, of the floor %.2f\n", times.longest, times.longest_floor);
    return 0;
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    const auto number = [&](int i, int preset) { return argc > i ? std::atoi(argv[i]) : preset; };
    return stillmesh::run(argc > 1 ? argv[1] : "walking_xyz", static_cast<std::uint64_t>(number(2, 1)),
                          static_cast<std::uint32_t>(number(3, 256)), number(4, 9));
}
