#pragma once

#include <string>

namespace amiss::fmu {

/// The URI (RFC 3986, RFC 8089) of an absolute path in UTF-8: `file:///tmp/a%20b`. Of Windows, `C:\a` is
/// `file:///C:/a`.
std::string resource_uri(const std::string& path);

}  // namespace amiss::fmu
