#include "platform/ros2/map_points.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace stillmesh {
namespace {

// docs/SPEC-map.md
constexpr std::size_t kSectionHeadBytes = 16, kCrcBytes = 4;
constexpr std::size_t kCameraBytes = 88, kKeyframeBytes = 328, kPointBytes = 184;
constexpr std::size_t kWeightAt = 151, kLostWeightAt = 153;
constexpr std::byte kWeightMin{5};  // tenths: more likely still than moving
constexpr std::size_t kPieceBytes = 64 * 1024;

}  // namespace

bool MapPoints::open(const Limits& limits, std::string& message) {
    piece_.resize(kPieceBytes);
    if (workspace_.allocate(map_copy_bytes(limits))) return true;
    message = fmt::format("the system has no {:.1f} MiB of memory left for showing the map's points.",
                          static_cast<double>(map_copy_bytes(limits)) / (1024.0 * 1024.0));
    return false;
}

void MapPoints::work(Engine& engine, bool is_free, std::uint32_t units) noexcept {
    if (!is_free) return;
    if (state_ == State::kAsked) {
        if (engine.begin_map_copy(workspace_.bytes()) != Status::kOk) return;  // no map yet
        state_ = State::kCopying;
    }
    if (state_ != State::kCopying) return;
    switch (engine.step_map_copy(units)) {
        case Progress::kDone: state_ = State::kCopied; break;
        case Progress::kIdle: state_ = State::kAsked; break;  // the map was laid aside meanwhile
        case Progress::kWorking: break;
    }
}

void MapPoints::ask() noexcept {
    State idle = State::kIdle;
    state_.compare_exchange_strong(idle, State::kAsked);
}

bool MapPoints::take(std::vector<ShownPoint>& points) {
    if (state_ != State::kCopied) return false;
    points.clear();
    MapFileWriter writer(workspace_.bytes());
    points.reserve(writer.info().points);
    MapPointReader reader(writer.info());
    while (const std::size_t size = writer.next(piece_)) {
        if (!reader.read(std::span(piece_).first(size), points)) break;
    }
    state_ = State::kIdle;
    return true;
}

MapPointReader::MapPointReader(const MapFileInfo& info)
    : first_(kMapHeaderBytes + 3 * kSectionHeadBytes + 2 * kCrcBytes + kCameraBytes +
             std::uint64_t{info.keyframes} * kKeyframeBytes),
      end_(first_ + std::uint64_t{info.points} * kPointBytes) {
    record_.reserve(kPointBytes);
}

bool MapPointReader::read(std::span<const std::byte> bytes, std::vector<ShownPoint>& points) {
    while (!bytes.empty() && at_ < end_) {
        if (at_ < first_) {
            const auto skipped = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), first_ - at_));
            at_ += skipped;
            bytes = bytes.subspan(skipped);
            continue;
        }
        const std::size_t taken = std::min(bytes.size(), kPointBytes - record_.size());
        record_.insert(record_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(taken));
        at_ += taken;
        bytes = bytes.subspan(taken);
        if (record_.size() < kPointBytes) continue;
        if (record_[kLostWeightAt] == std::byte{0} && record_[kWeightAt] >= kWeightMin) {
            ShownPoint point;
            std::memcpy(point.in_map_m, record_.data(), sizeof(point.in_map_m));  // little-endian, as we are
            points.push_back(point);
        }
        record_.clear();
    }
    return at_ < end_;
}

}  // namespace stillmesh
