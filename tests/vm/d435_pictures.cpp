// Renders the pictures that the emulated D435 gives out, once, on the building machine: a kind and a size per file, row
// by row without padding. Depth in units of 1 mm, 16 bits; colour as 8-bit grey. The depth camera stands 15 mm to the
// right of the colour camera, and its pictures are as it sees them.
//   d435_pictures FOLDER PICTURES [SCENE]
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "hal/simulated/simulated_camera.hpp"

namespace {

constexpr double kDepthAside_m = 0.015;

struct Job {
    const char* name;
    std::uint32_t width, height, pictures_most;
    bool has_depth, has_colour;
};

template <typename T>
bool append(std::FILE* file, const stillmesh::ImageView<T>& image) {
    const std::size_t count = std::size_t{image.width} * image.height;
    return std::fwrite(image.data, sizeof(T), count, file) == count;
}

std::FILE* create(const std::string& folder, const char* kind, const Job& job) {
    const std::string path = folder + '/' + kind + '_' + job.name;
    std::FILE* const file = std::fopen(path.c_str(), "wb");
    if (file == nullptr) std::perror(path.c_str());
    return file;
}

bool render(const Job& job, const std::string& folder, const std::string& scene, std::uint32_t pictures) {
    stillmesh::SimulationOptions options;
    options.scene = scene;
    options.frames = std::min(pictures, job.pictures_most);
    options.width = job.width;
    options.height = job.height;
    options.depth_baseline_m = -kDepthAside_m;
    stillmesh::SimulatedCamera camera(options);
    if (camera.open() != stillmesh::Status::kOk) {
        std::fprintf(stderr, "%s\n", camera.message().c_str());
        return false;
    }
    std::FILE* const depth = job.has_depth ? create(folder, "depth", job) : nullptr;
    std::FILE* const colour = job.has_colour ? create(folder, "colour", job) : nullptr;
    if ((job.has_depth && depth == nullptr) || (job.has_colour && colour == nullptr)) return false;
    const double mm = 1000.0 / camera.info().depth_units_per_m;
    std::vector<std::uint16_t> millimetres(std::size_t{job.width} * job.height);
    stillmesh::Frame frame;
    bool is_well = true;
    while (is_well && camera.poll(frame) == stillmesh::Status::kOk) {
        for (std::size_t i = 0; i < millimetres.size(); ++i) {
            millimetres[i] = static_cast<std::uint16_t>(frame.depth.data[i] * mm + 0.5);
        }
        if (depth != nullptr) {
            is_well = append(depth, stillmesh::DepthView{millimetres.data(), job.width, job.height, job.width});
        }
        if (colour != nullptr) is_well = is_well && append(colour, frame.colour);
    }
    if (depth != nullptr) is_well = std::fclose(depth) == 0 && is_well;
    if (colour != nullptr) is_well = std::fclose(colour) == 0 && is_well;
    return is_well;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) return 2;
    const std::string scene = argc > 3 ? argv[3] : "walking_xyz";
    const auto pictures = static_cast<std::uint32_t>(std::strtoul(argv[2], nullptr, 10));
    // Nobody tracks with the largest: a few will do.
    constexpr Job kJobs[] = {{"640x480", 640, 480, 1000, true, true},
                             {"848x480", 848, 480, 1000, true, true},
                             {"1280x720", 1280, 720, 3, false, true}};
    for (const Job& job : kJobs) {
        if (!render(job, argv[1], scene, pictures)) return 1;
    }
    return 0;
}
