# SPDX-License-Identifier: BSD-3-Clause
include(GNUInstallDirs)
install(TARGETS versavisd versavis-rig versavis_tool RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS versavis ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY daemon/presets DESTINATION ${CMAKE_INSTALL_DATADIR}/versavis FILES_MATCHING PATTERN *.toml)
install(DIRECTORY libversavis/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(FILES systemd/versavisd.service DESTINATION lib/systemd/system)
install(FILES systemd/60-versavis.rules DESTINATION lib/udev/rules.d)
install(FILES systemd/versavis.sysusers DESTINATION lib/sysusers.d RENAME versavis.conf)
install(FILES systemd/versavis.tmpfiles DESTINATION lib/tmpfiles.d RENAME versavis.conf)
install(FILES README.md docs/configuration.md docs/shm-layout.md docs/status.md docs/cameras.md docs/clock.md docs/wire-protocol.md docs/rig.md
    DESTINATION ${CMAKE_INSTALL_DOCDIR})
