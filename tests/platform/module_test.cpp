// Modules as the program opens them: where there is none, where it is none, and another's.
#include "platform/linux/module.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temporary_folder.hpp"

namespace stillmesh::module_test {
namespace {

// Promise: where there is none, both places that were looked at are said, seen from the program's own: beside it, and
// where it would be installed.
TEST(Module, WhereThereIsNone) {
    std::string message;
    EXPECT_EQ(open_module({.name = "nobody", .absent = "is not here", .remedy = "; build it."}, message), nullptr);
    EXPECT_TRUE(message.starts_with("is not here (neither /")) << message;
    EXPECT_TRUE(message.ends_with("/stillmesh/libstillmesh_nobody.so is there); build it.")) << message;
    EXPECT_NE(message.find("/tests/platform/libstillmesh_nobody.so nor /"), std::string::npos) << message;
    EXPECT_EQ(message.find("/../"), std::string::npos) << message;
}

// Promise: what cannot be loaded is named, with the system's reason.
TEST(Module, AFileThatIsNoLibrary) {
    const test::TemporaryFolder scratch;
    const std::string file = scratch.path("libstillmesh_nobody.so");
    std::ofstream(file) << "no library\n";
    std::string message;
    EXPECT_EQ(open_module_file(file, message), nullptr);
    EXPECT_TRUE(message.starts_with("needs " + file + ", which cannot be loaded: " + file)) << message;
}

// Promise: a module of another version is refused, with both versions.
TEST(Module, OfAnotherVersion) {
    std::string message;
    EXPECT_EQ(open_module_file(STILLMESH_OTHER_MODULE, message), nullptr);
    EXPECT_NE(message.find("which is of version 0.0.0: install both from one build."), std::string::npos) << message;
}

}  // namespace
}  // namespace stillmesh::module_test
