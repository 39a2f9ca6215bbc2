#include "fmu/resource_uri.hpp"

#include <cstdio>
#include <cstring>

namespace amiss::fmu {

std::string resource_uri(const std::string& path) {
  std::string uri = path.rfind('/', 0) == 0 ? "file://" : "file:///";
  for (const char sign : path) {
    const bool letter =
        (sign >= 'a' && sign <= 'z') || (sign >= 'A' && sign <= 'Z') || (sign >= '0' && sign <= '9');
    if (letter || (sign != '\0' && std::strchr("/-._~:", sign) != nullptr)) {
      uri += sign;
    } else if (sign == '\\') {
      uri += '/';
    } else {
      char code[4];
      std::snprintf(code, sizeof code, "%%%02X", static_cast<unsigned char>(sign));
      uri += code;
    }
  }
  return uri;
}

}  // namespace amiss::fmu
