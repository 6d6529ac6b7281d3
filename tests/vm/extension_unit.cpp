#include "tests/vm/extension_unit.hpp"

#include "tests/vm/d435_descriptors.hpp"

namespace vm {
namespace {

constexpr std::uint8_t kWrongState = 2, kInvalidControl = 6, kInvalidRequest = 7;

struct Range {
    std::uint32_t length, least, most, step, usual;
};
constexpr std::array<Range, 3> kRanges = {{{1, 0, 2, 1, 1}, {4, 1, 165'000, 1, 8500}, {2, 0, 360, 30, 150}}};

}  // namespace

bool ExtensionUnit::control(const Setup& setup, const Bytes& written, Bytes& data) {
    const std::size_t selector = setup.value >> 8U;
    error_code_ = selector == 0 || selector > 1 + kRanges.size() ? kInvalidControl : 0;
    if (error_code_ != 0) return false;
    const bool is_monitor = selector == 1;
    const Range range = is_monitor ? Range{kMessageBytes, 0, 0, 0, 0} : kRanges[selector - 2];
    std::uint32_t value = 0;
    switch (setup.request) {
        case kGetLength: put16(data, range.length); return true;
        case kGetInfo: data = {3}; return true;  // can be read and written
        case kGetMinimum: value = range.least; break;
        case kGetMaximum: value = range.most; break;
        case kGetResolution: value = range.step; break;
        case kGetDefault: value = range.usual; break;
        case kGetCurrent:
        case kSetCurrent:
            if (is_monitor && is_refused) error_code_ = kWrongState;
            if (setup.request == kSetCurrent && written.size() != range.length) error_code_ = kInvalidRequest;
            if (error_code_ != 0) return false;
            break;
        default: error_code_ = kInvalidRequest; return false;
    }
    if (setup.request == kSetCurrent) {
        if (is_monitor) {
            answer_ = answer_message(written, monitor);
            return true;
        }
        for (std::size_t i = 0; i < written.size(); ++i) value |= static_cast<std::uint32_t>(written[i]) << 8U * i;
        values_[selector - 2] = value;
        return true;
    }
    if (is_monitor) {
        if (setup.request == kGetCurrent) data = answer_;
    } else {
        put32(data, setup.request == kGetCurrent ? values_[selector - 2] : value);
    }
    data.resize(range.length);
    return true;
}

}  // namespace vm
