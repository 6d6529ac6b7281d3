// The program, run through a shell, and what it says.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <string>

namespace stillmesh::test {

struct Answer {
    int code = -1;
    std::string text;  // standard output and error
    [[nodiscard]] bool says(const std::string& words) const { return text.find(words) != std::string::npos; }
};

// `errors`: what a shell does with standard error.
[[nodiscard]] inline Answer stillmesh_says(const std::string& arguments, const char* errors = "2>&1") {
    Answer answer;
    std::FILE* const pipe = ::popen((std::string(STILLMESH_PROGRAM) + " " + arguments + " " + errors).c_str(), "r");
    if (pipe == nullptr) return answer;
    char buffer[512];
    while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) answer.text += buffer;
    const int status = ::pclose(pipe);
    if (WIFEXITED(status)) answer.code = WEXITSTATUS(status);
    return answer;
}

}  // namespace stillmesh::test
