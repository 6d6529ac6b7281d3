#include "platform/vocabulary/vocabulary_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "engine/features/own_extractor.hpp"
#include "engine/limits.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::vocabulary_file_test {
namespace {

namespace fs = std::filesystem;

class VocabularyFileTest : public testing::Test {
protected:
    std::string write(const std::string& name, const std::string& text) {
        const fs::path file = folder_ / name;
        std::ofstream(file, std::ios::binary) << text;
        return file.string();
    }
    static std::string default_text() {
        const std::span<const std::byte> bytes = default_vocabulary();
        return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    }

    const test::TemporaryFolder temporary_;
    const fs::path folder_ = temporary_.path();
    VocabularyFile file_;
    std::string message_;
};

// Promise: the vocabulary that comes with the program is one, is small, fits Limits::room(), and speaks the language of
// the program's own features.
TEST_F(VocabularyFileTest, TheDefaultIsOurs) {
    ASSERT_TRUE(file_.open("", Limits::room().vocabulary_words_max, message_)) << message_;
    const VocabularyInfo& info = file_.vocabulary().info();
    EXPECT_LE(file_.bytes().size(), std::size_t{512} << 10U);
    EXPECT_EQ(info.branching, 10U);
    EXPECT_EQ(info.levels, 4U);
    EXPECT_GT(info.words, 9000U);
    EXPECT_EQ(info.pattern_crc, descriptor_pattern_crc());
    EXPECT_TRUE(file_.open("", Limits::pocket().vocabulary_words_max, message_));
}

// Promise: a file is used as it is; what is no vocabulary is refused with a sentence that names it, and nothing is
// left.
TEST_F(VocabularyFileTest, OpensOrSaysWhy) {
    const std::string good = write("good.voc", default_text());
    ASSERT_TRUE(file_.open(good, 10000, message_)) << message_;
    EXPECT_EQ(file_.bytes().size(), default_vocabulary().size());
    EXPECT_EQ(file_.name(), good);
    std::string flipped = default_text();
    flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 4);
    const std::string wrong[] = {(folder_ / "missing").string(),
                                 folder_.string(),
                                 write("empty", ""),
                                 write("short", default_text().substr(0, 100)),
                                 write("cut", default_text().substr(0, 200'000)),
                                 write("long", default_text() + "x"),
                                 write("flipped", flipped),
                                 write("text", std::string(5000, 'x')),
                                 "/dev/null"};
    for (const std::string& name : wrong) {
        message_.clear();
        EXPECT_FALSE(file_.open(name, 10000, message_)) << name;
        EXPECT_EQ(message_.rfind(name + ": ", 0), 0U) << message_;
        EXPECT_GT(message_.size(), name.size() + 10);
        EXPECT_EQ(message_.back(), '.');
        EXPECT_TRUE(file_.vocabulary().is_empty());
    }
    EXPECT_FALSE(file_.open(good, 100, message_));
    EXPECT_NE(message_.find("limits.vocabulary_words_max"), std::string::npos);
}

}  // namespace
}  // namespace stillmesh::vocabulary_file_test
