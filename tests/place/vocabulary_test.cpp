#include "engine/place/vocabulary.hpp"

#include <gtest/gtest.h>

#include "tests/place/vocabularies.hpp"

namespace stillmesh {
namespace {

// Promise: a tree written by the page is read as it is.
TEST(Vocabulary, OpensWhatThePageSays) {
    const test::RandomTree shape;
    const std::vector<std::byte> bytes = test::vocabulary_bytes(shape);
    Vocabulary vocabulary;
    const char* sentence = "";
    ASSERT_EQ(vocabulary.open(bytes, kVocabularyWordsMax, sentence), Status::kOk) << sentence;
    EXPECT_EQ(sentence, nullptr);
}

}  // namespace
}  // namespace stillmesh
