// What reaches the pages from outside: a report that is compared with others, and a command to a run. Any report is
// refused, or gives a page that holds its numbers as data and cannot be read as anything else; any command is one of
// those there are, with a value within its range.
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "fuzz/fuzz.hpp"
#include "platform/report/report.hpp"
#include "platform/report/report_data.hpp"
#include "platform/view/view_commands.hpp"

namespace {

using namespace stillmesh;

void report_keeps_its_promise(std::string_view page) {
    std::string data;
    if (!take_run(page, data)) return;
    fuzz::expect(data.find('<') == std::string::npos, "no tag in the data");
    std::string again;
    fuzz::expect(take_run(std::string(kRunDataBegin) + data + std::string(kDataEnd), again) && again == data,
                 "what was taken can be taken again, and is the same");
    const std::string name(page.substr(0, page.size() < 40 ? page.size() : 40));
    const std::string whole = comparison_html({{name, data}, {"other", data}});
    constexpr std::string_view kBegin = "<script type=\"application/json\" id=\"runs\">";
    const std::size_t begin = whole.find(kBegin) + kBegin.size();
    const nlohmann::json runs = nlohmann::json::parse(whole.substr(begin, whole.find("</script>", begin) - begin));
    fuzz::expect(runs.size() == 2 && runs[0]["data"] == runs[1]["data"], "both runs are in the page");
}

void command_keeps_its_promise(std::string_view text) {
    const auto command = parse_view_command(text);
    if (!command) return;
    fuzz::expect(text.size() <= 64, "a command is short");
    fuzz::expect(command->value >= 0 && command->value <= kViewSpeedMax, "its value is within its range");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    command_keeps_its_promise(text);
    report_keeps_its_promise(text);
    // Most inputs are no page: the same as its numbers.
    report_keeps_its_promise(std::string(kRunDataBegin) + std::string(text) + std::string(kDataEnd));
    return 0;
}
