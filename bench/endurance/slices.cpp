// What a slice of mapping takes in time, and whether its work units say so. A few copies of tracking and mapping see
// the same frames; their pieces are the same, bit by bit, so the least time of each piece over the copies is the
// piece's own, without what the machine did meanwhile. Pieces are put together to slices as the scheduler does it.
//   bench_slices [--input SCENE:SEED | --input FOLDER] [--max MS] [--spread FACTOR]: exit 1 when a slice is longer, or
//   when in a stage with more than 1 % of the time a unit takes FACTOR times more or less than on average. Full pools:
//   --limits pocket --gap 3, or --limits room --gap 1.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "engine/mapping/mapping.hpp"
#include "engine/tracking/tracking.hpp"
#include "hal/replay/replay_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/linux/cpu_kernels.hpp"

namespace stillmesh {
namespace {

constexpr const char* kStageNames[] = {"idle", "cull", "choose", "collect", "adjust", "commit", "redundant", "evict"};
constexpr std::size_t kStageCount = std::size(kStageNames);

struct Arguments {
    std::string input = "walking_loop:1", limits = "room";
    std::uint32_t frames = 400, copies = 3, gap = 0;
    double max_ms = 1e9, spread = 1e9;
};

double cpu_us() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

struct Copy {
    std::vector<std::byte> memory;
    World world;
    Tracking tracking;
    Mapping mapping;
};

struct Piece {
    Mapping::Stage stage = Mapping::Stage::kIdle;
    std::uint64_t units = 0;
    double us = 0;
};

struct StageSums {
    std::uint64_t pieces = 0, units = 0, units_max = 0;
    double us = 0, us_max = 0, us_of_units_max = 0;
};

int complain(const std::string& sentence) {
    fmt::print(stderr, "bench_slices: {}\n", sentence);
    return 2;
}

int run(const Arguments& arguments, DepthCamera& camera) {
    const Limits limits = arguments.limits == "pocket" ? Limits::pocket() : Limits::room();
    Parameters configuration = Parameters();
    configuration.features.count = std::min(configuration.features.count, limits.features_max);
    if (arguments.gap > 0) {
        configuration.keyframes.tracked_share_max = 1.0;
        configuration.keyframes.new_points_min = 1;
        configuration.keyframes.gap_min = arguments.gap;
    }
    ArenaPlan plan;
    World::plan(plan, limits);
    Tracking::plan(plan, limits);
    Mapping::plan(plan, limits);
    std::vector<std::unique_ptr<Copy>> copies;
    for (std::uint32_t i = 0; i < arguments.copies; ++i) {
        copies.push_back(std::make_unique<Copy>());
        Copy& copy = *copies.back();
        copy.memory.resize(plan.used_bytes() + 4096);
        Arena arena({copy.memory.data() + 4096 - reinterpret_cast<std::uintptr_t>(copy.memory.data()) % 4096,
                     plan.used_bytes()});
        copy.world.create(arena, limits, configuration, camera.info().model);
        copy.tracking.create(arena, copy.world, cpu_kernels(), nullptr);
        copy.mapping.create(arena, copy.world);
    }

    std::vector<Piece> slices;  // their stage is that of their first piece
    StageSums stages[kStageCount];
    std::uint32_t frames = 0;
    Frame frame;
    std::vector<Piece> pieces, again;
    std::uint64_t debt = 0;
    for (Status status = camera.poll(frame); status != Status::kEnd && frames < arguments.frames;
         status = camera.poll(frame)) {
        if (status != Status::kOk) continue;
        ++frames;
        pieces.clear();
        const std::uint64_t granted = configuration.schedule.units_per_frame;
        const std::uint64_t left = granted - std::min(granted, debt);
        for (const auto& copy : copies) {
            copy->tracking.track(frame);
            again.clear();
            std::uint64_t spent = 0;
            while (spent < left) {
                Piece piece;
                piece.stage = copy->mapping.stage();
                WorkBudget budget(1);  // one piece
                const double begin = cpu_us();
                if (copy->mapping.step(budget) == Progress::kIdle) break;
                piece.us = cpu_us() - begin;
                piece.units = budget.units_spent();
                if (piece.stage == Mapping::Stage::kIdle) piece.stage = Mapping::Stage::kCull;
                spent += piece.units;
                again.push_back(piece);
            }
            if (copy == copies.front()) {
                pieces = again;
                continue;
            }
            if (again.size() != pieces.size()) return complain("the copies differ.");
            for (std::size_t i = 0; i < pieces.size(); ++i) pieces[i].us = std::min(pieces[i].us, again[i].us);
        }
        std::uint64_t spent = 0;
        bool is_open = false;
        for (const Piece& piece : pieces) {
            if (!is_open) slices.push_back({piece.stage, 0, 0});
            slices.back().units += piece.units;
            slices.back().us += piece.us;
            spent += piece.units;
            is_open = slices.back().units < configuration.schedule.slice_units;
            StageSums& sums = stages[static_cast<std::size_t>(piece.stage)];
            ++sums.pieces;
            sums.units += piece.units;
            sums.us += piece.us;
            sums.units_max = std::max(sums.units_max, piece.units);
            if (piece.us > sums.us_max) {
                sums.us_max = piece.us;
                sums.us_of_units_max = static_cast<double>(piece.units);
            }
        }
        debt = debt > granted ? debt - granted : spent > left ? spent - left : 0;
    }
    if (slices.empty()) return complain("mapping had nothing to do.");

    double us = 0;
    std::uint64_t units = 0, units_max = 0;
    for (const StageSums& s : stages) {
        us += s.us;
        units += s.units;
        units_max = std::max(units_max, s.units_max);
    }
    const double ns_per_unit = 1e3 * us / static_cast<double>(units);
    fmt::print("{} frames of {}, {} copies, {} keyframes, {} points; least processor time of a piece\n", frames,
               arguments.input, arguments.copies, copies.front()->world.map.keyframes().size(),
               copies.front()->world.map.points().size());
    fmt::print("{:>12} {:>8} {:>10} {:>10} {:>9} {:>8} {:>10} {:>10} {:>10}\n", "stage", "pieces", "units", "units max",
               "ms", "share", "ns/unit", "max us", "its units");
    double spread = 1;
    for (std::size_t s = 1; s < kStageCount; ++s) {
        const StageSums& sums = stages[s];
        if (sums.pieces == 0) continue;
        const double ns = 1e3 * sums.us / static_cast<double>(sums.units);
        if (sums.us > 0.01 * us) spread = std::max({spread, ns / ns_per_unit, ns_per_unit / ns});
        fmt::print("{:>12} {:>8} {:>10} {:>10} {:>9.2f} {:>7.1f}% {:>10.1f} {:>10.1f} {:>10.0f}\n", kStageNames[s],
                   sums.pieces, sums.units, sums.units_max, 1e-3 * sums.us, 100 * sums.us / us, ns, sums.us_max,
                   sums.us_of_units_max);
    }
    fmt::print("{:>12} {:>8} {:>10} {:>10} {:>9.2f} {:>7.1f}% {:>10.1f}\n", "all", "", units, "", 1e-3 * us, 100.0,
               ns_per_unit);
    std::sort(slices.begin(), slices.end(), [](const Piece& a, const Piece& b) { return a.us > b.us; });
    fmt::print("{} slices of {} units; longest {:.3f} ms:", slices.size(), configuration.schedule.slice_units,
               1e-3 * slices.front().us);
    for (std::size_t i = 0; i < std::min<std::size_t>(6, slices.size()); ++i) {
        fmt::print(" {:.3f} ({}, {} units)", 1e-3 * slices[i].us,
                   kStageNames[static_cast<std::size_t>(slices[i].stage)], slices[i].units);
    }
    fmt::print("\n");
    const std::uint32_t piece_max = copies.front()->mapping.piece_units_max();
    fmt::print("ceiling of a piece {} units (seen {}), of a slice {} units (seen {})\n", piece_max, units_max,
               configuration.schedule.slice_units + piece_max,
               std::max_element(slices.begin(), slices.end(), [](const Piece& a, const Piece& b) {
                   return a.units < b.units;
               })->units);
    if (units_max > piece_max) return complain("a piece took more units than its ceiling.");
    const double longest_ms = 1e-3 * slices.front().us;
    const bool is_good = longest_ms <= arguments.max_ms && spread <= arguments.spread;
    fmt::print("longest slice {:.3f} ms; a unit of a stage is within a factor of {:.2f} of the mean: {}\n", longest_ms,
               spread, is_good ? "good" : "MISSED");
    return is_good ? 0 : 1;
}

int open_and_run(const Arguments& arguments) {
    if (std::filesystem::is_directory(arguments.input)) {
        ReplayCamera camera({.folder = arguments.input, .calibration = ""});
        if (camera.open() != Status::kOk) return complain(camera.message());
        return run(arguments, camera);
    }
    SimulationOptions options;
    const std::size_t colon = arguments.input.find(':');
    options.scene = arguments.input.substr(0, colon);
    if (colon != std::string::npos) options.seed = std::strtoull(arguments.input.c_str() + colon + 1, nullptr, 10);
    options.frames = arguments.frames;
    SimulatedCamera camera(options);
    if (camera.open() != Status::kOk) return complain(camera.message());
    return run(arguments, camera);
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    stillmesh::Arguments arguments;
    CLI::App app("What a slice of mapping takes in time, and whether its work units say so.");
    app.add_option("--input", arguments.input, "a simulated scene SCENE:SEED, or a folder in TUM layout")
        ->capture_default_str();
    app.add_option("--frames", arguments.frames)->check(CLI::Range(10U, 1'000'000U))->capture_default_str();
    app.add_option("--copies", arguments.copies, "of the engine")->check(CLI::Range(1U, 16U))->capture_default_str();
    app.add_option("--gap", arguments.gap, "a keyframe every so many frames; 0: as configured")->capture_default_str();
    app.add_option("--limits", arguments.limits)->check(CLI::IsMember({"room", "pocket"}))->capture_default_str();
    app.add_option("--max", arguments.max_ms, "ms, of the longest slice");
    app.add_option("--spread", arguments.spread, "between the time of a stage's unit and the mean");
    CLI11_PARSE(app, argc, argv);
    return stillmesh::open_and_run(arguments);
}
