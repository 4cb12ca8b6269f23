# Files for `cmake --install` and the Debian package. The program looks for its models in share/ressort
# beside its own folder.
include(GNUInstallDirs)
set(packaging ${CMAKE_CURRENT_LIST_DIR})
set(packaged ${CMAKE_BINARY_DIR}/packaging)

# Manual page and completion, printed by the program. A cross build needs an emulator for it.
if(NOT CMAKE_CROSSCOMPILING OR CMAKE_CROSSCOMPILING_EMULATOR)
  add_custom_command(TARGET ressort POST_BUILD
    COMMAND ${CMAKE_COMMAND} -E make_directory ${packaged}
    COMMAND ressort reference man > ${packaged}/ressort.1
    COMMAND ressort reference completion > ${packaged}/ressort.bash
    COMMAND gzip -9nf ${packaged}/ressort.1)
  install(FILES ${packaged}/ressort.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  install(FILES ${packaged}/ressort.bash
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME ressort)
endif()

install(TARGETS ressort)
install(DIRECTORY models presets DESTINATION ${CMAKE_INSTALL_DATADIR}/ressort
  FILES_MATCHING PATTERN "*.mdl" PATTERN "*.toml" PATTERN "*.scl" PATTERN "*.kbm")
install(FILES ${packaging}/ressort.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)
set(released 2026-11-28)
set(metainfo ${packaged}/io.github.ressort.ressort.metainfo.xml)
configure_file(${packaging}/io.github.ressort.ressort.metainfo.xml.in ${metainfo} @ONLY)
install(FILES ${metainfo} DESTINATION ${CMAKE_INSTALL_DATADIR}/metainfo)
install(FILES ${packaging}/ressort.service DESTINATION lib/systemd/user)

# Licence and changelog, as Debian requires.
set(documents ${CMAKE_INSTALL_DOCDIR})
file(READ ${CMAKE_SOURCE_DIR}/.github/LICENSE.md licence)
string(REGEX MATCH "Permission is hereby granted.*SOFTWARE\\." licence "${licence}")
string(REGEX REPLACE "\n\n" "\n.\n" licence "${licence}")
string(REGEX REPLACE "\n" "\n " licence "${licence}")
configure_file(${packaging}/copyright.in ${packaged}/copyright @ONLY)
execute_process(COMMAND date -u -R -d ${released} OUTPUT_VARIABLE changelog_date)
file(WRITE ${packaged}/changelog "ressort (${PROJECT_VERSION}) stable; urgency=medium\n\n"
  "  * First release.\n\n"
  " -- ressort <ressort@users.noreply.github.com>  ${changelog_date}")
execute_process(COMMAND gzip -9nkf ${packaged}/changelog)
install(FILES ${packaged}/copyright ${packaged}/changelog.gz DESTINATION ${documents})

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME ressort)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "ressort <ressort@users.noreply.github.com>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Real-time mass-interaction synthesizer")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION "Simulates networks of masses and springs in real time: strings, meshes,
bells and other bodies, struck, plucked or bowed. Plays on JACK, PipeWire
and ALSA, controlled by MIDI, MPE, OSC and a console. A model is a text
file that you can edit while it sounds.")
set(CPACK_DEBIAN_PACKAGE_SECTION sound)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS gnuplot-nox)  # draws the figures
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ
  GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
# A program for the processor that built it would not run on others. Processors other than x86-64 have
# one level, which runs on all of them.
if(RESSORT_LEVELS STREQUAL native AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  file(WRITE ${packaged}/refuse.cmake "message(FATAL_ERROR \"This build is for one type of processor, "
    "as app/run makes it. Package a build with -DRESSORT_LEVELS=all.\")\n")
  set(CPACK_PROJECT_CONFIG_FILE ${packaged}/refuse.cmake)
endif()
include(CPack)
