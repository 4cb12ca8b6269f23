# System tests with real servers. They share one JACK server name, so they run one after the other.
# They start first, beside the other tests, because they mostly wait.
add_library(rtspy MODULE system/rtspy.cpp)
target_compile_options(rtspy PRIVATE -Wno-conversion -Wno-nonnull-compare)
target_link_libraries(rtspy PRIVATE PkgConfig::JACK ${CMAKE_DL_LIBS})

add_ressort_tests(ressort_server_tests system/server_test.cpp system/callback_test.cpp
  system/connections_test.cpp system/controllers_test.cpp system/nsm_test.cpp system/soak_test.cpp)
target_link_libraries(ressort_server_tests PRIVATE PkgConfig::JACK PkgConfig::LIBLO Threads::Threads)
target_compile_definitions(ressort_server_tests PRIVATE
  RESSORT_PROGRAM="$<TARGET_FILE:ressort>" RESSORT_SPY="$<TARGET_FILE:rtspy>"
  RESSORT_SOURCE="${CMAKE_SOURCE_DIR}")
ressort_compile_like(ressort_server_tests ressort_tests)
add_dependencies(ressort_server_tests ressort rtspy)

# A sanitizer has its own malloc, which the spy library cannot replace.
set(server_tags controllers jack_midi shared_notes osc_time flood rtmidi alsa server_loss nsm)
if(NOT RESSORT_ADDRESS_SANITIZER AND NOT RESSORT_THREAD_SANITIZER)
  list(APPEND server_tags callback)
endif()
foreach(tag IN LISTS server_tags)
  add_test(NAME server_${tag} COMMAND ressort_server_tests "[${tag}]")
  set_tests_properties(server_${tag} PROPERTIES TIMEOUT 240 LABELS servers RESOURCE_LOCK jack
    COST 1000)
endforeach()

# Tests the panel's page in a real browser, with keys and pointer.
add_test(NAME server_panel COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/panel/panel_test.py
  $<TARGET_FILE:ressort> ${CMAKE_SOURCE_DIR})
set_tests_properties(server_panel PROPERTIES TIMEOUT 240 LABELS servers
  RESOURCE_LOCK jack COST 1000)

add_test(NAME command_line COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/system/command_line.sh
  $<TARGET_FILE:ressort> ${CMAKE_SOURCE_DIR})
set_tests_properties(command_line PROPERTIES TIMEOUT 240 LABELS integration COST 800)

# Checks that the examples of README.md and presets/README.md are audible.
add_test(NAME examples COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/system/examples $<TARGET_FILE:ressort>)
set_tests_properties(examples PROPERTIES TIMEOUT 240 LABELS integration)

# Compiles exported FAUST programs with faust and this C++ compiler.
add_ressort_tests(ressort_export_tests system/export_test.cpp)
target_link_libraries(ressort_export_tests PRIVATE ressort_test_support ressort_app)
target_compile_definitions(ressort_export_tests PRIVATE
  RESSORT_PROGRAM="$<TARGET_FILE:ressort>" RESSORT_CXX="${CMAKE_CXX_COMPILER}")
ressort_compile_like(ressort_export_tests ressort_tests)
add_dependencies(ressort_export_tests ressort)
add_test(NAME export COMMAND ressort_export_tests)
set_tests_properties(export PROPERTIES TIMEOUT 300 LABELS integration COST 800)
