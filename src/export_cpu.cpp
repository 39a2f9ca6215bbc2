#include <Rcpp.h>

// Whether this processor runs code with AVX2 and FMA instructions.
// [[Rcpp::export]]
bool cpu_has_avx2_() {
#if defined(__x86_64__) && defined(__GNUC__)
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
  return false;
#endif
}
