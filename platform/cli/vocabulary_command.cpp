#include "platform/cli/vocabulary_command.hpp"

#include <unistd.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "engine/features/own_extractor.hpp"
#include "engine/place/vocabulary.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/destinations.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"

namespace stillmesh {
namespace {

struct WordStatistics {
    double weight_mean = 0;     // idf
    double depth_mean = 0;      // levels down to a word
    std::uint32_t silent = 0;   // words of weight 0
    std::uint32_t nodes = 0;    // at the direct level
    std::uint32_t largest = 0;  // words below one of them, at most
};

WordStatistics measure(const Vocabulary& vocabulary) {
    WordStatistics out;
    const std::uint32_t words = vocabulary.info().words;
    for (std::uint32_t word = 0; word < words; ++word) {
        const std::uint32_t weight = vocabulary.weight(word);
        out.weight_mean += weight / 65536.0 / words;
        out.silent += weight == 0;
        // A level further down as long as that narrows the range to less than before.
        std::uint32_t level = 1;
        while (level < vocabulary.info().levels) {
            const WordRange here = vocabulary.node_of(word, level);
            if (here.end - here.begin == 1) break;
            ++level;
        }
        out.depth_mean += static_cast<double>(level) / words;
    }
    for (std::uint32_t word = 0; word < words;) {
        const WordRange node = vocabulary.node_of(word, vocabulary.info().direct_level);
        ++out.nodes;
        out.largest = std::max(out.largest, node.end - node.begin);
        word = node.end;
    }
    return out;
}

void print(const std::string& file, const Vocabulary& vocabulary, bool is_json) {
    const VocabularyInfo& info = vocabulary.info();
    const WordStatistics words = measure(vocabulary);
    const bool is_ours = info.pattern_crc == descriptor_pattern_crc();
    char pattern[16];
    std::snprintf(pattern, sizeof(pattern), "%08x", info.pattern_crc);
    if (is_json) {
        const nlohmann::ordered_json out = {{"file", file},
                                            {"name", info.name},
                                            {"version", kVocabularyVersion},
                                            {"bytes", vocabulary.bytes().size()},
                                            {"branching", info.branching},
                                            {"levels", info.levels},
                                            {"direct_level", info.direct_level},
                                            {"inner_nodes", info.blocks},
                                            {"words", info.words},
                                            {"words_of_weight_0", words.silent},
                                            {"weight_mean", words.weight_mean},
                                            {"depth_mean", words.depth_mean},
                                            {"direct_nodes", words.nodes},
                                            {"direct_node_words_max", words.largest},
                                            {"images", info.images},
                                            {"descriptors", info.descriptors},
                                            {"seed", info.seed},
                                            {"pattern", pattern},
                                            {"is_of_own_features", is_ours}};
        std::printf("%s\n", out.dump(2).c_str());
        return;
    }
    std::printf("%s: %s\n", file.c_str(), info.name);
    std::printf("  tree          %u children a node, %u levels, %u inner nodes, %u words (mean depth %.2f)\n",
                info.branching, info.levels, info.blocks, info.words, words.depth_mean);
    std::printf("  weights       mean %.2f, %u words say nothing\n", words.weight_mean, words.silent);
    std::printf("  direct index  level %u: %u nodes, at most %u words below one\n", info.direct_level, words.nodes,
                words.largest);
    std::printf("  trained from  %u images, %llu features, seed %llu\n", info.images,
                static_cast<unsigned long long>(info.descriptors), static_cast<unsigned long long>(info.seed));
    std::printf("  features      sampling pattern %s, %s\n", pattern,
                is_ours ? "that of this program" : "not that of this program: train one of your own");
    std::printf("  size          %zu bytes, format version %u\n", vocabulary.bytes().size(), kVocabularyVersion);
}

}  // namespace

int vocabulary_train_command(VocabularyTrainArguments arguments) {
    if (arguments.sources.folders.empty() && arguments.sources.scenes.empty()) {
        return refuse("vocabulary train needs images: --images DIR, or --simulate SCENE:SEED.");
    }
    const Destination out{"--out", arguments.out, DestinationKind::kFile};
    if (const std::string problem = check_destinations(std::span(&out, 1), {}); !problem.empty())
        return refuse(problem);
    // SIGTERM and Ctrl-C end it at once: nothing is written before the end, and then as a whole.
    const bool is_terminal = ::isatty(STDERR_FILENO) == 1;
    const auto say = [&](const std::string& what) {
        if (arguments.is_json) return;
        std::fprintf(stderr, "%s%s%s", is_terminal ? "\r\033[K" : "", what.c_str(), is_terminal ? "" : "\n");
    };
    TrainingSet set;
    std::uint32_t left_out = 0;
    std::string message;
    if (!collect_descriptors(arguments.sources, set, left_out, message, say)) {
        if (is_terminal) std::fprintf(stderr, "\r\033[K");
        return refuse(message);
    }
    say(std::to_string(set.images) + " images, " + std::to_string(set.descriptors.size()) +
        " features; growing the tree");
    arguments.training.pattern_crc = descriptor_pattern_crc();
    const std::vector<std::byte> bytes = train_vocabulary(set, arguments.training, message, say);
    if (is_terminal && !arguments.is_json) std::fprintf(stderr, "\r\033[K");
    if (bytes.empty()) return refuse(message + ".");
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (!write_whole_file(arguments.out, text, message)) {
        complain(message);
        return kExitFailed;
    }
    Vocabulary vocabulary;
    const char* sentence = nullptr;
    if (vocabulary.open(bytes, kVocabularyWordsMax, sentence) != Status::kOk) return kExitFailed;
    print(arguments.out, vocabulary, arguments.is_json);
    if (left_out > 0 && !arguments.is_json) {
        std::printf("  left out      %u images: neither 8-bit grey nor RGB, or not 33 to 2047 pixels wide and high\n",
                    left_out);
    }
    return kExitDone;
}

int vocabulary_info_command(const std::string& file, bool is_json) {
    std::string message;
    VocabularyFile opened;
    if (!opened.open(file, kVocabularyWordsMax, message)) return refuse(message);
    print(opened.name(), opened.vocabulary(), is_json);
    return kExitDone;
}

}  // namespace stillmesh
