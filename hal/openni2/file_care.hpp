// What OpenNI2's player and recorder of .oni files need so that they neither hang nor crash (docs/camera.md, traps).
#pragma once

#include <OpenNI.h>

#include <string>

namespace stillmesh::openni2 {

// Every image, each when the one before it was taken. Repeated, though nobody wants it twice: at its end the player's
// thread would look through the list of streams, without a lock, again and again, also while they are destroyed. So it
// waits with the first image.
[[nodiscard]] bool play_image_by_image(openni::PlaybackControl& playback);
// The player must be at rest before anything of it is taken away: its thread looks through the streams without a lock
// unless it waits to give out an image, and one that has not even begun is never told to end.
void rest_player(openni::VideoStream& colour, openni::VideoStream& depth, bool has_begun);
// Ends a recording whose streams are stopped. A driver's thread that brings an image holds the stream's lock and waits
// for the recorder's; who destroys the recorder meanwhile takes them the other way round, and both hang for ever. So
// first all is to be written: nothing has come into the file for a while.
void end_recording(openni::Recorder& recorder, const std::string& file);
// Why a file cannot be written, which OpenNI2 would not say; empty: it can, and is there and empty now.
[[nodiscard]] std::string why_not_writable(const std::string& file);

}  // namespace stillmesh::openni2
