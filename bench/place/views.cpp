#include "bench/place/views.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "engine/base/random.hpp"
#include "engine/features/own_extractor.hpp"
#include "engine/geometry/camera.hpp"
#include "hal/replay/png_reader.hpp"
#include "hal/replay/replay_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh::bench {
namespace {

// One extractor for all.
OwnExtractor& extractor() {
    static MemoryBlock block;
    static OwnExtractor own = [] {
        if (!block.allocate(own_extractor_bytes(Limits::room()))) std::abort();
        return create_own_extractor(block.bytes(), Limits::room(), FeatureParameters{}, cpu_kernels()).value();
    }();
    return own;
}

SE3 pose_of(const std::array<double, 3>& t, const std::array<double, 4>& q) {
    SE3 out;
    out.rotation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).toRotationMatrix();
    out.translation = Vector3(t[0], t[1], t[2]);
    return out;
}

void look(const Frame& frame, const ImageView<std::uint8_t>& mask, PlaceView& view) {
    OwnExtractor& own = extractor();
    if (own.extractor->extract(frame.colour, *own.features) != Status::kOk) std::abort();
    view.time_ns = frame.time_ns;
    view.keypoints.assign(own.features->keypoints.begin(), own.features->keypoints.end());
    view.descriptors.assign(own.features->descriptors.begin(), own.features->descriptors.end());
    const auto is_moving = [&](std::uint32_t x, std::uint32_t y) { return mask.data != nullptr && mask.at(x, y) != 0; };
    const auto z_of = [&](std::uint32_t x, std::uint32_t y) {
        return static_cast<float>(frame.depth.at(x, y) / frame.depth_units_per_m);
    };
    for (const Keypoint& keypoint : view.keypoints) {
        const auto x = std::min(frame.colour.width - 1, static_cast<std::uint32_t>(keypoint.x));
        const auto y = std::min(frame.colour.height - 1, static_cast<std::uint32_t>(keypoint.y));
        view.is_still.push_back(!is_moving(x, y));
        view.z_m.push_back(z_of(x, y));
    }
    for (std::uint32_t y = kThumbnailStep_px / 2; y < frame.depth.height; y += kThumbnailStep_px) {
        for (std::uint32_t x = kThumbnailStep_px / 2; x < frame.depth.width; x += kThumbnailStep_px) {
            view.thumbnail_z_m.push_back(is_moving(x, y) ? 0.0F : z_of(x, y));
        }
    }
    view.thumbnail_width = (frame.depth.width - kThumbnailStep_px / 2 + kThumbnailStep_px - 1) / kThumbnailStep_px;
}

}  // namespace

void add_rendered(const std::string& scene, std::uint64_t seed, std::uint64_t day, std::uint32_t frames,
                  std::vector<PlaceView>& views) {
    SimulationOptions options;
    options.scene = scene;
    options.seed = seed;
    options.day = day;
    SimulatedCamera camera(options);
    if (camera.open() != Status::kOk) {
        std::fprintf(stderr, "%s\n", camera.message().c_str());
        std::abort();
    }
    for (std::uint32_t i = 0; i < frames; ++i) {
        camera.seek(static_cast<std::uint32_t>(std::uint64_t{i} * camera.frame_count() / frames));
        Frame frame;
        if (camera.poll(frame) != Status::kOk) std::abort();
        PlaceView view;
        view.set = scene;
        // The seed alone makes the room; what stands in its middle is the scene's.
        view.room = scene + ":" + std::to_string(seed);
        view.day = day;
        view.camera = camera.info().model;
        view.world_from_camera = pose_of(camera.true_pose().t, camera.true_pose().q);
        view.dynamic_share = camera.dynamic_share();
        look(frame, camera.dynamic_mask(), view);
        views.push_back(std::move(view));
    }
}

bool add_recorded(const std::string& folder, std::uint32_t step, std::vector<PlaceView>& views) {
    ReplayOptions options;
    options.folder = folder;
    ReplayCamera camera(options);
    std::string message;
    Trajectory truth;
    if (camera.open() != Status::kOk || read_trajectory(folder + "/groundtruth.txt", truth, message) != Status::kOk) {
        std::fprintf(stderr, "%s%s\n", camera.message().c_str(), message.c_str());
        return false;
    }
    Frame frame;
    std::vector<std::uint8_t> mask;
    for (std::uint32_t i = 0; camera.poll(frame) == Status::kOk; ++i) {
        if (i % step != 0) continue;
        const auto after =
            std::lower_bound(truth.begin(), truth.end(), frame.time_ns,
                             [](const TrajectoryPose& pose, std::int64_t t) { return pose.time_ns < t; });
        if (after == truth.begin() || after == truth.end()) continue;
        const TrajectoryPose& pose =
            after->time_ns - frame.time_ns < frame.time_ns - (after - 1)->time_ns ? *after : *(after - 1);
        if (std::abs(pose.time_ns - frame.time_ns) > 20'000'000) continue;
        PlaceView view;
        view.set = std::filesystem::path(folder).filename().string();
        view.room = "recorded";  // two recordings of one room
        view.camera = camera.info().model;
        view.world_from_camera = pose_of(pose.t, pose.q);
        mask.clear();
        ImageHeader header;
        // Masks are named after the colour images' times.
        const std::string mask_file = folder + "/masks/" + time_text(frame.time_ns).substr(0, 17) + ".png";
        ImageView<std::uint8_t> mask_view;
        if (read_png_header(mask_file, header, message) == Status::kOk && header.kind == ImageKind::kGrey8) {
            mask.resize(std::size_t{header.width} * header.height);
            if (read_png(mask_file, header, mask, message) == Status::kOk) {
                mask_view = {mask.data(), header.width, header.height, header.width};
                view.dynamic_share = static_cast<double>(std::count_if(mask.begin(), mask.end(),
                                                                       [](std::uint8_t m) { return m > 127; })) /
                                     static_cast<double>(mask.size());
            }
        }
        look(frame, mask_view, view);
        views.push_back(std::move(view));
    }
    return true;
}

namespace {

constexpr std::uint64_t kCacheMagic = 0x5354'494c'4c56'0001ULL;

// The same list of fields both ways.
template <typename File>
void exchange(File& file, PlaceView& view) {
    file.list(view.set);
    file.list(view.room);
    file.plain(view.day);
    file.plain(view.time_ns);
    for (int i = 0; i < 9; ++i) file.plain(view.world_from_camera.rotation(i));
    for (int i = 0; i < 3; ++i) file.plain(view.world_from_camera.translation(i));
    file.plain(view.camera);
    file.plain(view.dynamic_share);
    file.list(view.keypoints);
    file.list(view.descriptors);
    file.list(view.is_still);
    file.list(view.z_m);
    file.list(view.thumbnail_z_m);
    file.plain(view.thumbnail_width);
}
struct Reader {
    std::ifstream stream;
    template <typename T>
    void plain(T& value) {
        stream.read(reinterpret_cast<char*>(&value), sizeof(T));
    }
    template <typename List>
    void list(List& list) {
        std::uint64_t size = 0;
        plain(size);
        if (!stream || size > 1'000'000) return stream.setstate(std::ios::failbit);
        list.resize(size);
        stream.read(reinterpret_cast<char*>(list.data()), static_cast<std::streamsize>(size * sizeof(list[0])));
    }
};
struct Writer {
    std::ofstream stream;
    template <typename T>
    void plain(T& value) {
        stream.write(reinterpret_cast<const char*>(&value), sizeof(T));
    }
    template <typename List>
    void list(List& list) {
        std::uint64_t size = list.size();
        plain(size);
        stream.write(reinterpret_cast<const char*>(list.data()), static_cast<std::streamsize>(size * sizeof(list[0])));
    }
};

}  // namespace

bool load_views(const std::string& file, std::vector<PlaceView>& views) {
    Reader reader{std::ifstream(file, std::ios::binary)};
    std::uint64_t magic = 0;
    std::uint64_t count = 0;
    reader.plain(magic);
    reader.plain(count);
    if (!reader.stream || magic != kCacheMagic || count > 100'000) return false;
    views.resize(count);
    for (PlaceView& view : views) exchange(reader, view);
    if (!reader.stream) views.clear();
    return !views.empty();
}

void save_views(const std::string& file, const std::vector<PlaceView>& views) {
    Writer writer{std::ofstream(file, std::ios::binary)};
    std::uint64_t magic = kCacheMagic;
    std::uint64_t count = views.size();
    writer.plain(magic);
    writer.plain(count);
    for (PlaceView view : views) exchange(writer, view);
}

Overlap overlap_of(const PlaceView& a, const PlaceView& b) {
    const SE3 b_from_a = b.world_from_camera.inverse() * a.world_from_camera;
    std::uint32_t measured = 0;
    std::uint32_t seen = 0;
    std::uint32_t in_frustum = 0;
    std::uint32_t points = 0;
    const std::uint32_t rows = static_cast<std::uint32_t>(a.thumbnail_z_m.size()) / a.thumbnail_width;
    for (std::uint32_t row = 0; row < rows; ++row) {
        for (std::uint32_t column = 0; column < a.thumbnail_width; ++column) {
            ++points;
            const double measured_z = a.thumbnail_z_m[std::size_t{row} * a.thumbnail_width + column];
            // What was not measured may be anywhere along its ray.
            const std::vector<double> depths =
                measured_z > 0 ? std::vector<double>{measured_z} : std::vector<double>{0.6, 1.2, 2.4, 4.8, 9.6};
            measured += measured_z > 0;
            bool is_in_frustum = false;
            for (const double z : depths) {
                // Pinholes do: the lens moves a pixel by less than the tolerance.
                const double u = kThumbnailStep_px * (column + 0.5);
                const double v = kThumbnailStep_px * (row + 0.5);
                const Vector3 p((u - a.camera.cx) / a.camera.fx * z, (v - a.camera.cy) / a.camera.fy * z, z);
                const Vector3 q = b_from_a * p;
                if (q.z() < 0.2) continue;
                const double x = q.x() / q.z() * b.camera.fx + b.camera.cx;
                const double y = q.y() / q.z() * b.camera.fy + b.camera.cy;
                if (!(x >= 0 && y >= 0 && x < b.camera.width && y < b.camera.height)) continue;
                is_in_frustum = true;
                if (!(measured_z > 0)) continue;
                const auto at_column =
                    std::min(b.thumbnail_width - 1, static_cast<std::uint32_t>(x / kThumbnailStep_px));
                const auto at_row = static_cast<std::uint32_t>(y / kThumbnailStep_px);
                const double other = b.thumbnail_z_m[std::size_t{at_row} * b.thumbnail_width + at_column];
                const double tolerance = 0.1 + 0.05 * q.z();
                seen += other > 0 && other - q.z() < tolerance && q.z() - other < tolerance;
            }
            in_frustum += is_in_frustum;
        }
    }
    if (measured == 0) return {0, 1};
    return {static_cast<double>(seen) / measured, static_cast<double>(in_frustum) / points};
}

std::vector<ViewPair> choose_pairs(std::span<const PlaceView> views, std::size_t positive_max,
                                   std::size_t negative_max) {
    std::vector<ViewPair> positive;
    std::vector<ViewPair> apart;   // of one room
    std::vector<ViewPair> abroad;  // of two
    for (std::uint32_t a = 0; a < views.size(); ++a) {
        for (std::uint32_t b = a + 1; b < views.size(); ++b) {
            if (views[a].room != views[b].room) {
                abroad.push_back({a, b, false});
                continue;
            }
            const std::int64_t gap_ns = views[a].time_ns - views[b].time_ns;
            const bool is_later = views[a].day != views[b].day || views[a].set != views[b].set ||
                                  gap_ns > 2'000'000'000 || gap_ns < -2'000'000'000;
            const Overlap there = overlap_of(views[a], views[b]);
            const Overlap back = overlap_of(views[b], views[a]);
            if (std::min(there.seen, back.seen) >= 0.4 && is_later) positive.push_back({a, b, true});
            if (there.in_frustum == 0 && back.in_frustum == 0) apart.push_back({a, b, false});
        }
    }
    Random random(77);
    const auto thin = [&](std::vector<ViewPair>& pairs, std::size_t count_max) {
        for (std::size_t i = 0; i < pairs.size() && i < count_max; ++i) {
            const auto left = static_cast<std::uint32_t>(pairs.size() - i);
            std::swap(pairs[i], pairs[i + random.below(left)]);
        }
        if (pairs.size() > count_max) pairs.resize(count_max);
    };
    thin(positive, positive_max);
    thin(apart, negative_max / 2);
    thin(abroad, negative_max - apart.size());
    positive.insert(positive.end(), apart.begin(), apart.end());
    positive.insert(positive.end(), abroad.begin(), abroad.end());
    return positive;
}

}  // namespace stillmesh::bench
