// Renders the pictures that the emulated D435 gives out, once, on the building machine: a kind and a size per file, row
// by row without padding. Depth in units of 1 mm, 16 bits; colour as 8-bit grey. The depth camera stands 15 mm to the
// right of the colour camera, and its pictures are as it sees them. `truth`: where the colour camera is, a line per
// picture, x y z in m; `registered_640x480`: depth from the colour camera's place.
//   d435_pictures FOLDER PICTURES [SCENE]
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "hal/simulated/simulated_camera.hpp"

namespace {

constexpr double kDepthAside_m = 0.015;

struct Job {
    std::string colour, depth;  // files; empty: none
    std::uint32_t width, height, pictures;
    double depth_aside_m = kDepthAside_m;
};

template <typename T>
void append(std::ofstream& file, const stillmesh::ImageView<T>& image) {
    const std::size_t bytes = sizeof(T) * image.width * image.height;
    file.write(reinterpret_cast<const char*>(image.data), static_cast<std::streamsize>(bytes));
}

// False: a scene or a folder that does not exist, or a full disk.
bool render(const Job& job, const std::string& folder, const std::string& scene) {
    stillmesh::SimulationOptions options;
    options.scene = scene;
    options.frames = job.pictures;
    options.width = job.width;
    options.height = job.height;
    options.depth_baseline_m = -job.depth_aside_m;
    stillmesh::SimulatedCamera camera(options);
    if (camera.open() != stillmesh::Status::kOk) {
        std::fprintf(stderr, "%s\n", camera.message().c_str());
        return false;
    }
    std::ofstream colour, depth, truth(folder + "/truth");
    if (!job.colour.empty()) colour.open(folder + '/' + job.colour, std::ios::binary);
    if (!job.depth.empty()) depth.open(folder + '/' + job.depth, std::ios::binary);
    const double mm = 1000.0 / camera.info().depth_units_per_m;
    std::vector<std::uint16_t> millimetres(std::size_t{job.width} * job.height);
    stillmesh::Frame frame;
    while (camera.poll(frame) == stillmesh::Status::kOk) {
        for (std::size_t i = 0; i < millimetres.size(); ++i) {
            millimetres[i] = static_cast<std::uint16_t>(frame.depth.data[i] * mm + 0.5);
        }
        if (!job.colour.empty()) append(colour, frame.colour);
        if (!job.depth.empty()) {
            append(depth, stillmesh::DepthView{millimetres.data(), job.width, job.height, job.width});
        }
        const auto& place = camera.true_pose().t;
        truth << place[0] << ' ' << place[1] << ' ' << place[2] << '\n';
    }
    return (job.colour.empty() || colour.flush()) && (job.depth.empty() || depth.flush()) && truth.flush();
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) return 2;
    const std::string scene = argc > 3 ? argv[3] : "walking_xyz";
    const auto pictures = static_cast<std::uint32_t>(std::strtoul(argv[2], nullptr, 10));
    // Nobody tracks with the largest: a few will do.
    const Job jobs[] = {{"colour_1280x720", "", 1280, 720, std::min(pictures, 3U)},
                        {"colour_848x480", "depth_848x480", 848, 480, pictures},
                        {"", "registered_640x480", 640, 480, pictures, 0},
                        {"colour_640x480", "depth_640x480", 640, 480, pictures}};
    const bool is_well =
        std::all_of(std::begin(jobs), std::end(jobs), [&](const Job& job) { return render(job, argv[1], scene); });
    if (!is_well) std::fprintf(stderr, "the pictures are not complete: %s\n", argv[1]);
    return is_well ? 0 : 1;
}
