// Reads the command line, and does what it asks for.
#pragma once

namespace stillmesh {

// Returns the program's exit code (exit_code.hpp). Throws what the library throws: std::bad_alloc above all.
int command_line(int argc, char** argv);

}  // namespace stillmesh
