// The command line program: what must hold whatever is asked of it.
#include <cstdint>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "engine/base/check.hpp"
#include "platform/cli/arguments.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/linux/memory_reserve.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/service.hpp"
#include "platform/linux/text_output.hpp"

void stillmesh_check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    std::fprintf(stderr, "%sstillmesh: a bug of ours: %s (%s:%d). Please report it.\n",
                 stillmesh::log_prefix(stillmesh::LogLevel::kCritical), expression, file, line);
}

int main(int argc, char** argv) {
    stillmesh::ignore_write_signals();
    stillmesh::keep_memory_reserve();
    try {
        const int code = stillmesh::command_line(argc, argv);
        std::string message;
        if (stillmesh::write_standard_output({}, message)) return code;
        stillmesh::complain(message);
        return code == stillmesh::kExitDone ? stillmesh::kExitFailed : code;
    } catch (const std::bad_alloc&) {
        stillmesh::say_no_memory();
        return stillmesh::kExitFailed;
    } catch (const std::exception& error) {
        stillmesh::complain(std::string(error.what()) + ".");
        return stillmesh::kExitFailed;
    }
}
