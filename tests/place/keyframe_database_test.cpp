#include "engine/place/keyframe_database.hpp"

#include <gtest/gtest.h>
