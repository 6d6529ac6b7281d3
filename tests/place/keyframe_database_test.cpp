#include "engine/place/keyframe_database.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "tests/place/vocabularies.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::keyframe_database_test {
namespace {

// More keyframes than a block of the index holds postings.
constexpr Limits kLimits = [] {
    Limits limits = Limits::tiny();
    limits.keyframes_max = 40;
    limits.vocabulary_words_max = 600;
    return limits;
}();

using Bag = std::vector<WordWeight>;
using Answer = std::vector<PlaceCandidate>;

class Database : public testing::Test {
protected:
    Database() {
        const char* sentence = "";
        STILLMESH_CHECK(vocabulary_.open(bytes_, kLimits.vocabulary_words_max, sentence) == Status::kOk);
    }
    // A frame's words, some of them common to many frames.
    void look() {
        std::vector<std::uint16_t> words;
        const std::uint32_t count = random_.below(kLimits.features_max + 1);
        for (std::uint32_t i = 0; i < count; ++i) {
            const std::uint32_t range = random_.below(2) == 0 ? 20 : vocabulary_.info().words;
            words.push_back(static_cast<std::uint16_t>(random_.below(range)));
        }
        std::vector<std::uint8_t> flags(words.size());
        for (std::uint8_t& flag : flags) flag = random_.below(4) != 0;
        words_->assign(words);
        words_->weigh(vocabulary_, flags);
    }
    void add(std::uint32_t slot) {
        look();
        database_->add(slot, *words_);
        model_[slot] = Bag(words_->bag().begin(), words_->bag().end());
        indices_[slot] = {words_->by_word().begin(), words_->by_word().end()};
    }
    void remove(std::uint32_t slot) {
        database_->remove(slot);
        model_.erase(slot);
        indices_.erase(slot);
    }
    // What is in is what the model has, and the chains of the words name that, each once, and nothing else.
    void expect_sound() {
        std::map<std::uint32_t, std::map<std::uint32_t, std::uint32_t>> expected;  // by word: weight by slot
        for (const auto& [slot, bag] : model_) {
            ASSERT_TRUE(database_->has(slot));
            ASSERT_EQ(database_->bag(slot).size(), bag.size());
            for (const WordWeight& entry : bag) expected[entry.word][slot] = entry.weight;
        }
        ASSERT_EQ(database_->size(), model_.size());
        for (std::uint32_t word = 0; word < vocabulary_.info().words; ++word) {
            std::map<std::uint32_t, std::uint32_t> found;
            const std::uint32_t count = database_->visit_keyframes(
                word, [&](std::uint32_t slot, std::uint32_t weight) { found[slot] = weight; });
            ASSERT_EQ(count, found.size()) << "a keyframe twice in a chain";
            ASSERT_EQ(found, expected[word]);
        }
    }
    // Every keyframe compared with the question.
    [[nodiscard]] Answer by_force(const Bag& question) const {
        Answer out;
        for (const auto& [slot, bag] : model_) {
            PlaceCandidate candidate{slot, bag_score(question, bag), 0};
            for (const WordWeight& a : question) {
                for (const WordWeight& b : bag) candidate.common_words += a.word == b.word;
            }
            if (candidate.score > 0) out.push_back(candidate);
        }
        std::sort(out.begin(), out.end(), [](const PlaceCandidate& a, const PlaceCandidate& b) {
            return a.score != b.score ? a.score > b.score : a.keyframe_slot < b.keyframe_slot;
        });
        return out;
    }
    static void expect_same(std::span<const PlaceCandidate> found, const Answer& expected) {
        ASSERT_EQ(found.size(), expected.size());
        for (std::size_t i = 0; i < expected.size(); ++i) {
            ASSERT_EQ(found[i].keyframe_slot, expected[i].keyframe_slot);
            ASSERT_EQ(found[i].score, expected[i].score);
            ASSERT_EQ(found[i].common_words, expected[i].common_words);
        }
    }

    Random random_{5};
    std::vector<std::byte> bytes_ = test::vocabulary_bytes({8, 3, 10, 4});
    Vocabulary vocabulary_;
    test::InMemory<FrameWords> words_{kLimits.features_max};
    test::InMemory<KeyframeDatabase> database_{kLimits};
    test::InMemory<PlaceQuery> query_{kLimits};
    std::map<std::uint32_t, Bag> model_;
    std::map<std::uint32_t, std::vector<WordOfFeature>> indices_;
};

// Promise: memory is what was planned, and room for every keyframe and feature of the limits is always there.
TEST_F(Database, NeverFull) {
    EXPECT_EQ(database_.used_bytes(), database_.planned_bytes());
    EXPECT_EQ(query_.used_bytes(), query_.planned_bytes());
    std::vector<std::uint16_t> words;
    for (std::uint32_t i = 0; i < kLimits.features_max; ++i) words.push_back(static_cast<std::uint16_t>(i));
    words_->assign(words);
    words_->weigh(vocabulary_, std::vector<std::uint8_t>(words.size(), 1));
    // A block that got lost in any of the rounds would be missing in the end.
    for (int round = 0; round < 1000; ++round) {
        for (std::uint32_t slot = 0; slot < kLimits.keyframes_max; ++slot) database_->add(slot, *words_);
        ASSERT_EQ(database_->size(), kLimits.keyframes_max);
        for (std::uint32_t slot = 0; slot < kLimits.keyframes_max; ++slot) database_->remove(slot);
        ASSERT_EQ(database_->size(), 0U);
    }
    expect_sound();
}

// Promise: the pool has exactly the blocks that the limits can ask for, and every one of them is found: a keyframe
// whose features have a word each takes them all, again and again.
TEST_F(Database, EveryBlockIsThere) {
    Limits limits = kLimits;
    limits.keyframes_max = 1;
    test::InMemory<KeyframeDatabase> database{limits};
    std::vector<std::uint16_t> words;
    for (std::uint32_t i = 0; i < limits.features_max; ++i) words.push_back(static_cast<std::uint16_t>(i));
    words_->assign(words);
    words_->weigh(vocabulary_, std::vector<std::uint8_t>(words.size(), 1));
    ASSERT_EQ(words_->bag().size(), limits.features_max);
    for (int round = 0; round < 3; ++round) {
        database->add(0, *words_);
        for (std::uint32_t word = 0; word < limits.features_max; ++word) {
            ASSERT_EQ(database->visit_keyframes(word, [](std::uint32_t, std::uint32_t) {}), 1U) << word;
        }
        database->remove(0);
        for (std::uint32_t word = 0; word < limits.features_max; ++word) {
            ASSERT_EQ(database->visit_keyframes(word, [](std::uint32_t, std::uint32_t) {}), 0U) << word;
        }
    }
}

// Promise: whatever came and went, an answer is that of comparing with every keyframe, exactly.
TEST_F(Database, AnswersAsByForce) {
    for (int round = 0; round < 1000; ++round) {
        const std::uint32_t slot = random_.below(kLimits.keyframes_max);
        if (random_.below(2) == 0) {
            remove(slot);  // also when it is not there
        } else if (!database_->has(slot)) {
            add(slot);
        }
        expect_sound();
        look();
        const Bag question(words_->bag().begin(), words_->bag().end());
        query_->begin(*database_, question);
        WorkBudget budget(1'000'000);
        ASSERT_EQ(query_->step(*database_, budget), Progress::kDone);
        expect_same(query_->candidates(), by_force(question));
        for (const auto& [a, bag] : model_) {
            ASSERT_TRUE(std::ranges::equal(database_->direct_index(a), indices_[a]));
            for (const auto& [b, other] : model_) ASSERT_EQ(database_->score(a, b), bag_score(bag, other));
        }
    }
}

// Promise: however a question is cut into slices, the answer and the work are the same, and a slice overdraws by no
// more than it says.
TEST_F(Database, AnySlicesGiveTheSame) {
    for (std::uint32_t slot = 0; slot < kLimits.keyframes_max; ++slot) add(slot);
    for (int round = 0; round < 200; ++round) {
        look();
        const Bag question(words_->bag().begin(), words_->bag().end());
        const Answer expected = by_force(question);
        query_->begin(*database_, question);
        WorkBudget whole(1'000'000);
        ASSERT_EQ(query_->step(*database_, whole), Progress::kDone);
        query_->begin(*database_, question);
        std::uint64_t spent = 0;
        for (;;) {
            EXPECT_TRUE(query_->candidates().empty());
            const std::uint32_t units = random_.below(4);
            WorkBudget slice(units);
            const Progress progress = query_->step(*database_, slice);
            spent += slice.units_spent();
            const std::uint32_t ceiling = kLimits.keyframes_max / PlaceQuery::kPostingsPerUnit + 1;
            ASSERT_LE(slice.units_spent(), units + ceiling);
            if (progress == Progress::kDone) break;
            ASSERT_EQ(progress, Progress::kWorking);
            ASSERT_TRUE(query_->is_running());
        }
        ASSERT_EQ(spent, whole.units_spent());
        expect_same(query_->candidates(), expected);
        WorkBudget more(100);
        ASSERT_EQ(query_->step(*database_, more), Progress::kIdle);
        ASSERT_EQ(more.units_spent(), 0U);
    }
}

// Promise: a keyframe that goes or comes while a question is being answered is not in the answer, nor one that comes
// back in the same slot; the others are, as they were.
TEST_F(Database, LeavesOutWhatChangedMeanwhile) {
    for (int round = 0; round < 300; ++round) {
        for (std::uint32_t slot = 0; slot < kLimits.keyframes_max; ++slot) {
            if (!database_->has(slot) && random_.below(3) != 0) add(slot);
        }
        look();
        const Bag question(words_->bag().begin(), words_->bag().end());
        query_->begin(*database_, question);
        Answer expected = by_force(question);
        for (;;) {
            WorkBudget slice(random_.below(3));
            if (query_->step(*database_, slice) == Progress::kDone) break;
            if (random_.below(4) != 0) continue;
            const std::uint32_t slot = random_.below(kLimits.keyframes_max);
            std::erase_if(expected, [&](const PlaceCandidate& candidate) { return candidate.keyframe_slot == slot; });
            remove(slot);
            if (random_.below(2) == 0) add(slot);
        }
        expect_same(query_->candidates(), expected);
    }
}

// Promise: after reset nothing is known.
TEST_F(Database, ResetForgets) {
    for (std::uint32_t slot = 0; slot < kLimits.keyframes_max; ++slot) add(slot);
    const Bag question = model_[0];
    query_->begin(*database_, question);
    database_->reset();
    model_.clear();
    query_->reset();
    WorkBudget budget(1000);
    EXPECT_EQ(query_->step(*database_, budget), Progress::kIdle);
    EXPECT_EQ(database_->size(), 0U);
    expect_sound();
    query_->begin(*database_, question);
    EXPECT_EQ(query_->step(*database_, budget), Progress::kDone);
    EXPECT_TRUE(query_->candidates().empty());
}

}  // namespace
}  // namespace stillmesh::keyframe_database_test
