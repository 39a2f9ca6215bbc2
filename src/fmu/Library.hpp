#pragma once

#include <string>

namespace amiss::fmu {

/// A dynamic library, loaded when made and never unloaded: libraries of strangers often do not survive that.
class Library {
 public:
  /// Loads the library at an absolute path, with its own initialisers: what it brings runs from here on.
  /// Throws std::runtime_error with the loader's words.
  explicit Library(const std::string& path);

  /// The function of this name. Throws std::runtime_error if there is none.
  template <class Function>
  Function* function(const char* name) const {
    return reinterpret_cast<Function*>(address(name));
  }

 private:
  void* address(const char* name) const;

  std::string path_;
  void* handle_;
};

}  // namespace amiss::fmu
