# SPDX-License-Identifier: BSD-3-Clause
# What is installed, and where. The prefix may change with `cmake --install --prefix`.
include(GNUInstallDirs)
set(package_directory ${CMAKE_INSTALL_LIBDIR}/cmake/versavis)

install(TARGETS versavisd versavis_tool versavis-web RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY daemon/settings/presets DESTINATION ${CMAKE_INSTALL_DATADIR}/versavis
    FILES_MATCHING PATTERN *.toml)
# Only where there is a compiler for the chip.
install(FILES ${CMAKE_BINARY_DIR}/firmware/versavis.uf2
    DESTINATION ${CMAKE_INSTALL_DATADIR}/versavis OPTIONAL)
if(TARGET versavis-dds)
    set(dds_unit versavis-dds.service.in:systemd/system/versavis-dds.service)
    install(TARGETS versavis-dds RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
if(TARGET versavis-rig)
    install(TARGETS versavis-rig RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
    install(DIRECTORY clients/rig/scenarios clients/rig/models
        DESTINATION ${CMAKE_INSTALL_DATADIR}/versavis)
endif()

# The library, for pkg-config and for find_package(versavis).
install(TARGETS versavis EXPORT versavis LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY libversavis/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT versavis FILE versavis-config.cmake NAMESPACE versavis::
    DESTINATION ${package_directory})
include(CMakePackageConfigHelpers)
write_basic_package_version_file(versavis-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/versavis-config-version.cmake
    DESTINATION ${package_directory})
# Packages for workspaces of ROS, which build them with their own release of it.
install(DIRECTORY clients/ros/ DESTINATION ${CMAKE_INSTALL_DATADIR}/versavis/ros)
# relative_to_pkgconfig(NAME DIRECTORY): sets NAME, so that the whole may be moved.
function(relative_to_pkgconfig name directory)
    cmake_path(RELATIVE_PATH directory BASE_DIRECTORY ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig)
    set(${name} ${directory} PARENT_SCOPE)
endfunction()
relative_to_pkgconfig(to_prefix ${CMAKE_INSTALL_PREFIX})
relative_to_pkgconfig(to_library ${CMAKE_INSTALL_FULL_LIBDIR})
relative_to_pkgconfig(to_include ${CMAKE_INSTALL_FULL_INCLUDEDIR})
configure_file(cmake/versavis.pc.in versavis.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/versavis.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

# Manual pages, where there is scdoc, and completion for shells: both of what the programs say.
find_program(scdoc scdoc)
find_program(python python3)
set(programs versavisd versavis_tool versavis-web)
foreach(program versavis-dds versavis-rig)
    if(TARGET ${program})
        list(APPEND programs ${program})
    endif()
endforeach()
if(python)
    set(completion ${CMAKE_BINARY_DIR}/completion)
    add_custom_command(OUTPUT ${completion}/.made
        COMMAND ${python} -B ${CMAKE_CURRENT_SOURCE_DIR}/docs/man/completion
            ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${completion}
        COMMAND ${CMAKE_COMMAND} -E touch ${completion}/.made
        DEPENDS docs/man/completion docs/man/program_help.py ${programs} VERBATIM)
    add_custom_target(completion ALL DEPENDS ${completion}/.made)
    install(DIRECTORY ${completion}/ DESTINATION ${CMAKE_INSTALL_DATADIR}
        PATTERN .made EXCLUDE)
endif()
if(scdoc AND python)
    set(man_pages ${CMAKE_BINARY_DIR}/man)
    file(GLOB man_sources CONFIGURE_DEPENDS docs/man/*.scd)
    add_custom_command(OUTPUT ${man_pages}/.made
        COMMAND ${python} -B ${CMAKE_CURRENT_SOURCE_DIR}/docs/man/man_pages
            ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${man_pages} ${CMAKE_INSTALL_FULL_DOCDIR}
        COMMAND ${CMAKE_COMMAND} -E touch ${man_pages}/.made
        DEPENDS docs/man/man_pages docs/man/program_help.py ${man_sources} ${programs} VERBATIM)
    add_custom_target(man ALL DEPENDS ${man_pages}/.made)
    install(DIRECTORY ${man_pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}
        FILES_MATCHING PATTERN *.[158])
else()
    message(STATUS "No manual pages are made: they need scdoc and python3")
endif()

# The Python client, where Debian's Python looks if the prefix is /usr.
set(VERSAVIS_PYTHON_DIR lib/python3/dist-packages CACHE STRING
    "Where the Python package goes; if relative, below the prefix")
install(DIRECTORY clients/python/versavis DESTINATION ${VERSAVIS_PYTHON_DIR}
    FILES_MATCHING PATTERN *.py PATTERN __pycache__ EXCLUDE)

# The documents keep their folders, so that the links between them hold.
install(FILES README.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} PATTERN man EXCLUDE)
install(DIRECTORY clients/examples/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples)
install(FILES systemd/versavis-alerts.yml systemd/versavis-dashboard.json
    systemd/closed.conf systemd/packet-socket.conf
    DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples)

# Last, as it may need rights that the rest does not: what starts the service.
install(CODE "
    set(source_directory \"${CMAKE_CURRENT_SOURCE_DIR}/systemd\")
    set(system_directory \"${VERSAVIS_SYSTEM_DIR}\")
    set(sysconfdir \"${VERSAVIS_SYSCONFDIR}\")
    set(bindir \"${CMAKE_INSTALL_BINDIR}\")
    set(docdir \"${CMAKE_INSTALL_DOCDIR}\")
    set(dds_unit \"${dds_unit}\")")
install(SCRIPT cmake/install_service.cmake)
