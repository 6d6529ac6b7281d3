#include "platform/view/view_place.hpp"

#include <arpa/inet.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>

namespace stillmesh {
namespace {

[[nodiscard]] bool is_address(const std::string& host) {
    std::array<unsigned char, sizeof(in6_addr)> bytes{};
    return ::inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
           ::inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

[[nodiscard]] std::string lower(std::string_view text) {
    std::string out(text);
    std::transform(out.begin(), out.end(), out.begin(),
                   [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
    return out;
}

// Without port and brackets.
[[nodiscard]] std::string name_of(std::string_view host) {
    if (!host.empty() && host.front() == '[') {
        const std::size_t end = host.find(']');
        return end == std::string_view::npos ? std::string() : lower(host.substr(1, end - 1));
    }
    const std::size_t colon = host.find(':');
    if (colon != std::string_view::npos && host.find(':', colon + 1) != std::string_view::npos) return lower(host);
    return lower(host.substr(0, colon));
}

}  // namespace

bool parse_view_address(std::string_view text, ViewAddress& address, std::string& message) {
    const std::size_t colon = text.rfind(':');
    std::string_view host = colon == std::string_view::npos ? std::string_view() : text.substr(0, colon);
    const std::string port(colon == std::string_view::npos ? text : text.substr(colon + 1));
    if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
    const bool is_number = !port.empty() && port.size() <= 5 &&
                           port.find_first_not_of("0123456789") == std::string::npos && std::stoul(port) <= 65535;
    if (!is_number || (colon != std::string_view::npos && host.empty())) {
        message = "--view " + std::string(text) +
                  ": give [ADDRESS:]PORT, as 8080 or 0.0.0.0:8080; port 0 is any that is free.";
        return false;
    }
    address.host = host.empty() ? "127.0.0.1" : std::string(host);
    address.port = static_cast<int>(std::stoul(port));
    return true;
}

bool is_loopback(std::string_view host) {
    return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0;
}

bool is_own_host(std::string_view header, std::string_view bound) {
    const std::string name = name_of(header);
    if (name.empty()) return false;
    if (name == "localhost" || name == lower(bound) || is_address(name)) return true;
    if (is_loopback(bound)) return false;
    std::array<char, 256> own{};
    if (::gethostname(own.data(), own.size() - 1) != 0) return false;
    const std::string here = lower(own.data());
    return name == here || name == here + ".local";
}

}  // namespace stillmesh
