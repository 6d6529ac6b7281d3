// A message that a reader of Cyclone DDS has received, borrowed for as long as this lives. Inner: sees Cyclone's
// headers.
#pragma once

#include <dds/dds.h>

#include <string_view>

namespace stillmesh {

// Of a message's string, which may be none.
[[nodiscard]] inline std::string_view text_of(const char* text) {
    return text != nullptr ? std::string_view(text) : std::string_view();
}

template <typename Message>
class RosLoan {
public:
    explicit RosLoan(dds_entity_t reader) : reader_(reader) {
        dds_sample_info_t info{};
        count_ = dds_take(reader, &sample_, &info, 1, 1);
        is_valid_ = count_ == 1 && info.valid_data;
    }
    ~RosLoan() {
        if (count_ > 0) static_cast<void>(dds_return_loan(reader_, &sample_, count_));
    }
    RosLoan(const RosLoan&) = delete;
    RosLoan& operator=(const RosLoan&) = delete;
    // Something was there, if only that a publisher has gone.
    [[nodiscard]] bool is_any() const { return count_ > 0; }
    [[nodiscard]] const Message* message() const { return is_valid_ ? static_cast<const Message*>(sample_) : nullptr; }

private:
    dds_entity_t reader_;
    void* sample_ = nullptr;
    dds_return_t count_ = 0;
    bool is_valid_ = false;
};

}  // namespace stillmesh
