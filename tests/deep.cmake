# The second tier: tests that take minutes. They run one after the other after all other tests. A test
# that does not fit before RESSORT_DEADLINE is skipped. RESSORT_TURN rotates the order, so that all are
# reached in turn.
set(ressort_fuzzers model preset score midi smf scala console osc osc_packet flight panel)
list(TRANSFORM ressort_fuzzers PREPEND fuzz_ OUTPUT_VARIABLE ressort_deep_tests)
list(APPEND ressort_deep_tests arm everything_sanitized everything_more forms_everywhere
  accuracy_everywhere silence_everywhere modes_everywhere calculix_everywhere bodies_everywhere
  bells_everywhere heard_pitch_everywhere tuner_44100 tuner_48000 tuner_96000 restrikes_all
  command_line_all export_all thorough sixty_modes bench lint scenes_more abuse_long
  callback_minute bows settings_more edits_more
  flights_everywhere server_killed installed soak races)
list(LENGTH ressort_deep_tests ressort_deep_count)

# Adds a deep test that takes about SECONDS on two cores.
function(add_deep_test name seconds)
  add_test(NAME ${name} COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/part ${seconds} ${ARGN})
  list(FIND ressort_deep_tests ${name} place)
  math(EXPR cost "-1 - (${place} + ${RESSORT_TURN}) % ${ressort_deep_count}")
  set_tests_properties(${name} PROPERTIES LABELS deep TIMEOUT 7200 RUN_SERIAL TRUE COST ${cost}
    SKIP_RETURN_CODE 77)
endfunction()

# Fuzzers, built by clang, for some seconds each.
foreach(fuzzer IN LISTS ressort_fuzzers)
  add_deep_test(fuzz_${fuzzer} 90 ${CMAKE_CURRENT_SOURCE_DIR}/fuzz/run 40 ${fuzzer})
endforeach()

# Every model with the same sanitizers, and without, for longer, with more generated models.
add_deep_test(everything_sanitized 240 ${CMAKE_CURRENT_SOURCE_DIR}/system/sanitized 0.1 200)
add_deep_test(everything_more 240 $<TARGET_FILE:ressort_play_everything> 1 400 101)

# Compiles the engine for 64-bit ARM, and the program where its libraries are installed.
add_deep_test(arm 60 ${CMAKE_CURRENT_SOURCE_DIR}/arm.sh ${CMAKE_SOURCE_DIR}
  ${CMAKE_BINARY_DIR})

# All random networks in all forms on all instruction sets.
add_deep_test(forms_everywhere 240 $<TARGET_FILE:ressort_tests> "[forms_everywhere]")

# Two thousand random nonlinear scenes. RESSORT_SCENES selects others: FIRST,COUNT,FRAMES[,LINKS].
add_deep_test(scenes_more 200 ${CMAKE_COMMAND} -E env RESSORT_SCENES=1001,2000,1024
  $<TARGET_FILE:ressort_tests> "[scenes]")

# The pitch of every tuned preset, measured on the sound over the keyboard at three rates.
add_deep_test(heard_pitch_everywhere 120 $<TARGET_FILE:ressort_tests> "[heard_pitch_everywhere]")

# Every key of all melodic presets.
set(ressort_tuned BarMetals BassGuitar BellThirds Bourdon BowedString BrokenString Celesta
  CelestaBar Cello ChurchBell CoupledStrings DoubleBass Dulcimer ElectricGuitar GlassHarmonica
  Glockenspiel Guitar HandBell Harp Harpsichord IPlayTheTriangle Kalimba Koto MajorBell Marimba
  MarimbaTube MusicBox MutedBass NylonGuitar Oud Piano PluckedHarmonics PolyTriangle Resonator Sitar
  SixStructures SlidingFret SteelDrum SteelGuitar TibetanBowl Vibraphone Viola Violin Xylophone)
foreach(rate IN ITEMS 44100 48000 96000)
  math(EXPR seconds "${rate} / 100")
  add_deep_test(tuner_${rate} ${seconds} $<TARGET_FILE:ressort_voicing> --tuner ${rate}
    ${ressort_tuned})
endforeach()

# Exports at all rates.
add_deep_test(export_all 60 ${CMAKE_COMMAND} -E env RESSORT_THOROUGH=1
  $<TARGET_FILE:ressort_export_tests>)

# A soft strike on a ringing note of each preset.
add_deep_test(restrikes_all 30 $<TARGET_FILE:ressort_voicing> --restrikes 60
  ${ressort_all_restruck})

# The complete version of a test that the first tier shortens.
add_deep_test(command_line_all 90 ${CMAKE_COMMAND} -E env RESSORT_THOROUGH=1
  ${CMAKE_CURRENT_SOURCE_DIR}/system/command_line.sh $<TARGET_FILE:ressort> ${CMAKE_SOURCE_DIR})

# Masses and bodies one per cent below and above the stability limit.
add_deep_test(bodies_everywhere 60 $<TARGET_FILE:ressort_tests> "[bodies_everywhere]")

# The modes of 208 random networks compared with their sound, and the lowest of 100,000 masses.
add_deep_test(modes_everywhere 60 $<TARGET_FILE:ressort_tests> "[modes_everywhere]")

# Pitch and decay budgets on 300 random networks.
add_deep_test(accuracy_everywhere 120 $<TARGET_FILE:ressort_tests> "[accuracy_everywhere]")

# The silence budget on 200 random networks.
add_deep_test(silence_everywhere 120 $<TARGET_FILE:ressort_tests> "[silence_everywhere]")

# Forty random solids compared with CalculiX.
add_deep_test(calculix_everywhere 600 $<TARGET_FILE:ressort_tests> "[calculix_everywhere]")

# The partials of the bells compared with solids of the same profile.
add_deep_test(bells_everywhere 300 $<TARGET_FILE:ressort_tests> "[bells_everywhere]")

# A JACK server that ends twenty times, under connections and under an overloaded program, and
# returns with other rates and periods.
add_deep_test(server_killed 210 ${CMAKE_COMMAND} -E env RESSORT_KILLS=20
  $<TARGET_FILE:ressort_server_tests> "[server_loss]")

# A minute of every operation that reaches the callback.
if(callback IN_LIST server_tags)
  add_deep_test(callback_minute 70 ${CMAKE_COMMAND} -E env RESSORT_CALLBACK_SECONDS=60
    $<TARGET_FILE:ressort_server_tests> "[callback]")
endif()

# Three minutes of random playing on all presets. tests/soak runs longer.
add_deep_test(soak 220 ${CMAKE_COMMAND} -E env RESSORT_SOAK_MINUTES=3
  $<TARGET_FILE:ressort_server_tests> "[soak]")

# Installs the Debian package in a clean root.
add_deep_test(installed 180 ${CMAKE_CURRENT_SOURCE_DIR}/system/installed ${CMAKE_BINARY_DIR})

# Compares the flight of every preset bit by bit.
add_deep_test(flights_everywhere 60 $<TARGET_FILE:ressort_tests> "[flights_everywhere]")

# A thousand edits of playing models, some of them invalid.
add_deep_test(edits_more 300 ${CMAKE_COMMAND} -E env RESSORT_EDITS=1000
  $<TARGET_FILE:ressort_tests> "[reload]")

# Every bow at every speed and pressure on 24 keys.
add_deep_test(bows 120 $<TARGET_FILE:ressort_voicing> --bows 8 Violin Viola Cello DoubleBass)

# A note at random settings of all controls of each preset. RESSORT_SETTINGS sets the number.
add_deep_test(settings_more 600 sh -c
  "exec $<TARGET_FILE:ressort_voicing> --random \${RESSORT_SETTINGS:-200}")

# The complete version of tests that the first tier shortens (tests/support/thorough.h).
add_deep_test(thorough 240 ${CMAKE_COMMAND} -E env RESSORT_THOROUGH=1 $<TARGET_FILE:ressort_tests>
  "[ask],[heard_pitch],[hybrids],[identify]~[sixty_modes],[models],[modes_passive],[notes_heard],\
[session],[solid_body],[solid_modes],[watch]")
add_deep_test(sixty_modes 450 ${CMAKE_COMMAND} -E env RESSORT_THOROUGH=1
  $<TARGET_FILE:ressort_tests> "[sixty_modes]")

# Checks that the benchmark runs. No time is asserted. Only tests/run --deep builds it.
add_custom_target(ressort_deep DEPENDS ressort_bench)
add_deep_test(bench 15 ${CMAKE_CURRENT_SOURCE_DIR}/bench/check $<TARGET_FILE:ressort_bench>)

# A minute of unreasonable use of each instrument.
add_deep_test(abuse_long 300 $<TARGET_FILE:ressort_abuse> 60 2)

# Format, clang-tidy and duplicate type names, in the last change, or everywhere if there is time.
add_deep_test(lint 240 sh -c
  "exec ${CMAKE_CURRENT_SOURCE_DIR}/lint $([ -n \"$RESSORT_DEADLINE\" ] || echo --all)")

# Data shared by threads, with ThreadSanitizer: the slot, the clock, and a thousand model changes
# while the audio thread plays. Only tests/run --deep builds it.
if(NOT RESSORT_ADDRESS_SANITIZER AND NOT RESSORT_THREAD_SANITIZER)
  # Loading and compiling use a single thread and are linked without the sanitizer, and so are the
  # kernels. Whole folders are recompiled, because each folder is one object in the library.
  get_target_property(ressort_shared_sources ressort_core SOURCES)
  list(FILTER ressort_shared_sources INCLUDE REGEX "^core/(engine|kernels/threads)/")
  get_target_property(ressort_shared_app ressort_app SOURCES)
  list(FILTER ressort_shared_app INCLUDE REGEX "^app/(realtime/.*|session/.*|[^/]*)\\.cpp$")
  list(APPEND ressort_shared_sources ${ressort_shared_app})
  list(TRANSFORM ressort_shared_sources PREPEND ${CMAKE_SOURCE_DIR}/)
  add_executable(ressort_race_tests EXCLUDE_FROM_ALL unit/realtime/lockfree_test.cpp unit/realtime/helpers_test.cpp
    unit/session/session_test.cpp unit/session/timbre_watch_test.cpp
    ${ressort_shared_sources})
  ressort_compile_by_folder(ressort_race_tests)
  target_compile_options(ressort_race_tests PRIVATE -O1 -fsanitize=thread -g1 -Wno-tsan
    -Wno-maybe-uninitialized)  # GCC sees ghosts behind its own instrumentation
  target_link_options(ressort_race_tests PRIVATE -fsanitize=thread)
  target_precompile_headers(ressort_race_tests PRIVATE ${ressort_app_headers})
  target_compile_definitions(ressort_race_tests PRIVATE RESSORT_SOURCE="${CMAKE_SOURCE_DIR}")
  # The library comes after the instrumented objects, so that the linker prefers these.
  target_link_libraries(ressort_race_tests PRIVATE ressort_test_main ressort_test_support ressort_app
    Threads::Threads)
  add_dependencies(ressort_deep ressort_race_tests)
  add_deep_test(races 60 ${CMAKE_COMMAND} -E env TSAN_OPTIONS=halt_on_error=1
    $<TARGET_FILE:ressort_race_tests>)
endif()
