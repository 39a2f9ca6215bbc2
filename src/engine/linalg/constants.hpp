#pragma once

namespace amiss {

constexpr double kPi = 3.14159265358979323846;
constexpr double kLogTwoPi = 1.83787706640934548356;

}  // namespace amiss
