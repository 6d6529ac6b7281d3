// The program as a user meets it: its words and its exit codes.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <sstream>
#include <string>

#include "tests/replay/recording_folder.hpp"
#include "tests/support/answer.hpp"

namespace stillmesh::program_test {
namespace {

using test::Answer;
using test::stillmesh_says;

// Promise: help is no error, and speaks of the exit codes.
TEST(Program, Helps) {
    const Answer answer = stillmesh_says("--help");
    EXPECT_EQ(answer.code, 0);
    EXPECT_NE(answer.text.find("Exit codes: 0 done"), std::string::npos) << answer.text;
    EXPECT_EQ(stillmesh_says("run --help").code, 0);
}

// Promise: the manual page has every command of this build, and the program tells its version.
TEST(Program, TheManualHasEveryCommand) {
    const std::string manual = test::read_text(STILLMESH_MANUAL);
    const std::string help = stillmesh_says("--help").text;
    int commands = 0;
    std::istringstream lines(help.substr(help.find("Subcommands:")));
    for (std::string line; std::getline(lines, line);) {
        if (line.rfind("  ", 0) != 0 || line.find("not in this build") != std::string::npos) continue;
        const std::string name = line.substr(2, line.find(' ', 2) - 2);
        EXPECT_NE(manual.find("\n.B " + name + "\n"), std::string::npos) << name;
        ++commands;
    }
    EXPECT_GE(commands, 7) << help;
    const Answer version = stillmesh_says("--version");
    EXPECT_EQ(version.code, 0);
    EXPECT_EQ(version.text.rfind("stillmesh ", 0), 0U) << version.text;
}

// Promise: bad usage and bad input end with 2 and one sentence on standard error, and touch no output.
TEST(Program, BadUsageAndInput) {
    test::TemporaryFolder folder;
    const std::string kept = folder.path() + "/kept.txt";
    test::write_text(kept, "poses of yesterday\n");
    for (const std::string& arguments :
         {std::string(), std::string("run"), std::string("walk"), std::string("run --bogus"),
          std::string("run --limits huge --replay x"), "run --replay " + folder.path() + "/none --trajectory " + kept,
          "run --replay " + folder.path() + " --trajectory " + kept,
          std::string("eval --groundtruth /none --trajectory /none"),
          "eval --groundtruth " + kept + " --trajectory " + kept}) {
        const Answer answer = stillmesh_says(arguments);
        EXPECT_EQ(answer.code, 2) << arguments << ": " << answer.text;
        EXPECT_EQ(answer.text.find("stillmesh: "), 0U) << arguments << ": " << answer.text;
    }
    EXPECT_EQ(test::read_text(kept), "poses of yesterday\n");
}

// Promise: a slip in a command's options names the help that lists them.
TEST(Program, ASlipNamesTheHelp) {
    struct Case {
        const char *arguments, *help;
    };
    for (const Case& c : {Case{"wlak", "'wlak' is no command; 'stillmesh --help' shows the commands."},
                          Case{"bogus --replay x", "'bogus' is no command; 'stillmesh --help' shows the commands."},
                          Case{"run --cam auto", "; 'stillmesh run --help' shows the options."},
                          Case{"run --camera", "; 'stillmesh run --help' shows the options."},
                          Case{"run --camera auto --exposure slow", "; 'stillmesh run --help' shows the options."},
                          Case{"capture --camera auto", "; 'stillmesh capture --help' shows the options."},
                          Case{"cameras --rest", "; 'stillmesh cameras --help' shows the options."},
                          Case{"vocabulary train", "; 'stillmesh vocabulary train --help' shows the options."}}) {
        const Answer answer = stillmesh_says(c.arguments);
        EXPECT_EQ(answer.code, 2) << c.arguments;
        EXPECT_NE(answer.text.find(c.help), std::string::npos) << answer.text;
    }
}

// Promise: eval prints the numbers of the evaluation, for people and as JSON.
TEST(Program, Evaluates) {
    const std::string files = std::string("--groundtruth ") + STILLMESH_TEST_FILES + "/truth.txt --trajectory " +
                              STILLMESH_TEST_FILES + "/estimate.txt";
    const Answer text = stillmesh_says("eval " + files);
    EXPECT_EQ(text.code, 0);
    EXPECT_NE(text.text.find("ATE           0.0525 m RMSE"), std::string::npos) << text.text;
    const Answer json = stillmesh_says("eval --json " + files);
    EXPECT_EQ(json.code, 0);
    EXPECT_NE(json.text.find("\"ate_rmse_m\": 0.05252695229"), std::string::npos) << json.text;
}

}  // namespace
}  // namespace stillmesh::program_test
