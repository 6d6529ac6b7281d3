#include "platform/cli/view_of_run.hpp"

#include <fmt/format.h>
#include <sys/random.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>

#include "platform/linux/service.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/view/view_module.hpp"

namespace stillmesh {
namespace {

constexpr std::string_view kTokenOption = "--view-token";

// 128 bits; empty: the system has none to give.
[[nodiscard]] std::string make_token() {
    std::array<std::uint8_t, 16> bytes{};
    if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) return {};
    std::string token;
    for (const std::uint8_t byte : bytes) token += fmt::format("{:02x}", byte);
    return token;
}

[[nodiscard]] bool is_token(std::string_view text) {
    return text.size() >= kViewTokenMin && text.size() <= kViewTokenMax &&
           std::all_of(text.begin(), text.end(), [](char c) {
               return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
                      c == '_';
           });
}

}  // namespace

void add_view_options(CLI::App& run, ViewServerOptions& options) {
    constexpr const char* kGroup = "What comes out";
    CLI::Option* const view =
        run.add_option("--view", options.place,
                       "a page that shows the run while it goes on, at http://localhost:PORT/; for this machine alone, "
                       "unless an address is given, as 0.0.0.0:8080; port 0: any that is free (docs/view.md)")
            ->type_name("[ADDRESS:]PORT")
            ->group(kGroup);
    run.add_option(
           "--view-token", options.token,
           "who says it on the page may steer: pause, step and speed of a recording, saving, a new map; auto: one "
           "is made and said; without it the page is read only")
        ->type_name("TOKEN|auto")
        ->needs(view)
        ->group(kGroup);
}

std::string command_without_token(int argc, const char* const* argv) {
    std::string command = "stillmesh";
    bool is_next = false;
    for (int i = 1; i < argc; ++i) {
        const std::string_view word = argv[i];
        const bool is_joined = word.starts_with(std::string(kTokenOption) + "=");
        command += " ";
        command += is_next ? "..." : is_joined ? std::string(kTokenOption) + "=..." : std::string(word);
        is_next = word == kTokenOption;
    }
    return command;
}

bool ViewOfRun::open(const ViewServerOptions& options, std::string& message) {
    if (options.place.empty() || server_ != nullptr) return true;
    ViewServerOptions filled = options;
    if (filled.token == "auto") filled.token = make_token();
    if (!options.token.empty() && !is_token(filled.token)) {
        message = fmt::format("{}: give {} to {} letters, digits, - and _, or auto.", kTokenOption, kViewTokenMin,
                              kViewTokenMax);
        return false;
    }
    server_ = load_view_server(filled, feed(), message);
    if (server_ == nullptr) return false;
    write_standard_error(log_entry(LogLevel::kNotice, server_->sentence()));
    return true;
}

ViewFeed& ViewOfRun::feed() {
    if (feed_ == nullptr) feed_ = std::make_unique<ViewFeed>();
    return *feed_;
}

}  // namespace stillmesh
