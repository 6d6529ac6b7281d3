// Files that are replaced as a whole or not at all, whatever happens to the program that writes them.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "engine/base/random.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::atomic_file_test {
namespace {

std::string text_of(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// Content that says which it is and whether it is whole: its number all along.
std::vector<std::byte> content(std::uint32_t number) {
    return std::vector<std::byte>(200'000 + 1000 * (number % 7), static_cast<std::byte>(number % 251));
}

bool save(const std::string& file, std::uint32_t number, std::string& message) {
    AtomicFile out;
    const std::vector<std::byte> bytes = content(number);
    if (!out.open(file, message)) return false;
    for (std::size_t at = 0; at < bytes.size(); at += 16384) {
        if (!out.write(std::span(bytes).subspan(at, std::min<std::size_t>(16384, bytes.size() - at)), message)) {
            return false;
        }
    }
    return out.commit(message);
}

// Promise: kill -9 at any moment of saving leaves the old content or the new one, whole; and the next save works. A
// hundred times.
TEST(AtomicFile, SurvivesAHundredKills) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path("room.map");
    std::string message;
    ASSERT_TRUE(save(file, 0, message)) << message;
    Random random(3);
    std::uint32_t in_the_middle = 0;
    std::uint32_t number = 0;  // the last that is known to be there
    for (int kill = 0; kill < 100; ++kill) {
        int pipe_ends[2] = {};
        ASSERT_EQ(::pipe(pipe_ends), 0);
        const pid_t child = ::fork();
        ASSERT_GE(child, 0);
        if (child == 0) {  // saves on and on, and says which one it begins
            std::string problem;
            for (std::uint32_t next = number + 1;; ++next) {
                if (::write(pipe_ends[1], &next, sizeof(next)) != sizeof(next)) ::_exit(1);
                if (!save(file, next, problem)) ::_exit(2);
            }
        }
        ::close(pipe_ends[1]);
        std::uint32_t begun = 0;
        ASSERT_EQ(::read(pipe_ends[0], &begun, sizeof(begun)), static_cast<ssize_t>(sizeof(begun)));
        ::usleep(random.below(3000));
        ASSERT_EQ(::kill(child, SIGKILL), 0);
        int status = 0;
        ASSERT_EQ(::waitpid(child, &status, 0), child);
        ASSERT_TRUE(WIFSIGNALED(status)) << WEXITSTATUS(status);
        std::uint32_t later = 0;
        while (::read(pipe_ends[0], &later, sizeof(later)) == static_cast<ssize_t>(sizeof(later))) begun = later;
        ::close(pipe_ends[0]);
        in_the_middle += ::access((file + ".part").c_str(), F_OK) == 0 ? 1U : 0U;
        const std::string text = text_of(file);
        ASSERT_FALSE(text.empty());
        const bool is_new = text.size() == content(begun).size() &&
                            text[0] == static_cast<char>(std::to_integer<unsigned char>(content(begun)[0]));
        const std::uint32_t there = is_new ? begun : begun - 1;
        const std::vector<std::byte> wanted = content(there);
        ASSERT_EQ(text.size(), wanted.size()) << "kill " << kill;
        ASSERT_EQ(std::memcmp(text.data(), wanted.data(), text.size()), 0) << "kill " << kill;
        number = there;
    }
    EXPECT_GT(in_the_middle, 10U) << "else the kills came too late";
    ASSERT_TRUE(save(file, 77, message)) << message;
    EXPECT_EQ(text_of(file).size(), content(77).size());
    EXPECT_FALSE(std::filesystem::exists(file + ".part"));
}

// Promise: what is not committed leaves no trace, and the old content where it was.
TEST(AtomicFile, DiscardedIsAsIfItNeverWas) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path("a");
    std::string message;
    ASSERT_TRUE(save(file, 1, message));
    const std::string before = text_of(file);
    {
        AtomicFile out;
        ASSERT_TRUE(out.open(file, message));
        ASSERT_TRUE(out.write(content(2), message));
    }
    EXPECT_EQ(text_of(file), before);
    EXPECT_FALSE(std::filesystem::exists(file + ".part"));
}

// Promise: two writers of one file do not mix: the second is told so.
TEST(AtomicFile, TwoWritersDoNotMix) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path("a");
    std::string message;
    AtomicFile first;
    AtomicFile second;
    ASSERT_TRUE(first.open(file, message));
    ASSERT_TRUE(first.write(content(1), message));
    EXPECT_FALSE(second.open(file, message));
    EXPECT_NE(message.find("another program is writing"), std::string::npos) << message;
    ASSERT_TRUE(first.commit(message));
    EXPECT_EQ(text_of(file).size(), content(1).size());
    EXPECT_TRUE(second.open(file, message)) << message;
}

// Promise: places that cannot be written to get a sentence, and nothing is made or lost: a folder that is not there, a
// folder, a device, a disk that is full.
TEST(AtomicFile, PlacesThatCannotBe) {
    const test::TemporaryFolder folder;
    std::string message;
    AtomicFile out;
    for (const std::string& file : {folder.path("none/a"), folder.path(""), std::string("/dev/full")}) {
        EXPECT_FALSE(out.open(file, message)) << file;
        EXPECT_EQ(message.find(file), 0U) << message;
        EXPECT_EQ(message.back(), '.');
    }
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

// Promise: reading takes a regular file up to the limit; everything else gets a sentence, and nobody waits.
TEST(ReadWholeFile, TakesRegularFilesOnly) {
    const test::TemporaryFolder folder;
    std::string message;
    MemoryBlock block;
    std::span<const std::byte> bytes;
    const std::string file = folder.path("a");
    ASSERT_TRUE(save(file, 3, message));
    ASSERT_TRUE(read_whole_file(file, 1'000'000, block, bytes, message));
    const std::vector<std::byte> wanted = content(3);
    EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), wanted.begin(), wanted.end()));
    EXPECT_FALSE(read_whole_file(file, 1000, block, bytes, message));
    EXPECT_NE(message.find("larger"), std::string::npos);
    EXPECT_FALSE(read_whole_file(folder.path("none"), 1000, block, bytes, message));
    EXPECT_FALSE(read_whole_file(folder.path(""), 1000, block, bytes, message));
    ASSERT_EQ(::mkfifo(folder.path("pipe").c_str(), 0600), 0);
    EXPECT_FALSE(read_whole_file(folder.path("pipe"), 1000, block, bytes, message));
    EXPECT_NE(message.find("no regular file"), std::string::npos) << message;
    std::ofstream(folder.path("empty")).close();
    EXPECT_TRUE(read_whole_file(folder.path("empty"), 1000, block, bytes, message));
    EXPECT_TRUE(bytes.empty());
}

}  // namespace
}  // namespace stillmesh::atomic_file_test
