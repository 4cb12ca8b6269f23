# Rewrites version.cpp if the version or the commit has changed. Every build runs this. Outside a git
# checkout the commit is unknown.
#
#   cmake -DSOURCE=... -DVERSION=... -DOUTPUT=... -P commit.cmake
set(COMMIT unknown)
find_program(git git)
if(git)
  execute_process(COMMAND ${git} -C ${SOURCE} rev-parse --show-toplevel
    OUTPUT_VARIABLE top OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  file(REAL_PATH "${SOURCE}" source)
  if(top STREQUAL source)
    execute_process(COMMAND ${git} -C ${SOURCE} describe --always --abbrev=10 --exclude=* --dirty=+
      OUTPUT_VARIABLE found RESULT_VARIABLE failed OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(failed EQUAL 0)
      set(COMMIT ${found})
    endif()
  endif()
endif()
configure_file(${SOURCE}/app/version.cpp.in ${OUTPUT} @ONLY)
