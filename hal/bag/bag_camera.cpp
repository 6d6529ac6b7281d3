#include "hal/bag/bag_camera.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <utility>

#include "hal/bag/bag_calibration.hpp"
#include "hal/bag/bag_file.hpp"
#include "hal/bag/bag_files.hpp"
#include "hal/bag/bag_images.hpp"
#include "hal/bag/bag_reader.hpp"
#include "hal/bag/image_pairer.hpp"
#include "hal/bag/topic_choice.hpp"
#include "hal/live/depth_registration.hpp"
#include "hal/replay/one_view.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kTriedMax = 300;     // images of each stream before the first pair
constexpr std::size_t kMessagesMax = 200;  // of a poll: whoever polls may want to stop
constexpr std::size_t kEarlyMax = 20;      // sentences that are kept

[[nodiscard]] std::string size_text(const ImageSize& size) {
    return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace

struct BagCamera::Inside {
    explicit Inside(BagOptions o) : options(std::move(o)) {}

    [[nodiscard]] Status open_bag();
    [[nodiscard]] Status choose_topics();
    [[nodiscard]] Status check_sizes(const TopicSurvey& survey);
    [[nodiscard]] Status find_first_pair();
    [[nodiscard]] Status read_message(ImagePairer::Stream& stream, std::int64_t& time_ns);
    [[nodiscard]] Status next_frame(Frame& frame);
    [[nodiscard]] Status give(const WaitingImage& colour, const WaitingImage& depth, Frame& frame);
    [[nodiscard]] const std::string& name_of(std::uint32_t place) { return bag.topics()[place].name; }
    void account();

    BagOptions options;
    std::string message;
    CameraInfo info;
    std::string source;  // of the calibration
    BagCounts counts;
    std::vector<std::string> files, notes;
    std::vector<std::string> early;  // what was damaged before the first pair: told by the first polls
    std::vector<BagTopic> topics;    // that the beginning of the bag showed
    BagSequence bag;
    TopicChoice choice;
    std::optional<ImagePairer> pairer;
    const WaitingImage* first_colour = nullptr;  // found in open()
    const WaitingImage* first_depth = nullptr;
    ImageSize size, depth_size;
    ImageKind kind = ImageKind::kGrey8;
    std::vector<std::uint8_t> colour_pixels, unpacked;
    std::vector<std::uint16_t> depth_pixels, depth_read;  // the latter as it is, if it is not as colour; else empty
    std::optional<DepthRegistration> registration;
    bool is_open = false, is_over = false;
};

Status BagCamera::Inside::open_bag() {
    counts = {};
    notes.clear();
    early.clear();
    is_over = false;
    first_colour = first_depth = nullptr;
    STILLMESH_TRY(files_of_bag(options.path, files, message));
    STILLMESH_TRY(choose_topics());
    pairer.emplace(options.association_gap_max_ns, kWaitingBytesMax);
    bag = BagSequence();
    // The same topics at the same places, whatever the files have in another order.
    for (const BagTopic& topic : topics) static_cast<void>(bag.topics().place_of(topic.name, topic.type, topic.layout));
    bag.topics().want(std::array{choice.colour, choice.depth});
    STILLMESH_TRY(bag.open(files, message));
    return find_first_pair();
}

Status BagCamera::Inside::choose_topics() {
    bag = BagSequence();
    if (const Status status = bag.open(files, message); status != Status::kOk) return status;
    const bool needs_info = !options.camera && options.calibration.empty();
    TopicSurvey survey(bag.topics(), options.topics, needs_info);
    BagMessage read;
    std::string damage;
    for (Status status = Status::kOk; status != Status::kEnd && !survey.is_enough();) {
        status = bag.next(read, damage);
        if (status == Status::kOk && unpack_message(read.bytes, unpacked)) survey.take(read);
    }
    if (const Status status = survey.choose(choice, message); status != Status::kOk) {
        message = options.path + ": " + message + (damage.empty() ? "" : " " + damage);
        return status;
    }
    topics = bag.topics().all();
    BagCalibration calibration;
    STILLMESH_TRY(calibrate(options, bag.topics(), survey, choice, calibration, message));
    info = calibration.info;
    source = calibration.source;
    notes = calibration.notes;
    return check_sizes(survey);
}

Status BagCamera::Inside::check_sizes(const TopicSurvey& survey) {
    size = survey.seen(choice.colour)->size;
    depth_size = survey.seen(choice.depth)->size;
    if (size.width > options.width_max || size.height > options.height_max) {
        message = options.path + ": topic " + name_of(choice.colour) + ": the images are " + size_text(size) +
                  ", at most " + size_text({options.width_max, options.height_max}) +
                  " are taken; scale the recording down.";
        return Status::kInvalid;
    }
    if (!info.separate_depth && !is_of_one_view(size, depth_size)) {
        message = options.path + ": depth is " + size_text(depth_size) + " but colour is " + size_text(size) +
                  "; record depth that is registered to colour.";
        return Status::kInvalid;
    }
    CameraModel& model = info.model;
    if (model.width == 0) {
        model.width = size.width;
        model.height = size.height;
    }
    if (model.width != size.width || model.height != size.height) {
        message = source + ": is for " + size_text({model.width, model.height}) + " pixels, the images are " +
                  size_text(size) + "; give the calibration of these images.";
        return Status::kInvalid;
    }
    const std::size_t pixels = std::size_t{size.width} * size.height;
    depth_pixels.assign(pixels, 0);
    registration.reset();
    if (info.separate_depth) {
        registration.emplace(info.separate_depth->model, model, info.separate_depth->colour_from_depth,
                             info.depth_units_per_m);
        info.separate_depth.reset();
    }
    const bool is_as_colour = !registration && size == depth_size;
    depth_read.assign(is_as_colour ? 0 : std::size_t{depth_size.width} * depth_size.height, 0);
    notes.push_back("colour is " + name_of(choice.colour) + ", depth " + name_of(choice.depth) + ".");
    if (!registration && size != depth_size) {
        notes.push_back("depth is " + size_text(depth_size) + ", colour " + size_text(size) +
                        ": taken for the same view, the nearest pixel counts.");
    }
    return Status::kOk;
}

// Refuses a bag without pairs before anything is tracked.
Status BagCamera::Inside::find_first_pair() {
    std::array<std::vector<ListedImage>, 2> times;
    while (!pairer->next(first_colour, first_depth)) {
        ImagePairer::Stream stream{};
        std::int64_t time_ns = 0;
        const bool was_over = is_over;  // then the pairer has given all that it had
        const Status status = was_over ? Status::kEnd : read_message(stream, time_ns);
        if (status == Status::kOk && times[stream].size() < kTriedMax) times[stream].push_back({time_ns, 0, 0});
        if (status == Status::kCorrupt && early.size() < kEarlyMax) early.push_back(message);
        const bool is_hopeless = times[0].size() >= kTriedMax && times[1].size() >= kTriedMax;
        if (!was_over && !is_hopeless) continue;
        first_colour = first_depth = nullptr;
        const auto is_before = [](const ListedImage& a, const ListedImage& b) { return a.time_ns < b.time_ns; };
        for (std::vector<ListedImage>& list : times) std::sort(list.begin(), list.end(), is_before);
        message =
            options.path + ": " +
            (times[0].empty() || times[1].empty() ? std::string("no image of one of the two topics can be used.")
                                                  : why_no_pairs(times[0], times[1], options.association_gap_max_ns));
        return Status::kInvalid;
    }
    return Status::kOk;
}

// The next image to the pairer. kOk, kEnd; kCorrupt: nothing of it can be used.
Status BagCamera::Inside::read_message(ImagePairer::Stream& stream, std::int64_t& time_ns) {
    BagMessage read;
    const Status status = bag.next(read, message);
    if (status == Status::kEnd) {
        is_over = true;
        pairer->end();
        return status;
    }
    if (status != Status::kOk) {
        ++counts.damages;
        return Status::kCorrupt;
    }
    MessageHeader header;
    const BagTopic& topic = bag.topics()[read.topic];
    if (!unpack_message(read.bytes, unpacked) || !stillmesh::read_message(read.bytes, topic.layout, header)) {
        message = options.path + ": topic " + topic.name + ": a message that is no image: passed over.";
        ++counts.damages;
        return Status::kCorrupt;
    }
    stream = read.topic == choice.colour ? ImagePairer::kColour : ImagePairer::kDepth;
    ++(stream == ImagePairer::kColour ? counts.colour_images : counts.depth_images);
    time_ns = header.stamp_ns != 0 ? header.stamp_ns : read.time_ns;  // not stamped: when it was recorded
    if (stream == ImagePairer::kDepth) time_ns -= options.depth_offset_ns;
    pairer->add(stream, std::max<std::int64_t>(time_ns, 0), read.bytes);
    return Status::kOk;
}

Status BagCamera::Inside::next_frame(Frame& frame) {
    if (!early.empty()) {
        message = early.front();
        early.erase(early.begin());
        return Status::kCorrupt;
    }
    const WaitingImage* colour = std::exchange(first_colour, nullptr);
    const WaitingImage* depth = std::exchange(first_depth, nullptr);
    for (std::size_t messages = 0; colour == nullptr && !pairer->next(colour, depth); ++messages) {
        if (is_over) return Status::kEnd;
        if (messages == kMessagesMax) return Status::kTimedOut;
        ImagePairer::Stream stream{};
        std::int64_t time_ns = 0;
        if (read_message(stream, time_ns) == Status::kCorrupt) return Status::kCorrupt;
    }
    return give(*colour, *depth, frame);
}

Status BagCamera::Inside::give(const WaitingImage& colour, const WaitingImage& depth, Frame& frame) {
    ++counts.frames;
    counts.pair_gap_longest_ns = std::max(counts.pair_gap_longest_ns, std::abs(depth.time_ns - colour.time_ns));
    BagImage image;
    const BagTopic& colour_topic = bag.topics()[choice.colour];
    const BagTopic& depth_topic = bag.topics()[choice.depth];
    STILLMESH_TRY(read_bag_image(colour_topic, colour.bytes, image, message));
    const auto is_as_before = [&](const std::string& topic, const ImageSize& expected, bool is_right_kind) {
        if (image.size == expected && is_right_kind) return true;
        message = "topic " + topic + ": the image is " + size_text(image.size) + " (" +
                  std::string(image.encoding.substr(0, 40)) + "), the first was " + size_text(expected) +
                  "; all images of a stream must be of one size and kind.";
        return false;
    };
    if (!is_as_before(colour_topic.name, size, is_colour(image.coding))) return Status::kCorrupt;
    kind = image.kind;
    colour_pixels.resize(std::size_t{size.width} * size.height * bytes_per_pixel(kind));
    STILLMESH_TRY(stillmesh::colour_pixels(image, colour_topic.name, colour_pixels, message));
    STILLMESH_TRY(read_bag_image(depth_topic, depth.bytes, image, message));
    if (!is_as_before(depth_topic.name, depth_size, is_depth(image.coding))) return Status::kCorrupt;
    std::vector<std::uint16_t>& read = depth_read.empty() ? depth_pixels : depth_read;
    STILLMESH_TRY(stillmesh::depth_pixels(image, depth_topic.name, info.depth_units_per_m, read, message));
    if (registration) {
        registration->reproject({depth_read.data(), depth_size.width, depth_size.height, depth_size.width},
                                depth_pixels.data());
    } else if (!depth_read.empty()) {
        resize_depth(depth_read, depth_size, depth_pixels, size);
    }
    frame.time_ns = colour.time_ns;
    frame.depth_time_ns = depth.time_ns;
    frame.format = kind == ImageKind::kRgb8 ? PixelFormat::kRgb8 : PixelFormat::kGrey8;
    frame.colour = {colour_pixels.data(), size.width, size.height, std::size_t{size.width} * channels_of(frame.format)};
    frame.depth = {depth_pixels.data(), size.width, size.height, size.width};
    frame.depth_units_per_m = info.depth_units_per_m;
    return Status::kOk;
}

void BagCamera::Inside::account() {
    if (!pairer) return;
    counts.lonely_colour = pairer->counts().lonely_colour;
    counts.times_back = pairer->counts().times_back;
}

BagCamera::BagCamera(BagOptions options) : inside_(std::make_unique<Inside>(std::move(options))) {}
BagCamera::~BagCamera() = default;

Status BagCamera::open() noexcept {
    close();
    inside_->message.clear();
    try {
        const Status status = inside_->open_bag();
        inside_->is_open = status == Status::kOk;
        if (inside_->is_open) inside_->message.clear();
        // A torn bag is refused as one that cannot be used, whatever piece was met.
        return status == Status::kCorrupt ? Status::kInvalid : status;
    } catch (const std::exception& error) {
        close();
        inside_->message = inside_->options.path + ": cannot be opened: " + error.what() + ".";
        return Status::kUnavailable;
    }
}

const CameraInfo& BagCamera::info() const noexcept {
    STILLMESH_CHECK(inside_->is_open);
    return inside_->info;
}

Status BagCamera::poll(Frame& frame) noexcept {
    if (!inside_->is_open) return Status::kUnavailable;
    inside_->message.clear();
    try {
        const Status status = inside_->next_frame(frame);
        inside_->account();
        // An image of another kind than the first is broken input as well, not a question of configuration.
        return status == Status::kInvalid ? Status::kCorrupt : status;
    } catch (const std::exception& error) {
        inside_->message = inside_->options.path + ": cannot be read: " + error.what() + ".";
        return Status::kUnavailable;
    }
}

Status BagCamera::wait(std::uint32_t) noexcept {
    return inside_->is_open ? Status::kOk : Status::kUnavailable;
}

void BagCamera::close() noexcept {
    inside_->is_open = false;
    inside_->bag = BagSequence();
    inside_->pairer.reset();
    inside_->first_colour = inside_->first_depth = nullptr;
}

const std::string& BagCamera::message() const noexcept {
    return inside_->message;
}
const BagCounts& BagCamera::counts() const noexcept {
    return inside_->counts;
}
const std::string& BagCamera::calibration_source() const noexcept {
    return inside_->source;
}
std::vector<std::string> BagCamera::notes() const {
    return inside_->notes;
}

std::vector<std::string> BagCamera::closing_notes() const {
    const BagCounts& counts = inside_->counts;
    std::vector<std::string> out;
    if (counts.lonely_colour > 0) {
        out.push_back(std::to_string(counts.lonely_colour) + " of " + std::to_string(counts.colour_images) +
                      " colour images have no depth image within " +
                      std::to_string(inside_->options.association_gap_max_ns / 1'000'000) + " ms: skipped.");
    }
    if (counts.times_back > 0) {
        out.push_back(std::to_string(counts.times_back) +
                      " images have a time that repeats or goes backwards: skipped.");
    }
    constexpr std::int64_t kUsual_ns = 20'000'000;
    if (counts.pair_gap_longest_ns > kUsual_ns) {
        char text[160];
        std::snprintf(text, sizeof(text),
                      "images of one frame are up to %.1f ms apart; what moved meanwhile is not where its depth is.",
                      static_cast<double>(counts.pair_gap_longest_ns) * 1e-6);
        out.emplace_back(text);
    }
    if (inside_->bag.is_unclosed()) {
        out.emplace_back("the bag was never closed (its recorder was stopped by force?); what it holds was played.");
    }
    return out;
}

}  // namespace stillmesh
