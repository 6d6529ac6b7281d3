#include "engine/place/bag_of_words.hpp"

#include <gtest/gtest.h>
