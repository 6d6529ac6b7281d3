// Where a page is served: [ADDRESS:]PORT as it is typed, and by which names a request may call that place.
#pragma once

#include <string>
#include <string_view>

namespace stillmesh {

struct ViewAddress {
    std::string host = "127.0.0.1";
    int port = 0;
};
// False: `message` says what is wrong.
[[nodiscard]] bool parse_view_address(std::string_view text, ViewAddress& address, std::string& message);
// Whether only this machine reaches it.
[[nodiscard]] bool is_loopback(std::string_view host);
// Whether a request with this Host header means us: numbers (no name, so nobody's to redirect), localhost, the address
// that was given, and, unless it is for this machine alone, the machine's name, as NAME or NAME.local.
[[nodiscard]] bool is_own_host(std::string_view header, std::string_view bound);

}  // namespace stillmesh
