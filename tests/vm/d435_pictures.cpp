// Renders the pictures that the emulated D435 gives out, once, on the building machine: a kind and a size per file, row
// by row without padding. Depth in units of 1 mm, 16 bits; colour as 8-bit grey. The depth camera stands 15 mm to the
// right of the colour camera, and its pictures are as it sees them. `truth`: where the colour camera is, a line per
// picture, x y z in m.
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
    std::string size;
    std::uint32_t width, height, pictures;
    bool has_depth;
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
    options.depth_baseline_m = -kDepthAside_m;
    stillmesh::SimulatedCamera camera(options);
    if (camera.open() != stillmesh::Status::kOk) {
        std::fprintf(stderr, "%s\n", camera.message().c_str());
        return false;
    }
    std::ofstream colour(folder + "/colour_" + job.size, std::ios::binary), depth, truth(folder + "/truth");
    if (job.has_depth) depth.open(folder + "/depth_" + job.size, std::ios::binary);
    const double mm = 1000.0 / camera.info().depth_units_per_m;
    std::vector<std::uint16_t> millimetres(std::size_t{job.width} * job.height);
    stillmesh::Frame frame;
    while (camera.poll(frame) == stillmesh::Status::kOk) {
        for (std::size_t i = 0; i < millimetres.size(); ++i) {
            millimetres[i] = static_cast<std::uint16_t>(frame.depth.data[i] * mm + 0.5);
        }
        append(colour, frame.colour);
        if (job.has_depth) {
            append(depth, stillmesh::DepthView{millimetres.data(), job.width, job.height, job.width});
        }
        const auto& place = camera.true_pose().t;
        truth << place[0] << ' ' << place[1] << ' ' << place[2] << '\n';
    }
    return colour.flush() && truth.flush() && (!job.has_depth || depth.flush());
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) return 2;
    const std::string scene = argc > 3 ? argv[3] : "walking_xyz";
    const auto pictures = static_cast<std::uint32_t>(std::strtoul(argv[2], nullptr, 10));
    // Nobody tracks with the largest: a few will do.
    const Job jobs[] = {{"1280x720", 1280, 720, std::min(pictures, 3U), false},
                        {"640x480", 640, 480, pictures, true},
                        {"848x480", 848, 480, pictures, true}};
    const bool is_well =
        std::all_of(std::begin(jobs), std::end(jobs), [&](const Job& job) { return render(job, argv[1], scene); });
    if (!is_well) std::fprintf(stderr, "the pictures are not complete: %s\n", argv[1]);
    return is_well ? 0 : 1;
}
