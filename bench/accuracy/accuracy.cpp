// How right the engine is and how well it knows it: simulated scenes and recordings through the engine, tables, bars.
//   accuracy                                       all scenes, seeds 1 to 10, region extraction on and off
//   accuracy --scenes walking_xyz --seeds 1-2 --frames 150 --region on --set keyframes.gap_min=6
//   accuracy --variant gap6:keyframes.gap_min=6    a further engine on the same frames, beside the default one
//   accuracy --variant alone:mapping.is_enabled=false   what mapping earns over tracking alone
//   accuracy --method paper                        a further engine that does what the paper says to the letter
//   accuracy --ablate --seeds 1-2 --test-data     what each rule of the engine earns
//   accuracy --dirt --scenes walking_xyz --seeds 1-2   what each effect of a real camera costs (hal/simulated/dirt.hpp)
//   accuracy --dirt shake=1,rolling=1 --scenes walking_xyz   the scenes with these
//   accuracy --hints wheels,slip --scenes trolley_first   further engines that are told how the camera moved
//   accuracy --masks right,inverted --scenes walking_xyz   further engines that are given a detector's masks
//   accuracy --vocabulary default --scenes walking_loop   a further engine that closes loops, as the program does
//   accuracy --recording DIR                       a TUM folder with groundtruth.txt; masks/ are used when there
//   accuracy --gate static,walking                 exit 1 with the names of what misses its bar, or had no run
//   accuracy --scenes all --test-data --variant alone:mapping.is_enabled=false --gate   all bars, and all they need
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include "bench/accuracy/ablation.hpp"
#include "bench/accuracy/dirt_table.hpp"
#include "bench/accuracy/gate.hpp"
#include "bench/accuracy/results.hpp"
#include "bench/accuracy/tables.hpp"
#include "bench/accuracy/workers.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"

namespace stillmesh::accuracy {
namespace {

constexpr int kDone = 0, kMissed = 1, kBadUsage = 2, kSkipped = 77;  // 77: CTest's "skipped" here

int refuse(const std::string& sentence) {
    fmt::print(stderr, "accuracy: {}\n", sentence);
    return kBadUsage;
}

struct Arguments {
    std::string scenes = "all", seeds = "1-10", region = "both", method = "ours", json, gate, dirt, hints, masks, words;
    std::vector<std::string> recordings, settings, variants, results;
    std::uint32_t frames = 0;
    std::uint32_t jobs = std::max(1U, std::thread::hardware_concurrency());
    bool uses_test_data = false;
    bool is_ablation = false;
    bool is_dirt_table = false;
    RunOptions run;
    VocabularyFile vocabulary;
};

int find_test_data() {
    if (std::getenv("STILLMESH_TEST_DATA") != nullptr) return kDone;
    const char* const ci = std::getenv("CI");
    if (ci != nullptr && std::string(ci) == "true") {
        return refuse("STILLMESH_TEST_DATA must name the folder of recordings.");
    }
    fmt::print("SKIPPED: no real recordings here; set STILLMESH_TEST_DATA to their folder\n");
    return kSkipped;
}

int make_inputs(const Arguments& arguments, bool has_scenes, std::vector<Input>& inputs) {
    std::vector<std::string> recordings = arguments.recordings;
    if (arguments.uses_test_data) {
        if (const int code = find_test_data(); code != kDone) return code;
        const std::string data = std::getenv("STILLMESH_TEST_DATA");
        for (const char* name : {"fr1_rpy_a", "fr1_rpy_a_walking"}) recordings.push_back(data + "/" + name);
    }
    for (const std::string& folder : recordings) inputs.push_back({folder, 0, true, arguments.frames});
    if (!recordings.empty() && !has_scenes) return kDone;
    std::vector<std::uint64_t> seeds;
    if (!parse_seeds(arguments.seeds, seeds)) return refuse("--seeds: give numbers or ranges, as 1-10 or 1,3.");
    std::vector<std::string> scenes;
    for (const std::string& name : split(arguments.scenes)) {
        if (name == "none") continue;
        bool is_known = false;
        for (const SimulatedScene& scene : simulated_scenes()) {  // a group by its prefix: walking
            if (name != "all" && name != scene.name && !std::string(scene.name).starts_with(name + "_")) continue;
            is_known = true;
            // These have no bars; loops are measured on the corridor.
            if (name == "all" && (std::string(scene.name) == "corridor" || !is_clean(scene.dirt))) continue;
            scenes.emplace_back(scene.name);
        }
        if (!is_known) return refuse(fmt::format("--scenes: no scene or group '{}'.", name));
    }
    std::vector<DirtRun> dirts(1);
    std::string message;
    if (arguments.is_dirt_table) dirts = dirt_runs();
    if (!parse_dirt(arguments.dirt, dirts[0].dirt, message)) return refuse("--dirt: " + message + ".");
    if (!arguments.is_dirt_table) dirts[0].name = dirt_text(dirts[0].dirt);
    for (const std::string& scene : scenes) {
        for (const std::uint64_t seed : seeds) {
            for (const DirtRun& run : dirts) {
                inputs.push_back({scene, seed, false, arguments.frames, run.dirt, run.name});
            }
        }
    }
    return kDone;
}

int make_variants(Arguments& arguments, std::vector<Variant>& variants) {
    std::string message;
    Variant base{"on", Configuration::indoor()};
    const auto set = [&message](Variant& variant, const std::string& setting) {
        variant.has_readout |= setting.starts_with("camera.readout_s=");
        return set_parameter(variant.configuration, setting, message);
    };
    for (const std::string& setting : arguments.settings) {
        if (!set(base, setting)) return refuse(message);
    }
    if (arguments.region != "off") variants.push_back(base);
    if (arguments.region != "on") {
        variants.push_back(base);
        variants.back().name = "off";
        variants.back().configuration.region.is_enabled = false;
    }
    if (arguments.method == "paper") {
        variants.push_back(base);
        variants.back().name = "paper";
        variants.back().configuration.region.method = static_cast<std::uint32_t>(RegionMethod::kPaper);
    }
    for (const Rule& rule : arguments.is_ablation ? rules() : std::span<const Rule>()) {
        variants.push_back(base);
        variants.back().name = rule.name;
        for (const std::string& setting : split(rule.off)) {
            if (!set(variants.back(), setting)) return refuse(message);
        }
    }
    for (const std::string& name : split(arguments.hints)) {
        variants.push_back(base);
        variants.back().name = name;
        variants.back().hints = hint_kind(name);
        if (variants.back().hints == nullptr) return refuse(fmt::format("--hints: no kind '{}'.", name));
    }
    for (const std::string& name : split(arguments.masks)) {
        variants.push_back(base);
        variants.back().name = name;
        variants.back().masks = mask_kind(name);
        if (variants.back().masks == nullptr) return refuse(fmt::format("--masks: no kind '{}'.", name));
    }
    if (!arguments.words.empty()) {
        if (!arguments.vocabulary.open(arguments.words, Limits::room().vocabulary_words_max, message))
            return refuse(message);
        variants.push_back(base);
        variants.back().name = "words";
        variants.back().vocabulary = arguments.vocabulary.bytes();
    }
    for (const std::string& text : arguments.variants) {
        const std::size_t colon = text.find(':');
        if (colon == std::string::npos) return refuse("--variant: give NAME:key=value[,key=value].");
        variants.push_back(base);
        variants.back().name = text.substr(0, colon);
        for (const std::string& setting : split(text.substr(colon + 1))) {
            if (!set(variants.back(), setting)) return refuse(message);
        }
    }
    return kDone;
}

int show(const Arguments& arguments, bool is_gated, const Outcome& outcome) {
    const bool is_table = arguments.is_ablation || arguments.is_dirt_table;
    if (arguments.is_ablation) fmt::print("{}\n", ablation_table(outcome.results, "on"));
    if (arguments.is_dirt_table) fmt::print("{}\n", dirt_table(outcome.results));
    if (!is_table) fmt::print("{}\n{}\n", run_table(outcome.results), scene_table(outcome.results));
    for (const std::string& table : {shares_table(outcome.results), nees_table(outcome.results),
                                     mapping_table(outcome.results), summary(outcome.results)}) {
        if (!table.empty() && !is_table) fmt::print("{}\n", table);
    }
    std::string message;
    if (!arguments.json.empty() && !write_whole_file(arguments.json, to_text(outcome.results), message)) {
        return refuse(message);
    }
    for (const std::string& failure : outcome.failures) fmt::print("FAILED {}\n", failure);
    if (outcome.is_stopped) fmt::print("stopped: the tables hold what was done\n");
    bool is_good = outcome.failures.empty() && !outcome.is_stopped;
    if (is_gated) {
        std::vector<std::string> names = split(arguments.gate);
        if (arguments.gate == "all") names = gate_names();
        for (const std::string& failure : failures_of(outcome.results, names)) {
            fmt::print("MISSED {}\n", failure);
            is_good = false;
        }
        if (is_good) fmt::print("all bars reached\n");
    }
    return is_good ? kDone : kMissed;
}

int main(int argc, char** argv) {
    Arguments arguments;
    CLI::App app("How right the engine is, and how well it knows it.");
    auto* const scenes = app.add_option("--scenes", arguments.scenes, "names or groups, comma separated; all, none")
                             ->capture_default_str();
    app.add_option("--seeds", arguments.seeds, "as 1-10 or 1,3")->capture_default_str();
    app.add_option("--frames", arguments.frames, "per run; 0: the scene's own length")->capture_default_str();
    app.add_option("--set", arguments.settings, "key=value of the engine's configuration, for every engine");
    app.add_option("--variant", arguments.variants, "NAME:key=value[,key=value]: one more engine on the same frames");
    app.add_option("--region", arguments.region, "region extraction")
        ->check(CLI::IsMember({"on", "off", "both"}))
        ->capture_default_str();
    app.add_option("--method", arguments.method, "paper: one more engine on the same frames, the paper to the letter")
        ->check(CLI::IsMember({"ours", "paper"}))
        ->capture_default_str();
    app.add_option(
        "--hints", arguments.hints,
        "KIND,...: for each one more engine on the same frames, told how the camera moved. " + hint_kinds_text());
    app.add_option(
        "--masks", arguments.masks,
        "KIND,...: for each one more engine on the same frames, given masks of moving bodies. " + mask_kinds_text());
    app.add_option(
        "--vocabulary", arguments.words,
        "default, or a file: one more engine on the same frames that closes loops and finds a lost camera again");
    app.add_flag("--ablate", arguments.is_ablation, "one engine for each rule, without it: a table of what rules earn");
    auto* const dirt =
        app.add_option(
               "--dirt", arguments.dirt,
               "NAME=STRENGTH,...: the scenes with these effects of real cameras; alone: a table, effect by effect")
            ->expected(0, 1);
    app.add_option("--jobs", arguments.jobs, "runs at a time")->check(CLI::Range(1, 256))->capture_default_str();
    app.add_option("--recording", arguments.recordings, "TUM folders with groundtruth.txt");
    app.add_flag("--test-data", arguments.uses_test_data, "the recordings of STILLMESH_TEST_DATA that have bars");
    app.add_option("--json", arguments.json, "all results as JSON");
    app.add_option("--results", arguments.results,
                   "show and gate what --json wrote earlier, files together; runs nothing");
    app.add_option("--trajectories", arguments.run.trajectories, "folder for the poses given out, TUM format");
    app.add_option("--cache", arguments.run.cache, "folder for rendered frames, 1 MB each; a second run reads them");
    auto* const gate = app.add_option("--gate", arguments.gate, "hold against the bars: all, or names")->expected(0, 1);
    CLI11_PARSE(app, argc, argv);
    if (arguments.dirt == "true") arguments.dirt.clear();
    arguments.is_dirt_table = dirt->count() > 0 && arguments.dirt.empty();
    if (arguments.is_ablation || arguments.is_dirt_table) arguments.region = "on";
    const bool is_gated = gate->count() > 0;
    if (arguments.gate.empty() || arguments.gate == "true") arguments.gate = "all";
    for (const std::string& name : split(arguments.gate)) {
        if (name != "all" && std::find(gate_names().begin(), gate_names().end(), name) == gate_names().end()) {
            return refuse(fmt::format("--gate: no gate '{}'; there are {}.", name, fmt::join(gate_names(), ", ")));
        }
    }
    Outcome outcome;
    if (!arguments.results.empty()) {
        if (arguments.uses_test_data) {  // a gate on results that are only there with the data
            if (const int code = find_test_data(); code != kDone) return code;
        }
        for (const std::string& name : arguments.results) {
            std::ifstream file(name);
            const std::string text{std::istreambuf_iterator<char>(file), {}};
            std::vector<Result> results;
            if (!file || !from_text(text, results)) return refuse(name + ": missing, or not what --json writes.");
            outcome.results.insert(outcome.results.end(), results.begin(), results.end());
        }
        return show(arguments, is_gated, outcome);
    }
    std::error_code error;
    for (const std::string* folder : {&arguments.run.trajectories, &arguments.run.cache}) {
        if (!folder->empty()) std::filesystem::create_directories(*folder, error);
        if (error) return refuse(*folder + ": cannot be made: " + error.message() + ".");
    }
    std::vector<Input> inputs;
    std::vector<Variant> variants;
    if (const int code = make_inputs(arguments, scenes->count() > 0, inputs); code != kDone) return code;
    if (const int code = make_variants(arguments, variants); code != kDone) return code;
    if (inputs.empty()) return refuse("nothing to run.");
    outcome = run_all(inputs, variants, arguments.run, arguments.jobs);
    return show(arguments, is_gated, outcome);
}

}  // namespace
}  // namespace stillmesh::accuracy

int main(int argc, char** argv) {
    return stillmesh::accuracy::main(argc, argv);
}
