#pragma once

#include <string>

/// What a process does that runs an FMU for another one.
namespace amiss::fmu {

/// Ends this process, and its group if it leads one, within a second of the end of its parent, whatever it
/// does then. On Windows the job that it was started in does that.
void end_with_parent(int parent);

/// Lets a crash end this process at once, without R's own account of it.
void end_when_crashed();

/// A file descriptor for what goes to the parent; what is printed to the standard output goes to the standard
/// error from now on.
int separate_output();

/// Writes a line to a file descriptor. Throws std::runtime_error if nobody reads.
void write_line(int descriptor, const std::string& line);

/// Empties the file that is the standard error, if it is one.
void empty_standard_error();

}  // namespace amiss::fmu
