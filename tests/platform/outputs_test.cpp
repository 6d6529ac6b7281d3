// What a run writes, and what becomes of it when the world around it fails.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "platform/cli/destinations.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/text_output.hpp"
#include "tests/replay/recording_folder.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::outputs_test {
namespace {

using test::read_text;
using test::TemporaryFolder;
using test::write_text;

constexpr const char* kRun = " run --simulate static_xyz:1 --frames 20 --limits pocket --vocabulary none ";

// In a shell, in `folder`; its exit code.
int shell(const TemporaryFolder& folder, const std::string& command) {
    const int status = std::system(("cd " + folder.path() + " && " + command).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
std::string run(const std::string& arguments) {
    return std::string(STILLMESH_PROGRAM) + kRun + arguments;
}
std::size_t lines_of(const std::string& text) {
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

// Promise: a reader of standard output and error that leaves ends nothing: the run goes on to its end, its map and all
// its poses are written, and it fails.
TEST(Outputs, AReaderThatLeavesEndsNothing) {
    const TemporaryFolder folder;
    ASSERT_EQ(shell(folder, "(" + run("--trajectory t.txt --map-out m.map 2>&1") + "; echo $? > code) | true"), 0);
    EXPECT_EQ(read_text(folder.path("code")), "1\n");
    EXPECT_EQ(lines_of(read_text(folder.path("t.txt"))), 21U);
    EXPECT_TRUE(std::filesystem::exists(folder.path("m.map")));
}

// Promise: what cannot be written is said when it happens and again at the end, with how much it was; all else is
// written. The file that was cut off ends with a whole line and can be read.
TEST(Outputs, WhatCannotBeWrittenIsSaidTwice) {
    const TemporaryFolder folder;
    EXPECT_EQ(shell(folder, "ulimit -f 2; " + run("--trajectory t.txt > out 2> err")), 1);
    const std::string err = read_text(folder.path("err"));
    EXPECT_NE(err.find("t.txt: cannot be written: File too large. The run goes on without these lines.\n"),
              std::string::npos)
        << err;
    EXPECT_NE(err.find(" of 21 lines are missing there.\n"), std::string::npos) << err;
    const std::string text = read_text(folder.path("t.txt"));
    ASSERT_FALSE(text.empty());
    EXPECT_EQ(text.back(), '\n');
    EXPECT_LT(lines_of(text), 21U);
    EXPECT_NE(read_text(folder.path("out")).find("frames        20 ("), std::string::npos) << "all frames were tracked";
}

// Promise: a summary that cannot be written is a failure, of every command.
TEST(Outputs, StandardOutputCounts) {
    const TemporaryFolder folder;
    EXPECT_EQ(shell(folder, run("--json > /dev/full 2> err")), 1);
    EXPECT_NE(read_text(folder.path("err")).find("standard output cannot be written"), std::string::npos);
    EXPECT_EQ(shell(folder, run("--print-config > /dev/full 2> err")), 1);
    EXPECT_EQ(shell(folder, std::string(STILLMESH_PROGRAM) + " --help > /dev/full 2> err"), 1);
}

// Promise: a reader that has enough of what it asked for is no failure of ours: help and configuration end with 0.
TEST(Outputs, AReaderMayHaveEnough) {
    const TemporaryFolder folder;
    for (const char* const asked : {"run --print-config", "run --help", "--help", "cameras --udev-rules"}) {
        ASSERT_EQ(shell(folder, "(" + std::string(STILLMESH_PROGRAM) + " " + asked + " 2> err; echo $? > code) | true"),
                  0);
        EXPECT_EQ(read_text(folder.path("code")), "0\n") << asked;
        EXPECT_EQ(read_text(folder.path("err")), "") << asked;
    }
}

// Promise: `--trajectory -` is the path on standard output and nothing else there, to a file and to a pipe; the summary
// goes to standard error. No other output can go there, and no file of that name is made.
TEST(Outputs, AHyphenIsStandardOutput) {
    const TemporaryFolder folder;
    ASSERT_EQ(shell(folder, run("--trajectory t.txt > out 2> err")), 0);
    ASSERT_EQ(shell(folder, run("--trajectory - > piped 2> err")), 0);
    EXPECT_EQ(read_text(folder.path("piped")), read_text(folder.path("t.txt")));
    EXPECT_NE(read_text(folder.path("err")).find("frames        20 ("), std::string::npos);
    ASSERT_EQ(shell(folder, run("--trajectory - 2> err") + " | cat > through"), 0);
    EXPECT_EQ(read_text(folder.path("through")), read_text(folder.path("t.txt")));
    for (const char* const option : {"--state-hashes", "--trajectory-final", "--map-out", "--record"}) {
        EXPECT_EQ(shell(folder, run(std::string(option) + " - > out 2> err")), 2) << option;
        EXPECT_NE(read_text(folder.path("err")).find(std::string(option) + " -: only --trajectory"), std::string::npos);
    }
    EXPECT_FALSE(std::filesystem::exists(folder.path("-")));
}

// Promise: poses with their trust go to several places at once; one that takes nothing (a full disk, a port without a
// listener) is said once while it runs and once at the end, and neither it nor a reader that never reads changes a bit.
TEST(Outputs, PosesGoToManyAndWaitForNobody) {
    const TemporaryFolder folder;
    ASSERT_EQ(shell(folder, run("--trajectory t.txt --poses p.jsonl --poses unix:s > out")), 0);
    const std::string poses = read_text(folder.path("p.jsonl"));
    EXPECT_EQ(lines_of(poses), 20U);
    std::size_t tracked = 0;
    for (std::size_t at = 0; at < poses.size(); at = poses.find('\n', at) + 1) {
        const auto line = nlohmann::json::parse(poses.substr(at, poses.find('\n', at) - at));
        tracked += line["state"] == "tracked" ? 1U : 0U;
        EXPECT_EQ(line["covariance"].size(), 36U);
    }
    EXPECT_EQ(tracked, 20U);
    const auto hash_of = [&](const char* file) {
        const std::string text = read_text(folder.path(file));
        const std::size_t at = text.find("state hash");
        return at == std::string::npos ? text : text.substr(at, text.find('\n', at) - at);
    };
    // A reader that connects and never reads, as long as the run lasts.
    write_text(folder.path("stuck.py"),
               "import socket, time\ns = socket.socket(socket.AF_UNIX)\nfor i in range(600):\n    try:\n"
               "        s.connect('s')\n        break\n    except OSError:\n        time.sleep(.05)\ntime.sleep(60)\n");
    EXPECT_EQ(shell(folder, "{ python3 stuck.py & reader=$!; " +
                                run("--poses /dev/full --poses udp:127.0.0.1:9 --poses unix:s > out2 2> err") +
                                "; code=$?; kill $reader; exit $code; }"),
              1);
    EXPECT_EQ(hash_of("out"), hash_of("out2"));
    const std::string err = read_text(folder.path("err"));
    EXPECT_NE(err.find("/dev/full: cannot be written: No space left on device. The run goes on"), std::string::npos)
        << err;
    EXPECT_NE(err.find("/dev/full: cannot be written: No space left on device. 20 of 20 lines"), std::string::npos)
        << err;
    EXPECT_NE(err.find("--poses udp:127.0.0.1:9: nobody listens there; the run goes on"), std::string::npos) << err;
    // To standard output nothing else goes; together with a trajectory there it is refused.
    ASSERT_EQ(shell(folder, run("--poses - > out3 2> err")), 0);
    EXPECT_EQ(lines_of(read_text(folder.path("out3"))), 20U);
    EXPECT_EQ(shell(folder, run("--poses - --trajectory - > out3 2> err")), 2);
    EXPECT_EQ(shell(folder, run("--poses p.jsonl --append > out3 2> err")), 0);
    EXPECT_EQ(lines_of(read_text(folder.path("p.jsonl"))), 40U);
}

// Promise: a start that is refused changes no file, whichever destination is wrong and wherever it stands among them.
TEST(Outputs, ARefusedStartChangesNothing) {
    const TemporaryFolder folder;
    const std::vector<std::string> names = {"t.txt", "f.txt", "h.txt", "r.rec", "m.map"};
    for (const std::string& name : names) write_text(folder.path(name), "of the last run");
    std::filesystem::create_directories(folder.path("taken/full"));
    const std::string good[] = {"--trajectory t.txt", "--trajectory-final f.txt", "--state-hashes h.txt",
                                "--record r.rec", "--map-out m.map"};
    const std::string bad[] = {
        "--trajectory taken",    "--trajectory no/t",     "--trajectory-final taken", "--trajectory-final no/f",
        "--state-hashes taken",  "--state-hashes no/h",   "--record taken",           "--record no/r",
        "--map-out taken",       "--map-out no/m",        "--map-out /dev/null",      "--report t.txt",
        "--record-frames t.txt", "--record-frames taken", "--map-store t.txt",        "--map-every nan",
        "--trajectory h.txt",    "--map-out ./t.txt",     "--trajectory ''",          "--config none.toml",
        "--map-in none.map",     "--vocabulary none.voc", "--calibration none.yaml",  "--set nothing=1"};
    for (const std::string& one : bad) {
        std::string arguments = one;
        for (const std::string& other : good) {
            if (other.substr(0, other.find(' ')) != one.substr(0, one.find(' '))) arguments += " " + other;
        }
        EXPECT_EQ(shell(folder, run(arguments + " > out 2> err")), 2) << arguments << read_text(folder.path("err"));
        EXPECT_EQ(lines_of(read_text(folder.path("err"))), 1U) << read_text(folder.path("err"));
        for (const std::string& name : names) {
            EXPECT_EQ(read_text(folder.path(name)), "of the last run") << name << " with " << arguments;
        }
    }
}

// Promise: a path is added to from run to run, also behind a line that a crash has cut, and what has grown beyond the
// limit is kept beside.
TEST(Outputs, APathIsAddedTo) {
    const TemporaryFolder folder;
    write_text(folder.path("t.txt"), "1 0 0 0 0 0 0 1\n2 0 0 0 0");
    ASSERT_EQ(shell(folder, run("--trajectory t.txt --append > out 2> err")), 0) << read_text(folder.path("err"));
    std::string text = read_text(folder.path("t.txt"));
    EXPECT_EQ(text.rfind("1 0 0 0 0 0 0 1\n2 0 0 0 0\n# timestamp", 0), 0U) << text;
    EXPECT_EQ(lines_of(text), 23U);
    ASSERT_EQ(shell(folder, run("--trajectory t.txt --append --trajectory-limit 0.003 > out 2> err")), 0);
    const std::string before = read_text(folder.path("t.txt.1"));
    text = read_text(folder.path("t.txt"));
    EXPECT_EQ(lines_of(before) + lines_of(text), 23U + 21U) << "no line is lost";
    EXPECT_GE(before.size(), 3145U);
    EXPECT_EQ(before.back(), '\n');
    EXPECT_EQ(shell(folder, run("--append > out 2> err")), 2);
    ASSERT_EQ(shell(folder, run("--trajectory t.txt > out 2> err")), 0);
    EXPECT_EQ(lines_of(read_text(folder.path("t.txt"))), 21U) << "replaced without --append";
}

// Promise: --map begins without a map, goes on in one, and keeps one that it cannot go on in aside, with a sentence.
TEST(Outputs, AMapOfItsOwn) {
    const TemporaryFolder folder;
    ASSERT_EQ(shell(folder, run("--map m.map --json > out 2> err")), 0) << read_text(folder.path("err"));
    EXPECT_EQ(read_text(folder.path("out")).find("\"read\""), std::string::npos);
    const std::string first = read_text(folder.path("m.map"));
    ASSERT_GT(first.size(), 1000U);
    ASSERT_EQ(shell(folder, run("--map m.map > out 2> err")), 0) << read_text(folder.path("err"));
    EXPECT_NE(read_text(folder.path("out")).find("m.map"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(folder.path("m.map.1")));
    const std::string second = read_text(folder.path("m.map"));
    EXPECT_NE(second, first);
    write_text(folder.path("m.map"), second.substr(0, second.size() / 2));
    ASSERT_EQ(shell(folder, run("--map m.map > out 2> err")), 0) << read_text(folder.path("err"));
    EXPECT_NE(read_text(folder.path("out")).find("is cut off"), std::string::npos) << read_text(folder.path("out"));
    EXPECT_NE(read_text(folder.path("out")).find("A new map begins; that one is kept as m.map.1."), std::string::npos);
    EXPECT_EQ(read_text(folder.path("m.map.1")).size(), second.size() / 2);
    EXPECT_GT(read_text(folder.path("m.map")).size(), 1000U);
    // A second one that cannot be gone on in takes the next name; a start that is refused moves none.
    write_text(folder.path("m.map"), "no map");
    EXPECT_EQ(shell(folder, run("--map m.map --record no/r > out 2> err")), 2);
    EXPECT_EQ(read_text(folder.path("m.map")), "no map");
    int refused = 0;
    for (int files = 4; files < 64; ++files) {  // each thing that is opened is once the one too many
        const std::string few = "(ulimit -n " + std::to_string(files) + "; exec ";
        const int status = shell(folder, few + run("--map m.map --trajectory t --state-hashes h) > out 2> err"));
        if (status == 127) continue;  // not even its libraries could be opened
        if (status != 2) break;
        ++refused;
        EXPECT_EQ(read_text(folder.path("m.map")), "no map") << files << read_text(folder.path("err"));
    }
    EXPECT_GT(refused, 0);
    std::filesystem::remove(folder.path("m.map.2"));  // of the one that was not refused
    write_text(folder.path("m.map"), "no map");
    ASSERT_EQ(shell(folder, run("--map m.map > out 2> err")), 0);
    EXPECT_EQ(read_text(folder.path("m.map.1")).size(), second.size() / 2);
    EXPECT_EQ(read_text(folder.path("m.map.2")), "no map");
    EXPECT_EQ(shell(folder, run("--map m.map --map-out n.map > out 2> err")), 2);
}

// Promise: destinations are checked as one finds them: what is one place by two names, what would be written over, what
// may be (a map that a run goes on in), and what is no file at all.
TEST(Destinations, AreToldApart) {
    using enum DestinationKind;
    const TemporaryFolder folder;
    write_text(folder.path("a"), "");
    std::filesystem::create_symlink(folder.path("a"), folder.path("b"));
    const auto check = [&](const std::vector<Destination>& to, const std::vector<Origin>& from = {}) {
        return check_destinations(to, from);
    };
    const std::string a = folder.path("a"), b = folder.path("b"), c = folder.path("c");
    EXPECT_EQ(check({{"--one", a, kLines}, {"--two", c, kWhole}}), "");
    EXPECT_NE(check({{"--one", a, kLines}, {"--two", b, kWhole}}).find("--one and --two name one place"),
              std::string::npos);
    EXPECT_NE(check({{"--one", c, kLines}, {"--two", folder.path("./c"), kWhole}}).find("name one place"),
              std::string::npos);
    EXPECT_NE(check({{"--one", a, kLines}}, {{"--in", b}}).find("write over what --in reads"), std::string::npos);
    EXPECT_EQ(check({{"--one", a, kLines}}, {{"--in", b, "--one"}}), "");
    EXPECT_EQ(check({{"--one", "/dev/null", kLines}, {"--two", "/dev/null", kWhole}}), "");
    EXPECT_NE(check({{"--one", "/dev/null", kFile}}).find("no regular file"), std::string::npos);
    EXPECT_NE(check({{"--one", folder.path(), kWhole}}).find("is a folder"), std::string::npos);
    EXPECT_NE(check({{"--one", c + "/", kLines}}).find("name of a folder"), std::string::npos);
    EXPECT_NE(check({{"--one", a + "/x", kLines}}).find("cannot be written"), std::string::npos);
    EXPECT_NE(check({{"--one", a, kFolder}}).find("is no folder"), std::string::npos);
    EXPECT_EQ(check({{"--one", folder.path("new/deep"), kFolder}}), "");
    EXPECT_FALSE(std::filesystem::exists(folder.path("new"))) << "nothing is made";
}

// Promise: a named pipe needs no reader to be opened and is never waited for: lines without a reader, and those that a
// slow reader has no room for, are counted; what is read are whole lines in their order, and a reader that comes later
// gets the later ones.
TEST(CountedLines, PipesAreNeverWaitedFor) {
    ignore_write_signals();
    const TemporaryFolder folder;
    const std::string pipe = folder.path("pipe");
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    CountedLines lines;
    std::string message;
    ASSERT_TRUE(lines.open(pipe, message)) << message;
    EXPECT_NE(lines.write("lost\n").find("nobody reads it. The run goes on"), std::string::npos);
    EXPECT_EQ(lines.write("lost too\n"), "") << "said once";
    const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
    ASSERT_GE(reader, 0);
    const std::string line = std::string(99, 'x') + "\n";
    for (int i = 0; i < 2000; ++i) EXPECT_EQ(lines.write(line), "");  // far more than a pipe holds
    std::string got(400'000, '\0');
    const ssize_t count = ::read(reader, got.data(), got.size());
    ASSERT_GT(count, 4096);
    EXPECT_EQ(static_cast<std::size_t>(count) % line.size(), 0U);
    EXPECT_EQ(lines.write("after\n"), "");
    ASSERT_EQ(::read(reader, got.data(), got.size()), 6);
    ::close(reader);
    EXPECT_EQ(lines.write("gone\n"), "");
    const std::string problem = lines.problem();
    const auto missing = 2003 - static_cast<std::size_t>(count) / line.size();
    EXPECT_NE(problem.find(" " + std::to_string(missing) + " of 2004 lines are missing"), std::string::npos) << problem;
}

// Promise: a line that does not fit is taken back whole, and what comes when there is room again follows in lines.
TEST(CountedLines, NoLineIsTorn) {
    ignore_write_signals();
    const TemporaryFolder folder;
    CountedLines lines;
    std::string message;
    ASSERT_TRUE(lines.open(folder.path("f"), message)) << message;
    const pid_t child = ::fork();
    if (child == 0) {  // the limit is for good
        rlimit limit{1000, 1000};
        static_cast<void>(::setrlimit(RLIMIT_FSIZE, &limit));
        for (int i = 0; i < 30; ++i) static_cast<void>(lines.write(std::string(70, 'a') + "\n"));
        static_cast<void>(lines.write("short\n"));
        ::_exit(lines.problem().find("16 of 31 lines") != std::string::npos ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_EQ(WEXITSTATUS(status), 0);
    std::string wanted;
    for (int i = 0; i < 14; ++i) wanted += std::string(70, 'a') + "\n";
    EXPECT_EQ(read_text(folder.path("f")), wanted + "short\n");
}

// Promise: what a file contains cannot command the terminal that it is quoted on: whatever the byte, it is none that
// does; letters of all languages stay.
TEST(TextOutput, FilesDoNotCommandTheTerminal) {
    EXPECT_EQ(printable("a\tb\nc \xc3\xa9 \xe6\x97\xa5"), "a\tb\nc \xc3\xa9 \xe6\x97\xa5");
    EXPECT_EQ(printable("\x1b[2J\a\r\x7f\xc2\x9b"
                        "1m"),
              "?[2J????1m");
    const TemporaryFolder folder;
    write_text(folder.path("t.txt"), "\x1b[31mred 0 0 0 0 0 0 1\n");
    EXPECT_EQ(shell(folder, std::string(STILLMESH_PROGRAM) + " eval --groundtruth t.txt --trajectory t.txt 2> err"), 2);
    EXPECT_EQ(read_text(folder.path("err")).find('\x1b'), std::string::npos);
    EXPECT_EQ(shell(folder, std::string(STILLMESH_PROGRAM) + " $(printf 'bogus\\033[2J') 2> err"), 2);
    EXPECT_EQ(read_text(folder.path("err")).find('\x1b'), std::string::npos);
}

// Promise: a file is replaced as a whole; a device is written to and stays what it is.
TEST(TextOutput, DevicesAreNotReplaced) {
    const TemporaryFolder folder;
    std::string message;
    ASSERT_TRUE(write_whole_file("/dev/null", "text\n", message)) << message;
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
    EXPECT_FALSE(write_whole_file("/dev/full", "text\n", message));
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
    EXPECT_NE(message.find("/dev/full: cannot be written: No space left on device"), std::string::npos) << message;
    EXPECT_FALSE(write_whole_file(folder.path(), "text\n", message));
    write_text(folder.path("f"), "old");
    EXPECT_TRUE(write_whole_file(folder.path("f"), "new\n", message));
    EXPECT_EQ(read_text(folder.path("f")), "new\n");
    EXPECT_FALSE(std::filesystem::exists(folder.path("f.part")));
}

}  // namespace
}  // namespace stillmesh::outputs_test
