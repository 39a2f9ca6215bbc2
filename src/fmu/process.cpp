#include "fmu/process.hpp"

#include <chrono>
#include <csignal>
#include <cstdio>
#include <stdexcept>
#include <thread>

#ifdef _WIN32
#include <io.h>
#else
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

namespace amiss::fmu {

#ifdef _WIN32

void end_with_parent(int) {}

void end_when_crashed() {
  for (const int crash : {SIGSEGV, SIGILL}) std::signal(crash, SIG_DFL);
}

int separate_output() {
  const int descriptor = _dup(1);
  _dup2(2, 1);
  return descriptor;
}

void write_line(int descriptor, const std::string& line) {
  const std::string text = line + "\n";
  if (_write(descriptor, text.data(), static_cast<unsigned>(text.size())) != static_cast<int>(text.size()))
    throw std::runtime_error("fmu: nobody reads what is written");
}

void empty_standard_error() {
  std::fflush(stderr);
  if (_lseek(2, 0, SEEK_SET) == 0) _chsize(2, 0);
}

#else

void end_with_parent(int parent) {
  std::thread([parent] {
    while (getppid() == parent) std::this_thread::sleep_for(std::chrono::milliseconds(200));
    if (getpgrp() == getpid()) kill(0, SIGKILL);
    kill(getpid(), SIGKILL);
  }).detach();
}

void end_when_crashed() {
  for (const int crash : {SIGSEGV, SIGBUS, SIGILL}) std::signal(crash, SIG_DFL);
}

int separate_output() {
  // Closed in programs that the FMU starts: the parent would take them for the FMU.
  const int descriptor = fcntl(1, F_DUPFD_CLOEXEC, 3);
  if (descriptor < 0 || dup2(2, 1) < 0) throw std::runtime_error("fmu: there is no standard output");
  return descriptor;
}

void write_line(int descriptor, const std::string& line) {
  const std::string text = line + "\n";
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t written = write(descriptor, text.data() + done, text.size() - done);
    if (written <= 0) throw std::runtime_error("fmu: nobody reads what is written");
    done += static_cast<std::size_t>(written);
  }
}

void empty_standard_error() {
  struct stat status;
  std::fflush(stderr);
  if (fstat(2, &status) != 0 || !S_ISREG(status.st_mode)) return;
  if (ftruncate(2, 0) == 0) lseek(2, 0, SEEK_SET);
}

#endif

}  // namespace amiss::fmu
