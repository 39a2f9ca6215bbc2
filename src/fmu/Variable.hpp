#pragma once

#include <cstdint>

namespace amiss::fmu {

/// Types of variables by their names in FMI 3.0. Of FMI 2.0 Real is float64, Integer and Enumeration are
/// int32; an Enumeration of FMI 3.0 is int64.
enum class Type {
  float64,
  float32,
  int8,
  uint8,
  int16,
  uint16,
  int32,
  uint32,
  int64,
  uint64,
  boolean,
  string
};

/// A scalar variable, as the functions of an FMU know it.
struct Variable {
  std::uint32_t reference = 0;
  Type type = Type::float64;
};

}  // namespace amiss::fmu
