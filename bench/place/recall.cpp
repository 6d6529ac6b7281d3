// How well places are recognised by the words of a vocabulary, beside exhaustive descriptor matching as oracle: recall
// at 100 % precision, that is, the share of the pairs that show one place whose score exceeds that of every pair that
// does not. Then what it costs. Exit 1 when the words' recall is below --min times the oracle's.
//   place_recall [--vocabulary FILE] [--min SHARE] [--views N] [--positive N] [--negative N] [--worst]
//                [--cache FILE]    (views of an earlier run; made when it is not there)
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "bench/place/views.hpp"
#include "engine/configuration.hpp"
#include "engine/frame/kernels.hpp"
#include "engine/place/keyframe_database.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"
#include "tests/support/memory.hpp"

namespace {

using namespace stillmesh;
using bench::PlaceView;
using bench::ViewPair;

double now_ms() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Best partner of each descriptor by ratio test; -1: none.
std::vector<int> best_partners(const std::vector<Descriptor>& from, const std::vector<Descriptor>& to) {
    const MatchingParameters parameters;
    std::vector<int> out(from.size(), -1);
    std::vector<std::uint16_t> distances(to.size());
    for (std::size_t i = 0; i < from.size() && !to.empty(); ++i) {
        cpu_kernels().hamming_many(from[i].words, to[0].words, static_cast<std::uint32_t>(to.size()), distances.data());
        std::uint32_t best = 257;
        std::uint32_t second = 257;
        for (std::size_t j = 0; j < to.size(); ++j) {
            if (distances[j] < best) {
                second = best;
                best = distances[j];
                out[i] = static_cast<int>(j);
            } else if (distances[j] < second) {
                second = distances[j];
            }
        }
        if (best > parameters.hamming_max || best > parameters.ratio_max * second) out[i] = -1;
    }
    return out;
}

std::vector<Descriptor> chosen(const PlaceView& view, bool is_weighted) {
    std::vector<Descriptor> out;
    for (std::size_t i = 0; i < view.descriptors.size(); ++i) {
        if (!is_weighted || view.is_still[i] != 0) out.push_back(view.descriptors[i]);
    }
    return out;
}

// The oracle: how many features find each other, out of those that could.
double oracle_score(const PlaceView& a, const PlaceView& b, bool is_weighted) {
    const std::vector<Descriptor> of_a = chosen(a, is_weighted);
    const std::vector<Descriptor> of_b = chosen(b, is_weighted);
    const std::vector<int> there = best_partners(of_a, of_b);
    const std::vector<int> back = best_partners(of_b, of_a);
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < there.size(); ++i) {
        count += there[i] >= 0 && back[static_cast<std::size_t>(there[i])] == static_cast<int>(i);
    }
    return count;
}

struct Scored {
    const ViewPair* pair = nullptr;
    double score = 0;
};

// Share of positives above every negative, over those pairs that `is_counted`.
double recall(const std::vector<Scored>& scores, const std::function<bool(const ViewPair&)>& is_counted,
              double threshold) {
    std::size_t positives = 0;
    std::size_t found = 0;
    for (const Scored& scored : scores) {
        if (!scored.pair->is_same || !is_counted(*scored.pair)) continue;
        ++positives;
        found += scored.score > threshold;
    }
    return positives == 0 ? 0.0 : static_cast<double>(found) / static_cast<double>(positives);
}
double highest_negative(const std::vector<Scored>& scores) {
    double out = 0;
    for (const Scored& scored : scores) {
        if (!scored.pair->is_same) out = std::max(out, scored.score);
    }
    return out;
}

}  // namespace

int main(int argc, char** argv) {
    std::string file;
    std::string cache;
    double share_min = 0;
    std::uint32_t views_per_scene = 30;
    std::size_t positive_max = 800;
    std::size_t negative_max = 800;
    bool prints_worst = false;
    for (int i = 1; i < argc; ++i) {
        const std::string option = argv[i];
        const char* const value = i + 1 < argc ? argv[i + 1] : "";
        if (option == "--worst") {
            prints_worst = true;
            continue;
        }
        if (option == "--vocabulary") file = value;
        if (option == "--cache") cache = value;
        if (option == "--min") share_min = std::atof(value);
        if (option == "--views") views_per_scene = static_cast<std::uint32_t>(std::atoi(value));
        if (option == "--positive") positive_max = static_cast<std::size_t>(std::atoi(value));
        if (option == "--negative") negative_max = static_cast<std::size_t>(std::atoi(value));
        ++i;
    }
    VocabularyFile opened;
    std::string message;
    double load_ms = 1e9;
    for (int i = 0; i < 7; ++i) {
        const double begin = now_ms();
        if (!opened.open(file, kVocabularyWordsMax, message)) {
            std::printf("%s\n", message.c_str());
            return 2;
        }
        load_ms = std::min(load_ms, now_ms() - begin);
    }
    const Vocabulary& vocabulary = opened.vocabulary();

    std::vector<PlaceView> views;
    const double render_begin = now_ms();
    if (cache.empty() || !bench::load_views(cache, views)) {
        for (std::uint64_t seed = 1; seed <= 3; ++seed)
            bench::add_rendered("static_loop", seed, 0, views_per_scene, views);
        for (std::uint64_t seed = 4; seed <= 5; ++seed) {
            bench::add_rendered("walking_loop", seed, 0, views_per_scene, views);
            bench::add_rendered("walking_loop", seed, seed + 100, views_per_scene, views);
        }
        for (std::uint64_t seed = 6; seed <= 8; ++seed)
            bench::add_rendered("walking_halfsphere", seed, 0, views_per_scene / 3, views);
        const char* const data = std::getenv("STILLMESH_TEST_DATA");
        if (data == nullptr) {
            std::printf("STILLMESH_TEST_DATA is not set: rendered pairs only\n");
        } else {
            for (const char* set : {"fr1_rpy_a", "fr1_rpy_a_walking"}) {
                if (!bench::add_recorded(std::string(data) + "/" + set, 9, views)) return 2;
            }
        }
        if (!cache.empty()) bench::save_views(cache, views);
    }
    const double render_s = (now_ms() - render_begin) * 1e-3;
    const std::vector<ViewPair> pairs = bench::choose_pairs(views, positive_max, negative_max);
    const auto positives = static_cast<std::size_t>(
        std::count_if(pairs.begin(), pairs.end(), [](const ViewPair& pair) { return pair.is_same; }));
    const auto is_real = [&](const ViewPair& pair) { return views[pair.a].room == "recorded"; };
    const auto is_crowded = [&](const ViewPair& pair) {
        return views[pair.a].dynamic_share > 0.15 || views[pair.b].dynamic_share > 0.15;
    };
    std::printf("%s: %s, %u words\n", opened.name().c_str(), vocabulary.info().name, vocabulary.info().words);
    std::printf("%zu views (%.0f s to make), %zu pairs of one place, %zu of two\n", views.size(), render_s, positives,
                pairs.size() - positives);

    const auto count = static_cast<std::uint32_t>(1000);
    std::printf("recall at 100 %% precision          all pairs  recorded  with people (over 15 %% of either view)\n");
    double words_recall[2] = {};
    double oracle_recall[2] = {};
    for (const bool is_weighted : {true, false}) {
        std::vector<std::vector<WordWeight>> bags;
        test::InMemory<FrameWords> words{count};
        for (const PlaceView& view : views) {
            words->find(vocabulary, view.descriptors);
            words->weigh(vocabulary, is_weighted ? view.is_still : std::vector<std::uint8_t>(view.is_still.size(), 1));
            bags.emplace_back(words->bag().begin(), words->bag().end());
        }
        std::vector<Scored> by_words;
        std::vector<Scored> by_oracle;
        for (const ViewPair& pair : pairs) {
            by_words.push_back({&pair, static_cast<double>(bag_score(bags[pair.a], bags[pair.b])) / kBagWeightOne});
            by_oracle.push_back({&pair, oracle_score(views[pair.a], views[pair.b], is_weighted)});
        }
        for (const bool is_oracle : {false, true}) {
            const std::vector<Scored>& scores = is_oracle ? by_oracle : by_words;
            const double threshold = highest_negative(scores);
            const double all = recall(
                scores, [](const ViewPair&) { return true; }, threshold);
            (is_oracle ? oracle_recall : words_recall)[is_weighted] = all;
            std::printf("%-7s %-24s   %6.3f     %6.3f    %6.3f      (threshold %.4f)\n", is_oracle ? "oracle" : "words",
                        is_weighted ? "of what stands still" : "of all features", all,
                        recall(scores, is_real, threshold), recall(scores, is_crowded, threshold), threshold);
            if (prints_worst) {
                std::vector<Scored> sorted = scores;
                std::erase_if(sorted, [](const Scored& scored) { return scored.pair->is_same; });
                std::sort(sorted.begin(), sorted.end(),
                          [](const Scored& a, const Scored& b) { return a.score > b.score; });
                for (std::size_t i = 0; i < 8 && i < sorted.size(); ++i) {
                    const PlaceView& a = views[sorted[i].pair->a];
                    const PlaceView& b = views[sorted[i].pair->b];
                    std::printf("    %.4f  %s+%llu at %.2f s, %s+%llu at %.2f s\n", sorted[i].score, a.room.c_str(),
                                static_cast<unsigned long long>(a.day), static_cast<double>(a.time_ns) * 1e-9,
                                b.room.c_str(), static_cast<unsigned long long>(b.day),
                                static_cast<double>(b.time_ns) * 1e-9);
                }
            }
        }
    }
    const double share = words_recall[1] / oracle_recall[1];
    std::printf("share of the oracle's: %.3f with static weights, %.3f without (at least %.2f)\n", share,
                words_recall[0] / oracle_recall[0], share_min);

    // What it costs: minimum over rounds, mean and worst over views.
    Limits limits = Limits::room();
    test::InMemory<KeyframeDatabase> database{limits};
    test::InMemory<PlaceQuery> query{limits};
    std::vector<std::vector<WordWeight>> bags;
    double words_ms = 0;
    double words_worst_ms = 0;
    double features = 0;
    test::InMemory<FrameWords> words{count};
    for (std::size_t i = 0; i < views.size(); ++i) {
        const std::vector<std::uint8_t> all(views[i].descriptors.size(), 1);
        double best = 1e9;
        for (int round = 0; round < 5; ++round) {
            const double begin = now_ms();
            words->find(vocabulary, views[i].descriptors);
            words->weigh(vocabulary, all);
            best = std::min(best, now_ms() - begin);
        }
        words_ms += best / static_cast<double>(views.size());
        words_worst_ms = std::max(words_worst_ms, best);
        features += static_cast<double>(all.size()) / static_cast<double>(views.size());
        bags.emplace_back(words->bag().begin(), words->bag().end());
    }
    for (std::uint32_t slot = 0; slot < limits.keyframes_max; ++slot) {
        const PlaceView& view = views[slot % views.size()];
        words->find(vocabulary, view.descriptors);
        words->weigh(vocabulary, std::vector<std::uint8_t>(view.descriptors.size(), 1));
        database->add(slot, *words);
    }
    double query_ms = 0;
    double query_worst_ms = 0;
    double units = 0;
    for (const std::vector<WordWeight>& bag : bags) {
        double best = 1e9;
        for (int round = 0; round < 5; ++round) {
            const double begin = now_ms();
            query->begin(*database, bag);
            WorkBudget budget(1'000'000);
            if (query->step(*database, budget) != Progress::kDone) return 1;
            best = std::min(best, now_ms() - begin);
            if (round == 0) units += static_cast<double>(budget.units_spent()) / static_cast<double>(bags.size());
        }
        query_ms += best / static_cast<double>(bags.size());
        query_worst_ms = std::max(query_worst_ms, best);
    }
    std::printf("size %zu bytes, opened and checked in %.2f ms\n", vocabulary.bytes().size(), load_ms);
    std::printf("words of a frame (%.0f features): %.3f ms, worst %.3f (at most 0.6)\n", features, words_ms,
                words_worst_ms);
    std::printf("query in %u keyframes: %.3f ms, worst %.3f (at most 0.3), %.0f work units\n", database->size(),
                query_ms, query_worst_ms, units);
    std::printf("memory beside the vocabulary under Limits::room(): %zu KiB\n",
                (database.used_bytes() + query.used_bytes() + words.used_bytes()) / 1024);
    return share >= share_min ? 0 : 1;
}
