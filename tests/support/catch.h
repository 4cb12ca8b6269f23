// tests: hides the difference between Catch2 versions 2 and 3.
#pragma once

#if __has_include(<catch2/catch.hpp>)
// Assertions without an exception handler each: an exception ends the test case instead of the
// assertion, and compilation takes 7 % less time.
#define CATCH_CONFIG_FAST_COMPILE
#include <catch2/catch.hpp>
#else
#include <catch2/catch_all.hpp>
using Catch::Approx;
#endif
