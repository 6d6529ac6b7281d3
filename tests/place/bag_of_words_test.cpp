#include "engine/place/bag_of_words.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "tests/place/vocabularies.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::bag_of_words_test {
namespace {

constexpr std::uint32_t kFeaturesMax = 400;

class BagOfWords : public testing::Test {
protected:
    BagOfWords() {
        const char* sentence = "";
        STILLMESH_CHECK(vocabulary_.open(bytes_, kVocabularyWordsMax, sentence) == Status::kOk);
    }
    std::vector<Descriptor> descriptors(std::uint32_t count) {
        std::vector<Descriptor> out;
        for (std::uint32_t i = 0; i < count; ++i) {
            const bool is_again = i > 0 && random_.below(3) == 0;  // the same corner on another level
            out.push_back(is_again ? test::disturbed(out[random_.below(i)], 3, random_)
                                   : test::random_descriptor(random_));
        }
        return out;
    }
    std::vector<std::uint8_t> eligible(std::size_t count, std::uint32_t percent) {
        std::vector<std::uint8_t> out(count);
        for (std::uint8_t& flag : out) flag = random_.below(100) < percent;
        return out;
    }

    Random random_{11};
    std::vector<std::byte> bytes_ = test::vocabulary_bytes({6, 3, 20, 4});
    Vocabulary vocabulary_;
    test::InMemory<FrameWords> words_{kFeaturesMax};
};

// Promise: the direct index is all features by (word, feature).
TEST_F(BagOfWords, DirectIndexIsSorted) {
    EXPECT_EQ(words_.used_bytes(), words_.planned_bytes());
    for (const std::uint32_t count : {0U, 1U, 2U, 77U, kFeaturesMax}) {
        const std::vector<Descriptor> frame = descriptors(count);
        std::vector<std::pair<std::uint16_t, std::uint16_t>> expected;
        std::vector<std::uint16_t> by_feature;
        for (std::size_t i = 0; i < frame.size(); ++i) {
            by_feature.push_back(vocabulary_.word_of(frame[i]));
            expected.emplace_back(by_feature.back(), static_cast<std::uint16_t>(i));
        }
        std::sort(expected.begin(), expected.end());
        for (int round = 0; round < 2; ++round) {
            if (round == 0) words_->find(vocabulary_, frame);
            if (round == 1) words_->assign(by_feature);
            ASSERT_EQ(words_->by_word().size(), expected.size());
            for (std::size_t i = 0; i < expected.size(); ++i) {
                ASSERT_EQ(words_->by_word()[i].word, expected[i].first);
                ASSERT_EQ(words_->by_word()[i].feature, expected[i].second);
            }
            EXPECT_TRUE(words_->bag().empty());
        }
    }
    // Both bytes of a word count.
    const std::vector<std::uint16_t> wide = {0x0100, 0x00ff, 0xffff, 0x0000, 0x0100, 0xff00};
    words_->assign(wide);
    std::vector<std::uint16_t> sorted;
    for (const WordOfFeature& entry : words_->by_word()) sorted.push_back(entry.word);
    EXPECT_EQ(sorted, (std::vector<std::uint16_t>{0, 0xff, 0x100, 0x100, 0xff00, 0xffff}));
}

// Promise: a bag has the words of the eligible features and no others; each weighs its count times its rarity, as a
// share.
TEST_F(BagOfWords, WeighsEligibleFeaturesOnly) {
    for (const std::uint32_t percent : {0U, 10U, 60U, 100U}) {
        const std::vector<Descriptor> frame = descriptors(kFeaturesMax);
        const std::vector<std::uint8_t> flags = eligible(frame.size(), percent);
        words_->find(vocabulary_, frame);
        words_->weigh(vocabulary_, flags);
        std::map<std::uint16_t, std::uint64_t> model;
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < frame.size(); ++i) {
            const std::uint16_t word = vocabulary_.word_of(frame[i]);
            if (flags[i] == 0 || vocabulary_.weight(word) == 0) continue;
            model[word] += vocabulary_.weight(word);
            sum += vocabulary_.weight(word);
        }
        ASSERT_EQ(words_->bag().size(), model.size());
        std::uint64_t total = 0;
        auto expected = model.begin();
        for (const WordWeight& entry : words_->bag()) {
            ASSERT_EQ(entry.word, expected->first);
            ASSERT_EQ(entry.weight, expected->second * kBagWeightOne / sum);
            total += entry.weight;
            ++expected;
        }
        if (percent == 0) {
            EXPECT_EQ(total, 0U);
        } else {
            EXPECT_LE(total, kBagWeightOne);
            EXPECT_GT(total + model.size(), kBagWeightOne);
        }
    }
}

// Promise: words that say nothing are not in a bag.
TEST_F(BagOfWords, LeavesOutWordsWithoutWeight) {
    test::RandomTree shape{4, 2, 0, 4};
    const test::Node root = shape.grow();
    test::TreeBytes tree(root, shape.branching);
    const std::size_t weights = tree.bytes.size() - 4 * tree.words.size();
    for (std::size_t i = 0; i < 4; ++i) tree.bytes[weights + i] = std::byte{0};  // of word 0
    ASSERT_EQ(write_vocabulary_header(test::info_of(shape, tree), tree.bytes), Status::kOk);
    Vocabulary vocabulary;
    const char* sentence = "";
    ASSERT_EQ(vocabulary.open(tree.bytes, kVocabularyWordsMax, sentence), Status::kOk);
    const std::vector<std::uint16_t> frame = {0, 1, 0, 2};
    words_->assign(frame);
    words_->weigh(vocabulary, std::vector<std::uint8_t>(4, 1));
    ASSERT_EQ(words_->bag().size(), 2U);
    EXPECT_EQ(words_->bag()[0].word, 1);
    words_->assign(std::vector<std::uint16_t>{0, 0});
    words_->weigh(vocabulary, std::vector<std::uint8_t>(2, 1));
    EXPECT_TRUE(words_->bag().empty());
}

// Promise: a score is 1 - |a - b| / 2 of the two vectors, up to rounding; the same both ways; 1 with itself, 0 with a
// stranger.
TEST_F(BagOfWords, ScoreIsL1) {
    test::InMemory<FrameWords> other{kFeaturesMax};
    for (int round = 0; round < 30; ++round) {
        const std::vector<Descriptor> a = descriptors(kFeaturesMax);
        std::vector<Descriptor> b = descriptors(kFeaturesMax);
        for (int i = 0; i < 13 * round; ++i)
            b[static_cast<std::size_t>(i)] = test::disturbed(a[static_cast<std::size_t>(i)], 10, random_);
        words_->find(vocabulary_, a);
        other->find(vocabulary_, b);
        words_->weigh(vocabulary_, eligible(a.size(), 80));
        other->weigh(vocabulary_, eligible(b.size(), 80));
        std::map<std::uint16_t, std::int64_t> difference;
        for (const WordWeight& entry : words_->bag()) difference[entry.word] += entry.weight;
        for (const WordWeight& entry : other->bag()) difference[entry.word] -= entry.weight;
        std::int64_t norm = 0;
        for (const auto& [word, value] : difference) norm += value < 0 ? -value : value;
        const std::uint32_t score = bag_score(words_->bag(), other->bag());
        EXPECT_EQ(score, bag_score(other->bag(), words_->bag()));
        EXPECT_NEAR(score, static_cast<double>(kBagWeightOne) - static_cast<double>(norm) / 2, kFeaturesMax);
        EXPECT_GT(bag_score(words_->bag(), words_->bag()) + kFeaturesMax, kBagWeightOne);
    }
    const WordWeight left[] = {{5, 1}, {5, 3}};
    const WordWeight right[] = {{5, 2}, {5, 4}};
    EXPECT_EQ(bag_score(left, right), 0U);
    EXPECT_EQ(bag_score(left, {}), 0U);
}

// Promise: at every level, the common nodes of two direct indices are those that both have features under, each once,
// with all of their features.
TEST_F(BagOfWords, CommonNodesAreComplete) {
    test::InMemory<FrameWords> other{kFeaturesMax};
    for (const std::uint32_t count : {0U, 3U, 60U, kFeaturesMax}) {
        const std::vector<Descriptor> a = descriptors(count);
        const std::vector<Descriptor> b = descriptors(kFeaturesMax / 4);
        words_->find(vocabulary_, a);
        other->find(vocabulary_, b);
        for (std::uint32_t level = 1; level <= vocabulary_.info().levels; ++level) {
            std::vector<std::pair<std::uint16_t, std::uint16_t>> expected;
            for (std::size_t i = 0; i < a.size(); ++i) {
                for (std::size_t j = 0; j < b.size(); ++j) {
                    const WordRange node = vocabulary_.node_of(vocabulary_.word_of(a[i]), level);
                    const std::uint32_t word = vocabulary_.word_of(b[j]);
                    if (word >= node.begin && word < node.end) {
                        expected.emplace_back(static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j));
                    }
                }
            }
            std::vector<std::pair<std::uint16_t, std::uint16_t>> found;
            visit_common_nodes(vocabulary_, level, words_->by_word(), other->by_word(),
                               [&](std::span<const WordOfFeature> of_a, std::span<const WordOfFeature> of_b) {
                                   for (const WordOfFeature& i : of_a) {
                                       for (const WordOfFeature& j : of_b) found.emplace_back(i.feature, j.feature);
                                   }
                               });
            std::sort(found.begin(), found.end());
            EXPECT_EQ(found, expected);
        }
    }
}

}  // namespace
}  // namespace stillmesh::bag_of_words_test
