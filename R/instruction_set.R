# The compiled code comes twice on x86-64 (src/Makevars). Where the processor has AVX2 and FMA, and
# the environment variable AMISS_SIMD is not "baseline", the routines of the second library take the
# place of the first one's.

avx2_library <- "amiss_avx2"

.onLoad <- function(libname, pkgname) {
  file <- file.path(libname, pkgname, "libs", .Platform$r_arch,
                    paste0(avx2_library, .Platform$dynlib.ext))
  if (!file.exists(file) || Sys.getenv("AMISS_SIMD") == "baseline" || !cpu_has_avx2_())
    return(invisible())
  routines <- getDLLRegisteredRoutines(library.dynam(avx2_library, pkgname, libname))$.Call
  for (routine in routines) {
    # R CMD check takes a library of another name for another package
    routine$dll[["name"]] <- pkgname
    assign(routine$name, routine, envir = topenv())
  }
}

.onUnload <- function(libpath) {
  if (avx2_library %in% names(getLoadedDLLs())) library.dynam.unload(avx2_library, libpath)
  library.dynam.unload("amiss", libpath)
}

# "AVX2" or "baseline": which library's routines are called. A library compiled for one processor
# alone is "baseline" too.
instruction_set <- function() {
  library <- tools::file_path_sans_ext(basename(`_amiss_cpu_has_avx2_`$dll[["path"]]))
  if (library == avx2_library) "AVX2" else "baseline"
}
