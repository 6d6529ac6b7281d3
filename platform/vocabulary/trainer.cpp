#include "platform/vocabulary/trainer.hpp"

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include "engine/base/numbers.hpp"
#include "engine/base/random.hpp"
#include "engine/features/hamming.hpp"
#include "engine/place/vocabulary.hpp"

namespace stillmesh {
namespace {

struct Node {
    Descriptor median;
    std::vector<std::uint32_t> members;  // indices of descriptors, ascending
    std::vector<Node> children;
};

// The nearest median, ties to the first.
std::size_t nearest(const Descriptor& descriptor, const std::vector<Descriptor>& medians) {
    std::size_t best = 0;
    std::uint32_t best_distance = 257;
    for (std::size_t i = 0; i < medians.size(); ++i) {
        const std::uint32_t distance = hamming_distance(descriptor, medians[i]);
        if (distance < best_distance) {
            best_distance = distance;
            best = i;
        }
    }
    return best;
}

// The descriptor whose distances to the members sum up to the least: each bit as most of them have it.
class Majority {
public:
    void add(const Descriptor& descriptor) {
        for (std::size_t bit = 0; bit < 256; ++bit) counts_[bit] += descriptor.words[bit / 64] >> (bit % 64) & 1U;
        ++members_;
    }
    [[nodiscard]] Descriptor median() const {
        Descriptor out;
        for (std::size_t bit = 0; bit < 256; ++bit) {
            if (2 * counts_[bit] > members_) out.words[bit / 64] |= std::uint64_t{1} << (bit % 64);
        }
        return out;
    }
    [[nodiscard]] std::uint64_t members() const { return members_; }

private:
    std::uint64_t counts_[256] = {};
    std::uint64_t members_ = 0;
};

class Trainer {
public:
    Trainer(const TrainingSet& set, const TrainingOptions& options)
        : set_(set), options_(options), random_(options.seed) {}

    void split(Node& node, std::uint32_t level) {
        std::vector<Descriptor> medians = first_medians(node.members);
        std::vector<std::size_t> cluster(node.members.size(), medians.size());
        for (std::uint32_t round = 0; round < options_.rounds_max; ++round) {
            bool has_changed = false;
            std::vector<Majority> majorities(medians.size());
            for (std::size_t i = 0; i < node.members.size(); ++i) {
                const Descriptor& descriptor = set_.descriptors[node.members[i]];
                const std::size_t to = nearest(descriptor, medians);
                has_changed |= to != cluster[i];
                cluster[i] = to;
                majorities[to].add(descriptor);
            }
            if (!has_changed) break;
            // A median that lost all its members stays where it is and may find others.
            for (std::size_t c = 0; c < medians.size(); ++c) {
                if (majorities[c].members() > 0) medians[c] = majorities[c].median();
            }
        }
        std::vector<Node> children(medians.size());
        for (std::size_t c = 0; c < medians.size(); ++c) children[c].median = medians[c];
        for (const std::uint32_t member : node.members) {
            children[nearest(set_.descriptors[member], medians)].members.push_back(member);
        }
        for (Node& child : children) {
            if (!child.members.empty()) node.children.push_back(std::move(child));
        }
        node.members = {};
        for (Node& child : node.children) {
            if (level < options_.levels && is_worth_splitting(child)) split(child, level + 1);
        }
    }

private:
    [[nodiscard]] bool is_worth_splitting(const Node& node) const {
        if (node.members.size() <= options_.branching) return false;
        return std::any_of(node.members.begin(), node.members.end(), [&](std::uint32_t member) {
            return set_.descriptors[member] != set_.descriptors[node.members.front()];
        });
    }

    // The first anywhere, each further one with a probability that grows with its squared distance from those before.
    std::vector<Descriptor> first_medians(const std::vector<std::uint32_t>& members) {
        std::vector<Descriptor> medians;
        medians.push_back(set_.descriptors[members[random_.below(static_cast<std::uint32_t>(members.size()))]]);
        std::vector<std::uint64_t> square(members.size(), std::numeric_limits<std::uint64_t>::max());
        while (medians.size() < options_.branching) {
            std::uint64_t sum = 0;
            for (std::size_t i = 0; i < members.size(); ++i) {
                const std::uint64_t d = hamming_distance(set_.descriptors[members[i]], medians.back());
                square[i] = std::min(square[i], d * d);
                sum += square[i];
            }
            if (sum == 0) break;  // as many medians as there are different descriptors
            std::uint64_t ticket = random_.next() % sum;
            std::size_t chosen = 0;
            while (ticket >= square[chosen]) ticket -= square[chosen++];
            medians.push_back(set_.descriptors[members[chosen]]);
        }
        return medians;
    }

    const TrainingSet& set_;
    const TrainingOptions& options_;
    Random random_;
};

// Blocks and links of the tree; weights are zero.
class Writer {
public:
    explicit Writer(std::uint32_t branching) : branching_(branching) { bytes.resize(kVocabularyHeaderBytes); }

    std::vector<std::byte> bytes;
    std::uint32_t blocks = 0;
    std::uint32_t words = 0;

    void add(const Node& node) {
        const std::size_t at = bytes.size();
        const std::size_t k = branching_;
        bytes.resize(at + Vocabulary::block_bytes(branching_));
        ++blocks;
        put(at + 36 * k, node.children.size(), 2);
        for (std::size_t i = 0; i < node.children.size(); ++i) {
            const Node& child = node.children[i];
            for (std::size_t w = 0; w < 4; ++w) put(at + 32 * i + 8 * w, child.median.words[w], 8);
            put(at + 32 * k + 2 * i, words, 2);
            if (child.children.empty()) {
                ++words;
            } else {
                put(at + 34 * k + 2 * i, blocks, 2);
                add(child);
            }
        }
    }
    void put(std::size_t at, std::uint64_t value, std::size_t size) {
        for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
    }

private:
    std::uint32_t branching_;
};

std::pair<std::uint64_t, std::uint64_t> count(const Node& node) {  // blocks, words
    if (node.children.empty()) return {0, 1};
    std::pair<std::uint64_t, std::uint64_t> sum{1, 0};
    for (const Node& child : node.children) {
        const auto [blocks, words] = count(child);
        sum.first += blocks;
        sum.second += words;
    }
    return sum;
}

// ln x for x >= 1 without libm, whose last digit differs between machines: halved into [1, 2), then 2
// artanh((x-1)/(x+1)).
double natural_logarithm(double x) {
    double halvings = 0;
    while (x >= 2) {
        x /= 2;
        ++halvings;
    }
    const double t = (x - 1) / (x + 1);
    double sum = 0;
    double power = t;
    for (int i = 1; i < 40; i += 2) {
        sum += power / i;
        power *= t * t;
    }
    return halvings * 0.693147180559945309417 + 2 * sum;
}

}  // namespace

std::vector<std::byte> train_vocabulary(const TrainingSet& set, const TrainingOptions& options, std::string& message,
                                        const std::function<void(const std::string&)>& say) {
    if (options.branching < 2 || options.branching > kVocabularyBranchingMax || options.levels < 1 ||
        options.levels > kVocabularyLevelsMax || options.direct_level < 1 || options.direct_level > options.levels) {
        message = "the tree must have 2 to 32 children a node, 1 to 8 levels, and its direct index at one of them";
        return {};
    }
    const bool is_printable = std::all_of(options.name.begin(), options.name.end(),
                                          [](char letter) { return letter >= ' ' && letter <= '~'; });
    if (options.name.size() >= kVocabularyNameBytes || !is_printable) {
        message = "the name must be at most 47 printable ASCII letters";
        return {};
    }
    if (set.descriptors.empty()) {
        message = "there are no features in the images";
        return {};
    }
    Node root;
    root.members.resize(set.descriptors.size());
    for (std::size_t i = 0; i < root.members.size(); ++i) root.members[i] = static_cast<std::uint32_t>(i);
    Trainer(set, options).split(root, 1);
    const auto [blocks, words] = count(root);
    if (words > kVocabularyWordsMax) {
        message = "the tree has " + std::to_string(words) + " words, the format holds " +
                  std::to_string(kVocabularyWordsMax) + "; fewer children or levels";
        return {};
    }
    if (say) say(std::to_string(blocks) + " inner nodes, " + std::to_string(words) + " words; weighing");
    Writer writer(options.branching);
    writer.add(root);
    const std::size_t weights_at = writer.bytes.size();
    writer.bytes.resize(weights_at + std::size_t{4} * static_cast<std::size_t>(words));

    VocabularyInfo info;
    info.branching = options.branching;
    info.levels = options.levels;
    info.direct_level = options.direct_level;
    info.blocks = writer.blocks;
    info.words = writer.words;
    info.images = set.images;
    info.descriptors = set.descriptors.size();
    info.seed = options.seed;
    info.pattern_crc = options.pattern_crc;
    std::copy(options.name.begin(), options.name.end(), info.name);
    Vocabulary vocabulary;
    const char* sentence = nullptr;
    if (write_vocabulary_header(info, writer.bytes) != Status::kOk ||
        vocabulary.open(writer.bytes, kVocabularyWordsMax, sentence) != Status::kOk) {
        message = std::string("what was written ") + (sentence != nullptr ? sentence : "has the wrong size");
        return {};
    }
    // idf, by the way that every descriptor will take through the finished tree.
    std::vector<std::uint32_t> images_with(static_cast<std::size_t>(words), 0);
    std::vector<std::uint32_t> last_image(static_cast<std::size_t>(words), std::numeric_limits<std::uint32_t>::max());
    for (std::size_t i = 0; i < set.descriptors.size(); ++i) {
        const std::uint32_t word = vocabulary.word_of(set.descriptors[i]);
        if (last_image[word] == set.image_of[i]) continue;
        last_image[word] = set.image_of[i];
        ++images_with[word];
    }
    for (std::size_t word = 0; word < words; ++word) {
        const double rarity = static_cast<double>(set.images) / std::max(1U, images_with[word]);
        const std::int32_t weight = round_clamped(natural_logarithm(rarity) * 65536.0, 0, kVocabularyWeightMax);
        writer.put(weights_at + 4 * word, static_cast<std::uint32_t>(weight), 4);
    }
    if (write_vocabulary_header(info, writer.bytes) != Status::kOk) return {};
    return std::move(writer.bytes);
}

}  // namespace stillmesh
