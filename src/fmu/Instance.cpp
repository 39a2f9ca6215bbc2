#include "fmu/Instance.hpp"

#include <cmath>
#include <cstdint>
#include <limits>

namespace amiss::fmu {

namespace {

constexpr std::size_t most_messages = 10;
constexpr std::size_t longest_message = 500;

}  // namespace

void Log::add(const char* message) {
  std::string text = message == nullptr ? "" : message;
  if (text.size() > longest_message) text.resize(longest_message);
  messages_.push_back(text);
  if (messages_.size() > most_messages) messages_.pop_front();
}

std::unique_ptr<Instance> instantiate(const Library& library, const Origin& origin, Log& log) {
  return origin.version == 2 ? instantiate_2(library, origin, log) : instantiate_3(library, origin, log);
}

void check_status(int status, const std::string& what) {
  if (status <= 1) return;
  const char* named[] = {"discarded", "returned an error for", "returned a fatal error for", "left pending"};
  const std::string answer = status <= 5 ? named[status - 2] : "returned an unknown status for";
  throw Failure("it " + answer + " " + what, status >= 4);
}

template <class Whole>
Whole whole_number(double value) {
  const double rounded = std::nearbyint(value);
  // The largest number of 64 bits is none of double: what reaches it does not fit.
  const double below = std::ldexp(1.0, std::numeric_limits<Whole>::digits);
  const double lowest = static_cast<double>(std::numeric_limits<Whole>::lowest());
  if (!(rounded == value && rounded >= lowest && rounded < below))
    throw Failure(std::to_string(value) + " was given to a variable of whole numbers", false);
  return static_cast<Whole>(rounded);
}

template std::int8_t whole_number(double);
template std::uint8_t whole_number(double);
template std::int16_t whole_number(double);
template std::uint16_t whole_number(double);
template std::int32_t whole_number(double);
template std::uint32_t whole_number(double);
template std::int64_t whole_number(double);
template std::uint64_t whole_number(double);

}  // namespace amiss::fmu
