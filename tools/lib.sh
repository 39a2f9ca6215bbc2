# Shared by the scripts in tools/ and .ci/ (sourced, not run): where things are, and how the package is installed.
# Everything these scripts make lies in build/ and demo/ of the clone.

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
library="$root/build/library"  # the package, and packages that the system lacks
export LC_ALL=C.UTF-8
export NOT_CRAN="${NOT_CRAN:-true}"  # testthat's word for "all tests": figures by snapshot and the second tier too
export R_LIBS="$library${R_LIBS:+:$R_LIBS}"

say() { printf '\n== %s\n' "$*"; }
fail() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; exit 1; }

# Installs the package into build/library from a copy of the sources, so that the clone stays clean; for this machine's
# processor, or, where AMISS_NATIVE is set and empty, as R CMD INSTALL alone does; with "portable" into
# build/portable/library as R CMD INSTALL alone does; with "blas" into build/blas/library, for this processor and with
# R's BLAS. Does nothing where the same files are installed already. Objects are kept from one run to the next; make
# does not follow headers, so they are dropped when a header, the build's own files, which sources there are or R have
# changed.
install_package() {
  local copy="$root/build/package" library="$library" native="${AMISS_NATIVE-1}" blas= state whole
  if [[ $# -gt 0 ]]; then
    copy="$root/build/$1/package"
    library="$root/build/$1/library"
    [[ "$1" == portable ]] && native=
    [[ "$1" == blas ]] && blas=1
  fi
  mkdir -p "$library" "$copy"
  find "$copy" -mindepth 1 -maxdepth 1 ! -name src ! -name .state -exec rm -rf {} +
  [[ ! -d "$copy/src" ]] || find "$copy/src" -type f ! -name '*.o' -delete  # sources that are no more
  tar -C "$root" -c --exclude='*.o' --exclude='*.so' --exclude=./{build,demo,.git,tests,tools,bench} . |
    tar -C "$copy" -x
  [[ ! -d "$root/build/doc" ]] || cp -r "$root/build/doc" "$copy/inst/doc"  # see tools/vignettes
  state="$(cd "$copy" && { printf '%s\n' "$native" "$blas"; R --version; g++ --version; grep LinkingTo DESCRIPTION; cat src/Makevars "$root/tools/Makevars";
    find src -name '*.cpp' | sort; find src -name '*.hpp' -o -name '*.h' | sort | xargs cat; } | sha256sum)"
  if [[ "$(cat "$copy/.state" 2>/dev/null)" != "$state" ]]; then
    find "$copy/src" -name '*.o' -delete
    printf '%s\n' "$state" > "$copy/.state"
  fi
  # What is installed from the very same files stays as it is.
  whole="$(cd "$copy" && { printf '%s\n' "$state" "${R_KEEP_PKG_SOURCE:-}"
    find . -type f ! -name '*.o' ! -name '*.so' ! -path ./.state | sort | xargs sha256sum; } | sha256sum)"
  if [[ "$(cat "$library/.amiss" 2>/dev/null)" == "$whole" && -f "$library/amiss/Meta/package.rds" &&
    ! "$library/amiss/Meta/package.rds" -nt "$library/.amiss" ]]; then return; fi
  rm -rf "$library/00LOCK-package" "$library/.amiss"
  AMISS_NATIVE=$native AMISS_BLAS=$blas MAKEFLAGS="${MAKEFLAGS:--j2}" R_MAKEVARS_USER="${R_MAKEVARS_USER:-$root/tools/Makevars}" R CMD INSTALL --no-multiarch --library="$library" "$copy" > "$root/build/install.log" 2>&1 ||
    { cat "$root/build/install.log" >&2; fail "the package could not be installed"; }
  printf '%s\n' "$whole" > "$library/.amiss"
}
