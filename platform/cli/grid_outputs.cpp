#include "platform/cli/grid_outputs.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "platform/grid/grid_files.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/text_output.hpp"

namespace stillmesh {
namespace {

constexpr std::int64_t kBehindFrame_ns = 1'000'000;

[[nodiscard]] std::string numbered(const std::string& name, int number, const char* end) {
    return fmt::format("{}.{}{}", name, number, end);
}

}  // namespace

bool GridOutputs::open(const GridOutputOptions& options, const Limits& limits, std::int64_t every_ns,
                       std::string& message) {
    if (!options.is_any()) return true;
    if (limits.depth_images_max == 0) {
        message = fmt::format(
            "--grid, --cloud: these limits keep no depth images of keyframes; give them some, 9.5 KiB each: --set "
            "limits.depth_images_max={}.",
            limits.keyframes_max);
        return false;
    }
    if (options.robot_m <= options.obstacle_m) {
        message = fmt::format("--robot-height {:g}: is not above --obstacle-height {:g}; give a larger one.",
                              options.robot_m, options.obstacle_m);
        return false;
    }
    GridOptions grid;
    grid.obstacle_m = options.obstacle_m;
    grid.robot_m = options.robot_m;
    if (!job_.open(limits, grid, message)) return false;
    options_ = options;
    grid_ = options.grid;
    cloud_ = options.cloud;
    every_ns_ = options.grid.empty() ? 0 : every_ns;
    return true;
}

void GridOutputs::work(const Engine& engine, std::int64_t now_ns, std::optional<std::int64_t> until_ns) {
    if (every_ns_ <= 0 || is_writing_) return;
    if (next_ns_ == 0) next_ns_ = now_ns + every_ns_;
    if (!job_.is_working()) {
        if (now_ns < next_ns_) return;
        next_ns_ = now_ns + every_ns_;
        job_.begin(engine);
    }
    // At least one slice, or a board that is never ahead of its frames would never have a grid.
    const std::int64_t end_ns = std::min(now_ns + kBehindFrame_ns, until_ns.value_or(now_ns + kBehindFrame_ns));
    while (job_.step(engine)) {
        if (monotonic_ns() >= end_ns) return;
    }
    if (job_.has_grid()) save_aside();  // without a floor the end of the run says so
}

void GridOutputs::save_aside() {
    join();
    is_writing_ = true;
    const std::string picture = std::filesystem::path(grid_).filename().string() + ".pgm";
    try {
        thread_ = std::jthread([this, name = grid_, pgm = grid_pgm(job_.grid()),
                                yaml = grid_yaml(job_.grid(), job_.floor(), picture)] {
            std::string message;
            if (!write_whole_file(name + ".pgm", pgm, message) || !write_whole_file(name + ".yaml", yaml, message)) {
                fail(message);
            }
            is_writing_ = false;
        });
    } catch (const std::system_error& error) {
        fail(grid_ + ": could not be written, for want of a thread: " + error.what() + ".");
        is_writing_ = false;
    }
}

// Said once: the end of the run tries again.
void GridOutputs::fail(const std::string& problem) {
    const std::lock_guard lock(mutex_);
    if (failures_++ == 0) news_ = problem;
}

std::string GridOutputs::take_news() {
    const std::lock_guard lock(mutex_);
    return std::exchange(news_, {});
}

std::string GridOutputs::why_no_grid() const {
    if (job_.looks().empty()) {
        return "nothing was kept of what was seen; that begins a second after the start, with frames of a sure pose";
    }
    if (!job_.floor().is_known) {
        return "no floor was seen for certain; let the camera look down at some of it, held upright";
    }
    return "nothing was seen within reach of it";
}

std::optional<RigidTransform> GridOutputs::level(std::string& why_not) const {
    const Floor& floor = job_.floor();
    if (options_.level == Level::kFloor) {
        if (floor.is_known) return floor.level_from_map;
        why_not = why_no_grid();
    }
    if (options_.level != Level::kGravity || gravity_ == nullptr) return std::nullopt;
    const Gravity gravity = gravity_->gravity();
    why_not = gravity.why_not;
    if (!gravity.is_known) return std::nullopt;
    RigidTransform out = level_from_up(gravity.up);
    if (floor.is_known) out.translation_m[2] = floor.level_from_map.translation_m[2];
    return out;
}

void GridOutputs::write_all(const Engine& engine) {
    if (!options_.is_any()) return;
    join();
    const std::int64_t begin_ns = monotonic_ns();
    job_.begin(engine);
    while (job_.step(engine)) {
    }
    GridRecord record;
    record.build_ms = static_cast<double>(monotonic_ns() - begin_ns) * 1e-6;
    record.looks = job_.looks().size();
    record.memory_bytes = job_.memory_bytes();
    record.has_floor = job_.floor().is_known;
    record.floor_share = job_.floor().share;
    std::string message;
    if (!grid_.empty() && !job_.has_grid()) {
        problems_.push_back("--grid " + grid_ + ": was not written: " + why_no_grid() + ".");
    } else if (!grid_.empty() && write_grid(job_, grid_, message)) {
        record.grid = grid_ + ".yaml";
        record.width = job_.grid().width();
        record.height = job_.grid().height();
        record.is_cut = job_.grid().is_cut();
    } else if (!grid_.empty()) {
        problems_.push_back(message);
    }
    if (!cloud_.empty()) {
        std::string why_not;
        const std::optional<RigidTransform> level_from_map = level(why_not);
        record.is_level = level_from_map.has_value();
        if (write_whole_file(cloud_, cloud_ply(engine, job_, level_from_map), message)) {
            record.cloud = cloud_;
        } else {
            problems_.push_back(message);
        }
        if (!why_not.empty()) {
            problems_.push_back("--cloud " + cloud_ + ": is not level: " + why_not +
                                (why_not.ends_with('?') ? "" : "."));
        }
    }
    written_.push_back(record);
}

void GridOutputs::begin_new_map(const Engine& engine) {
    if (!options_.is_any()) return;
    write_all(engine);
    std::error_code error;
    int number = 1;
    while (std::filesystem::exists(numbered(options_.grid, number, ".yaml"), error) ||
           std::filesystem::exists(numbered(options_.cloud, number, ""), error)) {
        ++number;
    }
    if (!options_.grid.empty()) grid_ = numbered(options_.grid, number, "");
    if (!options_.cloud.empty()) cloud_ = numbered(options_.cloud, number, "");
}

void GridOutputs::finish(const Engine& engine, RunRecord& record) {
    write_all(engine);
    record.grids = std::move(written_);
    record.problems.insert(record.problems.end(), problems_.begin(), problems_.end());
}

}  // namespace stillmesh
