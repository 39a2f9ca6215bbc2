#include "fmu/Library.hpp"

#include <stdexcept>

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

namespace amiss::fmu {

namespace {

#ifdef _WIN32

// Libraries beside it are found, too.
void* load(const std::string& path) {
  return reinterpret_cast<void*>(LoadLibraryExA(path.c_str(), nullptr, LOAD_WITH_ALTERED_SEARCH_PATH));
}

void* find(void* handle, const char* name) {
  return reinterpret_cast<void*>(GetProcAddress(reinterpret_cast<HMODULE>(handle), name));
}

std::string loader_words() { return "error " + std::to_string(GetLastError()); }

#else

void* load(const std::string& path) { return dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL); }

void* find(void* handle, const char* name) { return dlsym(handle, name); }

std::string loader_words() {
  const char* words = dlerror();
  return words == nullptr ? "no reason given" : words;
}

#endif

}  // namespace

Library::Library(const std::string& path) : path_(path), handle_(load(path)) {
  if (handle_ == nullptr) throw std::runtime_error("its library cannot be loaded: " + loader_words());
}

void* Library::address(const char* name) const {
  void* found = find(handle_, name);
  if (found == nullptr) throw std::runtime_error("its library has no function " + std::string(name));
  return found;
}

}  // namespace amiss::fmu
