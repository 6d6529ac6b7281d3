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
constexpr std::int64_t kShownEvery_ns = 5'000'000'000;  // what is shown costs a costmap's reader much more than us

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
    GridOptions grid;
    if (!grid_options_of(options, grid, message)) return false;
    if (!job_.open(limits, grid, message)) return false;
    options_ = options;
    grid_ = options.grid;
    cloud_ = options.cloud;
    file_.every_ns = options.grid.empty() ? 0 : every_ns;
    return true;
}

void GridOutputs::show_on(GridShelf* shelf) {
    if (shelf == nullptr || grid_.empty()) return;
    shelf_ = shelf;
    shelf_->open(GridOptions{}.cells_max);
    shown_.every_ns = kShownEvery_ns;
    job_.align_with(shelf_->frame_from_map());
}

void GridOutputs::work(const Engine& engine, std::int64_t now_ns, std::optional<std::int64_t> until_ns) {
    if (!job_.is_working() && !is_shown_ && !has_cloud_) {
        is_answer_ = is_asked_ && !is_writing_;
        if (is_answer_) is_asked_ = false;
        is_for_file_ = is_answer_ || (!is_writing_ && file_.is_due(now_ns));
        is_shown_ = shown_.is_due(now_ns);
        if (!is_for_file_ && !is_shown_) return;
        job_.begin(engine);
        rows_shown_ = 0;
    }
    // At least one slice, or a board that is never ahead of its frames would never have a grid.
    const std::int64_t end_ns = std::min(now_ns + kBehindFrame_ns, until_ns.value_or(now_ns + kBehindFrame_ns));
    while (job_.step(engine) || (is_shown_ && job_.has_grid() && show_rows()) || add_points(engine)) {
        if (monotonic_ns() >= end_ns) return;
    }
    is_shown_ = false;
    // Without a floor whoever asked is told; else the end of the run says so.
    if (is_answer_ && !grid_.empty() && !job_.has_grid()) {
        const std::lock_guard lock(mutex_);
        news_ = "--grid " + grid_ + ": is not saved: " + why_no_grid(job_) + ".";
    }
    if (is_for_file_ && (job_.has_grid() || has_cloud_)) save_aside();
    is_answer_ = has_cloud_ = false;
}

std::string GridOutputs::save_soon() {
    if (!options_.is_any()) return {};
    is_asked_ = true;
    if (cloud_.empty()) return "the grid is saved to " + grid_ + ".yaml";
    return grid_.empty() ? "the cloud is saved to " + cloud_
                         : "the grid is saved to " + grid_ + ".yaml, the cloud to " + cloud_;
}

bool GridOutputs::add_points(const Engine& engine) {
    if (!is_answer_ || cloud_.empty()) return false;
    if (!has_cloud_) {
        std::string why_not;  // told at the end of the run
        points_.begin(job_, level(why_not));
        has_cloud_ = true;
    }
    return points_.add(engine, job_);
}

bool GridOutputs::show_rows() {
    constexpr std::uint32_t kCellsAtOnce = 8192;
    const OccupancyGrid& grid = job_.grid();
    ShownGrid& draft = shelf_->draft();
    if (rows_shown_ == 0) {
        draft.width = grid.width();
        draft.height = grid.height();
        draft.resolution_m = grid.options().resolution_m;
        const RigidTransform level_from_grid{{0, 0, 0, 1}, {grid.origin_x(), grid.origin_y(), 0}};
        draft.map_from_grid = compose(inverse_of(job_.floor().level_from_map), level_from_grid);
        draft.cells.clear();
    }
    const std::uint32_t end = std::min(grid.height(), rows_shown_ + 1 + kCellsAtOnce / grid.width());
    for (; rows_shown_ < end; ++rows_shown_) {
        for (std::uint32_t column = 0; column < grid.width(); ++column) {
            const GridCell cell = grid.at(column, rows_shown_);
            draft.cells.push_back(cell == GridCell::kFree       ? ShownGrid::kFree
                                  : cell == GridCell::kOccupied ? ShownGrid::kOccupied
                                                                : ShownGrid::kUnknown);
        }
    }
    if (rows_shown_ < grid.height()) return true;
    shelf_->hand_over();
    return false;
}

void GridOutputs::save_aside() {
    join();
    is_writing_ = true;
    std::vector<std::pair<std::string, std::string>> files;
    if (!grid_.empty() && job_.has_grid()) {
        const std::string picture = std::filesystem::path(grid_).filename().string() + ".pgm";
        files.emplace_back(grid_ + ".pgm", grid_pgm(job_.grid()));
        files.emplace_back(grid_ + ".yaml", grid_yaml(job_.grid(), job_.floor(), picture));
    }
    try {
        // A cloud's file is put together there: some megabytes.
        thread_ = std::jthread(
            [this, files = std::move(files), cloud = has_cloud_ ? cloud_ : "", points = std::move(points_)]() mutable {
                std::string message;
                if (!cloud.empty()) files.emplace_back(cloud, points.ply());
                for (const auto& [name, bytes] : files) {
                    if (write_whole_file(name, bytes, message)) continue;
                    fail(message);
                    break;
                }
                is_writing_ = false;
            });
    } catch (const std::system_error& error) {
        fail(grid_ + cloud_ + ": could not be written, for want of a thread: " + error.what() + ".");
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

std::optional<RigidTransform> GridOutputs::level(std::string& why_not) const {
    const Floor& floor = job_.floor();
    if (options_.level == Level::kFloor) {
        if (floor.is_known) return floor.level_from_map;
        why_not = why_no_grid(job_);
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
    is_shown_ = is_for_file_ = is_answer_ = is_asked_ = has_cloud_ = false;  // what was begun between frames ends here
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
        problems_.push_back("--grid " + grid_ + ": was not written: " + why_no_grid(job_) + ".");
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
