# Fails when ctest finds fewer than MINIMUM tests in the build folder FOLDER, so that tests cannot vanish unseen.
execute_process(COMMAND ${CTEST} -N WORKING_DIRECTORY ${FOLDER} OUTPUT_VARIABLE listing COMMAND_ERROR_IS_FATAL ANY)
if(NOT listing MATCHES "Total Tests: ([0-9]+)")
  message(FATAL_ERROR "ctest -N gave no number of tests:\n${listing}")
endif()
math(EXPR found "${CMAKE_MATCH_1} - 1") # this check is a test itself
if(found LESS MINIMUM)
  message(FATAL_ERROR "${found} tests found, at least ${MINIMUM} expected (AMISS_MINIMUM_TESTS in CMakeLists.txt)")
endif()
message(STATUS "${found} tests found, at least ${MINIMUM} expected")
