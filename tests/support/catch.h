// tests: the one place that knows which Catch2 is installed, 2 or 3.
#pragma once

#if __has_include(<catch2/catch.hpp>)
// Assertions without a handler of exceptions each: a test that throws ends its case, not its line,
// and all of them are compiled in a fourteenth less time.
#define CATCH_CONFIG_FAST_COMPILE
#include <catch2/catch.hpp>
#else
#include <catch2/catch_all.hpp>
using Catch::Approx;
#endif
