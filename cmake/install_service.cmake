# SPDX-License-Identifier: BSD-3-Clause
# Runs at installation: unit, udev rule, user, folder and configuration, for the prefix in force.
if(system_directory STREQUAL "none")
    return()
endif()
cmake_path(SET prefix NORMALIZE "${CMAKE_INSTALL_PREFIX}/.")
cmake_path(ABSOLUTE_PATH prefix NORMALIZE)
string(REGEX REPLACE "(.)/$" "\\1" prefix "${prefix}")
cmake_path(ABSOLUTE_PATH bindir BASE_DIRECTORY "${prefix}" NORMALIZE)
cmake_path(ABSOLUTE_PATH docdir BASE_DIRECTORY "${prefix}" NORMALIZE)
if(NOT system_directory STREQUAL "auto")
    cmake_path(ABSOLUTE_PATH system_directory BASE_DIRECTORY "${prefix}" NORMALIZE)
elseif(prefix MATCHES "^/usr(/local)?$")
    set(system_directory "${prefix}/lib")
else()
    set(system_directory /etc)  # systemd and udev look below no other prefix
endif()
if(prefix MATCHES "^/(home|root|run/user|tmp|var/tmp)(/|$)")
    message(WARNING "The unit keeps the service out of ${prefix}: it cannot start from there. "
        "Install to /opt/versavis, say, or with -DVERSAVIS_SYSTEM_DIR=none.")
endif()

# place(SOURCE TARGET): a copy with the paths filled in.
function(place source target)
    message(STATUS "Installing: $ENV{DESTDIR}${target}")
    configure_file("${source_directory}/${source}" "$ENV{DESTDIR}${target}" @ONLY
        FILE_PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
endfunction()

set(configuration_name versavis)
set(state_directory versavis)
foreach(pair
        versavisd.service.in:systemd/system/versavisd.service
        versavis-lidar@.service.in:systemd/system/versavis-lidar@.service
        versavis-metrics.service.in:systemd/system/versavis-metrics.service
        versavis-verify.service.in:systemd/system/versavis-verify.service
        versavis-web.service.in:systemd/system/versavis-web.service
        ${dds_unit}
        versavis-metrics.timer:systemd/system/versavis-metrics.timer
        60-versavis.rules:udev/rules.d/60-versavis.rules
        versavis.catalog:systemd/catalog/versavis.catalog
        versavis.sysctl:sysctl.d/60-versavis.conf
        versavis.sysusers:sysusers.d/versavis.conf
        versavis.tmpfiles:tmpfiles.d/versavis.conf)
    string(REPLACE ":" ";" pair "${pair}")
    list(GET pair 0 source)
    list(GET pair 1 target)
    place(${source} "${system_directory}/${target}")
    list(APPEND CMAKE_INSTALL_MANIFEST_FILES "${system_directory}/${target}")
endforeach()

# Of several services, each has a configuration of its own: versavisd@NAME reads NAME.toml.
set(of_instance " (%i)")
set(configuration_name %i)
set(state_directory versavis/%i)
place(versavisd.service.in "${system_directory}/systemd/system/versavisd@.service")
list(APPEND CMAKE_INSTALL_MANIFEST_FILES "${system_directory}/systemd/system/versavisd@.service")

# AppArmor looks nowhere else; where there is none, nobody reads it.
place(versavisd.apparmor.in "${sysconfdir}/apparmor.d/versavisd")
list(APPEND CMAKE_INSTALL_MANIFEST_FILES "${sysconfdir}/apparmor.d/versavisd")

# The user's own is neither overwritten nor, as the manifest does not name it, uninstalled.
set(configuration "${sysconfdir}/versavis/versavis.toml")
if(EXISTS "$ENV{DESTDIR}${configuration}")
    message(STATUS "Kept: $ENV{DESTDIR}${configuration}")
else()
    place(versavis.toml "${configuration}")
endif()
