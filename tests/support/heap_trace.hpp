// How often a program in a process of its own calls the heap between two lines of its trajectory, by who calls:
// tests/heap/heap_trace.cpp is preloaded into it.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

namespace stillmesh::test {

// While it lives, programs that are started count from line `from` to line `to` of what they write.
class HeapTrace {
public:
    HeapTrace(const std::string& module, std::string file, long from, long to) : file_(std::move(file)) {
        ::setenv("LD_PRELOAD", module.c_str(), 1);
        ::setenv("STILLMESH_HEAP_TRACE", file_.c_str(), 1);
        ::setenv("STILLMESH_HEAP_TRACE_FROM", std::to_string(from).c_str(), 1);
        ::setenv("STILLMESH_HEAP_TRACE_TO", std::to_string(to).c_str(), 1);
    }
    ~HeapTrace() {
        for (const char* const name :
             {"LD_PRELOAD", "STILLMESH_HEAP_TRACE", "STILLMESH_HEAP_TRACE_FROM", "STILLMESH_HEAP_TRACE_TO"}) {
            ::unsetenv(name);
        }
    }
    HeapTrace(const HeapTrace&) = delete;
    HeapTrace& operator=(const HeapTrace&) = delete;

    struct Calls {
        bool is_complete = false;                        // both lines were written, and no stack was lost
        std::map<std::string, std::uint64_t> by_module;  // the innermost that is neither libc nor libstdc++
        std::string stacks;                              // for addr2line -Cfpe MODULE OFFSET
    };
    [[nodiscard]] Calls calls() const {
        Calls found;
        std::ifstream in(file_);
        std::string line;
        found.is_complete = std::getline(in, line) && line == "lost 0";
        while (std::getline(in, line)) {
            std::istringstream words(line);
            std::uint64_t count = 0;
            words >> count;
            std::string module = "libc";
            for (std::string caller; words >> caller;) {
                const std::string name = caller.substr(caller.rfind('/') + 1);
                if (name.rfind("libc.so", 0) == 0 || name.rfind("libstdc++.so", 0) == 0) continue;
                module = name.substr(0, name.find_first_of(".+"));
                break;
            }
            found.by_module[module] += count;
            found.stacks += line + "\n";
        }
        return found;
    }

private:
    std::string file_;
};

}  // namespace stillmesh::test
