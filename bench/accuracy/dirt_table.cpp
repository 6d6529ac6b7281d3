#include "bench/accuracy/dirt_table.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace stillmesh::accuracy {
namespace {

std::string cells(const std::vector<Result>& results, const std::string& variant, const std::string& dirt) {
    double ate_sum = 0;
    double worst = 0;
    std::uint64_t runs = 0, lost = 0, tracked = 0, posed = 0, frames = 0;
    for (const Result& result : results) {
        if (result.variant != variant || result.dirt != dirt) continue;
        const Measures& m = result.measures;
        frames += m.frames;
        tracked += m.tracked;
        posed += m.tracked + m.unsure;
        lost += m.is_lost() ? 1U : 0U;
        if (m.ate_m < 0) continue;
        ate_sum += m.ate_m;
        worst = std::max(worst, m.ate_m);
        ++runs;
    }
    if (frames == 0) return " | | | | |";
    const std::string ate =
        runs == 0 ? " - | - |" : fmt::format(" {:.4f} | {:.4f} |", ate_sum / static_cast<double>(runs), worst);
    return ate + fmt::format(" {:.1f} % | {:.1f} % | {} |", 100 * Measures::share(tracked, frames),
                             100 * Measures::share(posed, frames), lost);
}

}  // namespace

std::vector<DirtRun> dirt_runs() {
    std::vector<DirtRun> out = {{"clean", all_dirt(0)}, {"all", all_dirt(1)}};
    std::string message;
    Dirt table;
    visit_dirt(table, [&](const char* name, double, const char*) {
        out.push_back({name, all_dirt(0)});
        static_cast<void>(parse_dirt(name + std::string("=1"), out.back().dirt, message));
        out.push_back({"all but " + std::string(name), all_dirt(1)});
        static_cast<void>(parse_dirt(name + std::string("=0"), out.back().dirt, message));
    });
    return out;
}

std::string dirt_table(const std::vector<Result>& results) {
    std::vector<std::string> variants;
    for (const Result& result : results) {
        if (std::find(variants.begin(), variants.end(), result.variant) == variants.end()) {
            variants.push_back(result.variant);
        }
    }
    std::string out;
    for (const std::string& variant : variants) {
        if (variants.size() > 1) out += fmt::format("{}\n\n", variant);
        out +=
            "| effect | alone: ATE m | worst | tracked | pose | lost | all but it: ATE m | worst | tracked | pose | "
            "lost "
            "|\n"
            "|---|---|---|---|---|---|---|---|---|---|---|\n";
        out += "| none; all |" + cells(results, variant, "clean") + cells(results, variant, "all") + "\n";
        Dirt table;
        visit_dirt(table, [&](const char* name, double, const char*) {
            out += fmt::format("| {} |{}{}\n", name, cells(results, variant, name),
                               cells(results, variant, std::string("all but ") + name));
        });
        out += "\n";
    }
    return out;
}

}  // namespace stillmesh::accuracy
