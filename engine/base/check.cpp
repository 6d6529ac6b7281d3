#include "engine/base/check.hpp"

namespace stillmesh {
namespace {
CheckHandler installed_handler = nullptr;
}  // namespace

void set_check_handler(CheckHandler handler) noexcept {
    installed_handler = handler;
}

void check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    if (installed_handler != nullptr) installed_handler(expression, file, line);
    __builtin_trap();
}

}  // namespace stillmesh
