#include "platform/vocabulary/trainer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "engine/base/random.hpp"
#include "engine/features/hamming.hpp"
#include "engine/place/vocabulary.hpp"

namespace stillmesh::trainer_test {
namespace {

Descriptor random_descriptor(Random& random) {
    Descriptor out;
    for (std::uint64_t& word : out.words) word = random.next();
    return out;
}
Descriptor disturbed(const Descriptor& descriptor, std::uint32_t bits, Random& random) {
    Descriptor out = descriptor;
    for (std::uint32_t i = 0; i < bits; ++i) {
        const std::uint32_t bit = random.below(256);
        out.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
    }
    return out;
}

// Descriptors around so many centres; image i of 20 has those of all centres but i % 4.
TrainingSet clusters(std::uint32_t centres, std::uint32_t spread_bits, std::uint64_t seed) {
    Random random(seed);
    std::vector<Descriptor> middle;
    for (std::uint32_t i = 0; i < centres; ++i) middle.push_back(random_descriptor(random));
    TrainingSet set;
    set.images = 20;
    for (std::uint32_t image = 0; image < set.images; ++image) {
        for (std::uint32_t i = 0; i < centres; ++i) {
            if (i == image % 4) continue;
            for (int n = 0; n < 3; ++n) {
                set.descriptors.push_back(disturbed(middle[i], spread_bits, random));
                set.image_of.push_back(image);
            }
        }
    }
    return set;
}

Vocabulary opened(const std::vector<std::byte>& bytes) {
    Vocabulary vocabulary;
    const char* sentence = "";
    EXPECT_EQ(vocabulary.open(bytes, kVocabularyWordsMax, sentence), Status::kOk) << sentence;
    return vocabulary;
}

// Promise: the same images and seed give the same bytes; another seed may give others.
TEST(Trainer, IsReproducible) {
    const TrainingSet set = clusters(60, 25, 1);
    TrainingOptions options;
    options.branching = 5;
    options.levels = 3;
    options.name = "again";
    std::string message;
    const std::vector<std::byte> first = train_vocabulary(set, options, message);
    ASSERT_FALSE(first.empty()) << message;
    EXPECT_EQ(train_vocabulary(set, options, message), first);
    options.seed = 2;
    EXPECT_NE(train_vocabulary(set, options, message), first);
    const Vocabulary vocabulary = opened(first);
    EXPECT_STREQ(vocabulary.info().name, "again");
    EXPECT_EQ(vocabulary.info().images, 20U);
    EXPECT_EQ(vocabulary.info().descriptors, set.descriptors.size());
    EXPECT_LE(vocabulary.info().words, 125U);
}

// Promise: descriptors that belong together get one word of their own, whose median is their middle, and which weighs
// ln(images / images that have it).
TEST(Trainer, FindsClustersAndWeighsThem) {
    const TrainingSet set = clusters(8, 6, 3);
    TrainingOptions options;
    options.branching = 8;
    options.levels = 1;
    options.direct_level = 1;
    // Seeds may put two medians into one cluster; the best of some does not.
    std::string message;
    std::vector<std::byte> best;
    std::set<std::uint16_t> words;
    for (options.seed = 1; options.seed < 20 && words.size() < 8; ++options.seed) {
        best = train_vocabulary(set, options, message);
        const Vocabulary vocabulary = opened(best);
        words.clear();
        std::map<std::uint16_t, std::size_t> sizes;
        for (const Descriptor& descriptor : set.descriptors) ++sizes[vocabulary.word_of(descriptor)];
        for (const auto& [word, size] : sizes) {
            if (size == 45 || size == 60) words.insert(word);
        }
    }
    ASSERT_EQ(words.size(), 8U);
    const Vocabulary vocabulary = opened(best);
    std::map<std::uint16_t, std::set<std::uint32_t>> images;
    for (std::size_t i = 0; i < set.descriptors.size(); ++i) {
        const std::uint16_t word = vocabulary.word_of(set.descriptors[i]);
        images[word].insert(set.image_of[i]);
        EXPECT_LE(hamming_distance(set.descriptors[i], vocabulary.median(0, word)), 8U);
    }
    std::uint32_t silent = 0;
    for (const auto& [word, seen_in] : images) {
        const double expected = std::log(20.0 / static_cast<double>(seen_in.size()));
        EXPECT_NEAR(vocabulary.weight(word) / 65536.0, expected, 1e-5);
        silent += vocabulary.weight(word) == 0;
    }
    EXPECT_EQ(silent, 4U);  // those in every image
}

// Promise: however alike the descriptors are, the tree is one that the reader takes; what cannot be grown is refused
// with a sentence.
TEST(Trainer, RefusesOrGrows) {
    Random random(5);
    TrainingSet set;
    std::string message;
    TrainingOptions options;
    EXPECT_TRUE(train_vocabulary(set, options, message).empty());
    EXPECT_GT(message.size(), 20U);
    const Descriptor one = random_descriptor(random);
    for (int i = 0; i < 500; ++i) {
        set.descriptors.push_back(i < 490 ? one : random_descriptor(random));
        set.image_of.push_back(static_cast<std::uint32_t>(i) / 50);
    }
    set.images = 10;
    for (const std::uint32_t branching : {2U, 10U, 32U}) {
        options.branching = branching;
        const std::vector<std::byte> bytes = train_vocabulary(set, options, message);
        ASSERT_FALSE(bytes.empty()) << message;
        EXPECT_LE(opened(bytes).info().words, 11U);
    }
    for (auto& [field, value] :
         std::vector<std::pair<std::uint32_t TrainingOptions::*, std::uint32_t>>{{&TrainingOptions::branching, 1},
                                                                                 {&TrainingOptions::branching, 33},
                                                                                 {&TrainingOptions::levels, 0},
                                                                                 {&TrainingOptions::levels, 9},
                                                                                 {&TrainingOptions::direct_level, 0},
                                                                                 {&TrainingOptions::direct_level, 5}}) {
        TrainingOptions wrong;
        wrong.*field = value;
        message.clear();
        EXPECT_TRUE(train_vocabulary(set, wrong, message).empty());
        EXPECT_GT(message.size(), 20U);
    }
    TrainingOptions wrong;
    wrong.name = std::string(48, 'x');
    EXPECT_TRUE(train_vocabulary(set, wrong, message).empty());
}

}  // namespace
}  // namespace stillmesh::trainer_test
