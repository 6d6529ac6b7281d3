#include "bench/accuracy/sources.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <vector>

#include "hal/replay/decimal_time.hpp"
#include "hal/replay/image_reader.hpp"
#include "hal/replay/replay_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"

namespace stillmesh::accuracy {
namespace {

namespace fs = std::filesystem;

class SimulatedSource final : public Source {
public:
    explicit SimulatedSource(const Input& input) : camera_(options_of(input)) {}
    [[nodiscard]] bool open(std::string& message) {
        if (camera_.open() == Status::kOk) return true;
        message = camera_.message();
        return false;
    }
    [[nodiscard]] const CameraInfo& info() const { return camera_.info(); }
    [[nodiscard]] const CameraModel& model() const override { return camera_.info().model; }
    [[nodiscard]] std::uint32_t frame_count() const override { return camera_.frame_count(); }
    [[nodiscard]] Status next(TrueFrame& out, std::string& message) override {
        const Status status = camera_.poll(out.frame);
        if (status != Status::kOk) {
            message = camera_.message();
            return status;
        }
        const SimulatedPose& pose = camera_.true_pose();
        out.has_truth = true;
        out.truth = {pose.time_ns, pose.t, pose.q};
        out.mask = camera_.dynamic_mask();
        return Status::kOk;
    }

private:
    [[nodiscard]] static SimulationOptions options_of(const Input& input) {
        SimulationOptions options;
        options.scene = input.scene;
        options.seed = input.seed;
        options.frames = input.frames;
        options.dirt = input.dirt;
        return options;
    }
    SimulatedCamera camera_;
};

// Rendered frames on disk, uncompressed, 0.95 MB each. The name holds a fingerprint of the simulation's source: a
// picture of an older renderer is never taken for one of today's. One machine's scratch: no format for exchange.
struct CacheHead {
    char magic[8] = {'s', 'm', 'f', 'r', 'a', 'm', 'e', '1'};
    CameraModel model;
    double depth_units_per_m = 0;
    std::uint32_t frames = 0;
    std::uint32_t reserved = 0;
};
struct CacheFrame {
    std::int64_t time_ns = 0, depth_time_ns = 0;
    TrajectoryPose truth;
};

[[nodiscard]] std::size_t pixels_of(const CameraModel& model) {
    return static_cast<std::size_t>(model.width) * model.height;
}
[[nodiscard]] std::size_t frame_bytes(const CameraModel& model) {
    return sizeof(CacheFrame) + 3 * pixels_of(model) + (pixels_of(model) + 7) / 8;
}
[[nodiscard]] std::string cache_file(const Input& input, const std::string& folder) {
    const std::string dirt = dirt_text(input.dirt);
    return fmt::format("{}/{}_{}_{}{}{}_{}.frames", folder, input.scene, input.seed, input.frames,
                       dirt.empty() ? "" : "_", dirt, std::string_view(STILLMESH_SIMULATED_FINGERPRINT).substr(0, 16));
}

class CachedSource final : public Source {
public:
    CachedSource() = default;
    ~CachedSource() override {
        if (bytes_ != nullptr) munmap(bytes_, size_);
    }
    CachedSource(const CachedSource&) = delete;
    CachedSource& operator=(const CachedSource&) = delete;

    [[nodiscard]] bool open(const std::string& file) {
        const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
        if (descriptor < 0) return false;
        struct stat info {};
        const bool has_size = fstat(descriptor, &info) == 0 && info.st_size >= static_cast<off_t>(sizeof head_);
        size_ = static_cast<std::size_t>(info.st_size);
        void* const bytes = has_size ? mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0) : MAP_FAILED;
        ::close(descriptor);
        if (bytes == MAP_FAILED) return false;
        bytes_ = static_cast<std::byte*>(bytes);
        std::memcpy(&head_, bytes_, sizeof head_);
        mask_.resize(pixels_of(head_.model));
        depth_.resize(pixels_of(head_.model));
        return std::memcmp(head_.magic, CacheHead{}.magic, sizeof head_.magic) == 0 &&
               size_ == sizeof head_ + head_.frames * frame_bytes(head_.model);
    }
    [[nodiscard]] const CameraModel& model() const override { return head_.model; }
    [[nodiscard]] std::uint32_t frame_count() const override { return head_.frames; }
    [[nodiscard]] Status next(TrueFrame& out, std::string&) override {
        if (next_ == head_.frames) return Status::kEnd;
        const std::byte* at = bytes_ + sizeof head_ + next_++ * frame_bytes(head_.model);
        const std::size_t pixels = pixels_of(head_.model);
        const std::uint32_t width = head_.model.width;
        const std::uint32_t height = head_.model.height;
        CacheFrame frame;
        std::memcpy(&frame, at, sizeof frame);
        at += sizeof frame;
        out.frame.time_ns = frame.time_ns;
        out.frame.depth_time_ns = frame.depth_time_ns;
        out.frame.format = PixelFormat::kGrey8;
        out.frame.depth_units_per_m = head_.depth_units_per_m;
        out.frame.colour = {reinterpret_cast<const std::uint8_t*>(at), width, height, width};
        at += pixels;
        std::memcpy(depth_.data(), at, 2 * pixels);
        out.frame.depth = {depth_.data(), width, height, width};
        at += 2 * pixels;
        for (std::size_t i = 0; i < pixels; ++i) {
            mask_[i] = (std::to_integer<unsigned>(at[i / 8]) >> (i % 8) & 1U) != 0 ? 255 : 0;
        }
        out.mask = {mask_.data(), width, height, width};
        out.has_truth = true;
        out.truth = frame.truth;
        return Status::kOk;
    }

private:
    CacheHead head_;
    std::byte* bytes_ = nullptr;
    std::size_t size_ = 0;
    std::uint32_t next_ = 0;
    std::vector<std::uint8_t> mask_;
    std::vector<std::uint16_t> depth_;
};

// Renders, and keeps what it rendered; a file that is not complete never gets its name.
class KeepingSource final : public Source {
public:
    KeepingSource(const Input& input, std::string file)
        : camera_(input), file_(std::move(file)), part_(fmt::format("{}.{}.part", file_, getpid())) {}
    ~KeepingSource() override {
        if (stream_ == nullptr) return;
        std::fclose(stream_);
        std::remove(part_.c_str());
    }
    KeepingSource(const KeepingSource&) = delete;
    KeepingSource& operator=(const KeepingSource&) = delete;

    [[nodiscard]] bool open(std::string& message) {
        if (!camera_.open(message)) return false;
        stream_ = std::fopen(part_.c_str(), "wb");
        if (stream_ == nullptr) {
            message = part_ + ": cannot be written.";
            return false;
        }
        CacheHead head;
        head.model = camera_.model();
        head.depth_units_per_m = camera_.info().depth_units_per_m;
        head.frames = camera_.frame_count();
        put(&head, sizeof head);
        return true;
    }
    [[nodiscard]] const CameraModel& model() const override { return camera_.model(); }
    [[nodiscard]] std::uint32_t frame_count() const override { return camera_.frame_count(); }
    [[nodiscard]] Status next(TrueFrame& out, std::string& message) override {
        const Status status = camera_.next(out, message);
        if (status == Status::kEnd && stream_ != nullptr) {
            is_good_ = std::fclose(stream_) == 0 && is_good_;
            stream_ = nullptr;
            if (!is_good_ || std::rename(part_.c_str(), file_.c_str()) != 0) std::remove(part_.c_str());
        }
        if (status != Status::kOk || stream_ == nullptr) return status;
        const CacheFrame frame{out.frame.time_ns, out.frame.depth_time_ns, out.truth};
        put(&frame, sizeof frame);
        for (std::uint32_t y = 0; y < out.frame.colour.height; ++y) {
            put(out.frame.colour.row(y), out.frame.colour.width);
        }
        for (std::uint32_t y = 0; y < out.frame.depth.height; ++y) {
            put(out.frame.depth.row(y), 2 * static_cast<std::size_t>(out.frame.depth.width));
        }
        bits_.assign((pixels_of(model()) + 7) / 8, 0);
        std::size_t i = 0;
        for (std::uint32_t y = 0; y < out.mask.height; ++y) {
            for (std::uint32_t x = 0; x < out.mask.width; ++x, ++i) {
                if (out.mask.at(x, y) > 127) bits_[i / 8] = static_cast<std::uint8_t>(bits_[i / 8] | 1U << (i % 8));
            }
        }
        put(bits_.data(), bits_.size());
        return status;
    }

private:
    void put(const void* bytes, std::size_t size) {
        is_good_ = std::fwrite(bytes, 1, size, stream_) == size && is_good_;
    }

    SimulatedSource camera_;
    std::string file_, part_;
    std::FILE* stream_ = nullptr;
    bool is_good_ = true;
    std::vector<std::uint8_t> bits_;
};

class RecordingSource final : public Source {
public:
    explicit RecordingSource(const Input& input)
        : camera_({.folder = input.scene, .calibration = ""}), folder_(input.scene), frames_max_(input.frames) {}
    [[nodiscard]] bool open(std::string& message) {
        if (camera_.open() != Status::kOk) {
            message = camera_.message();
            return false;
        }
        if (read_trajectory(folder_ + "/groundtruth.txt", truth_, message) != Status::kOk) return false;
        std::error_code error;
        for (const auto& entry : fs::directory_iterator(folder_ + "/masks", error)) {
            if (entry.path().extension() != ".png") continue;
            if (const auto time = parse_time_ns(entry.path().stem().string())) masks_[*time] = entry.path().string();
        }
        pixels_.resize(pixels_of(model()));
        return true;
    }
    [[nodiscard]] const CameraModel& model() const override { return camera_.info().model; }
    [[nodiscard]] double readout_s() const override { return camera_.info().readout_s; }
    [[nodiscard]] std::uint32_t frame_count() const override {
        return frames_max_ == 0 ? camera_.counts().frames : std::min(frames_max_, camera_.counts().frames);
    }
    [[nodiscard]] Status next(TrueFrame& out, std::string& message) override {
        if (next_ == frame_count()) return Status::kEnd;
        ++next_;
        const Status status = camera_.poll(out.frame);
        if (status != Status::kOk) {
            message = camera_.message();
            return status;
        }
        out.has_truth = truth_at(truth_, out.frame.time_ns, 50'000'000, out.truth);
        out.mask = {};
        const auto mask = masks_.find(out.frame.time_ns);
        if (mask == masks_.end()) return Status::kOk;
        const Status read =
            read_image(mask->second, {model().width, model().height, ImageKind::kGrey8}, pixels_, message);
        // Recordings number the bodies, from 100 on; lower numbers are the blur round them.
        for (std::uint8_t& pixel : pixels_) pixel = pixel >= 100 ? std::uint8_t{255} : pixel;
        if (read == Status::kOk) out.mask = {pixels_.data(), model().width, model().height, model().width};
        return read;
    }

private:
    ReplayCamera camera_;
    std::string folder_;
    std::uint32_t frames_max_ = 0, next_ = 0;
    Trajectory truth_;
    std::map<std::int64_t, std::string> masks_;  // by the time of their colour image
    std::vector<std::uint8_t> pixels_;
};

template <typename T, typename... Arguments>
std::unique_ptr<Source> opened(std::string& message, Arguments&&... arguments) {
    auto source = std::make_unique<T>(std::forward<Arguments>(arguments)...);
    if (!source->open(message)) return nullptr;
    return source;
}

}  // namespace

std::unique_ptr<Source> open_source(const Input& input, const RunOptions& options, std::string& message) {
    if (input.is_recording) return opened<RecordingSource>(message, input);
    if (options.cache.empty()) return opened<SimulatedSource>(message, input);
    const std::string file = cache_file(input, options.cache);
    auto cached = std::make_unique<CachedSource>();
    if (cached->open(file)) return cached;
    return opened<KeepingSource>(message, input, file);
}

}  // namespace stillmesh::accuracy
