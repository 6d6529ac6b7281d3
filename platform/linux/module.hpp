// Parts of the program in libraries of their own (modules), each opened when somebody asks for what it does: a run
// without has nothing of it, nor of what it is linked with, in its memory. A module lies beside the program (build
// tree, workspace of ROS 2) or where it is installed, <libdir>/stillmesh, seen from the program's own folder, and
// nowhere else: it is opened by its whole path, so that whoever could put another one there could also replace the
// program. It is never closed: its threads run in it, and what it has made has its code there. But for one function
// nothing in it can be seen from outside, and it sees nothing of the program: what both need is in both, as code
// without a state; what one has to tell the other goes through the objects made here. Program and modules are of one
// build.
#pragma once

#include <string>

namespace stillmesh {

// What that function, stillmesh_module(), returns.
struct Module {
    const char* version;  // of Stillmesh
    const void* calls;    // a table of functions, of a type that both know
};

struct ModuleWanted {
    const char* name;    // libstillmesh_NAME.so
    const char* absent;  // what is said where there is none, before the places that were looked at
    const char* remedy;  // and behind them
};
// Its table. nullptr: `message` says that it is not there, or why it cannot be used.
[[nodiscard]] const void* open_module(const ModuleWanted& wanted, std::string& message);
// The same of a file that is there, by its whole path.
[[nodiscard]] const void* open_module_file(const std::string& path, std::string& message);

}  // namespace stillmesh

// Of a module.
extern "C" const stillmesh::Module* stillmesh_module();
