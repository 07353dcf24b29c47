// SPDX-License-Identifier: BSD-3-Clause
// The interfaces of the control socket in Varlink's language, as docs/contracts/control.md has
// them, and as clients may ask for them.
#pragma once

namespace versavis::daemon {

inline constexpr const char* control_interface = R"(# Control of a service that runs
interface org.versavis.service

# state: as in the status document. hint: what to do; empty: all is well
type Camera (name: string, state: string, health: string, hint: string)

# Called with "more": a reply now, and one with each change
method GetState() -> (health: string, text: string, cameras: []Camera)

# Each answers when the camera streams or was let go, or it is known that this takes longer
method StartCamera(camera: string) -> ()
method StopCamera(camera: string) -> ()
method RestartCamera(camera: string) -> ()

# values: keys of [[camera]], "auto_exposure.KEY", and features by their name; null: its default.
# They hold until the service is stopped, or its file has others. changed: keys whose value is new
method SetCamera(camera: string, values: object) -> (changed: []string)

# Reads the configuration file again. need_restart: keys that keep their old value until the
# service is restarted
method Reload() -> (changed: []string, need_restart: []string)

# From whoever watches the packets of LiDARs, as 'versavis lidar watch'; it holds for 30 s. source:
# address and interface, as 192.168.1.3%eth1. verdict: follows, unlocked, unset, off, drifts or
# unproved. hint: why, and what to do. All in ASCII without control characters, 512 of the hint and
# 64 of others. Its clock is behind the host's by behind_ns at most, or ahead of it by ahead_ns
type Lidar (source: string, maker: string, verdict: string, hint: string, behind_ns: ?int,
  ahead_ns: ?int)

# 32 LiDARs at most; those that were not reported for 30 s make room
method ReportLidars(lidars: []Lidar) -> ()

error UnknownCamera (camera: string, cameras: []string)
# Nothing was changed
error Refused (problems: []string)
# Nothing was changed: restart the service with a file that has them
error NeedsRestart (keys: []string)
# It is still asked, and may do it later
error NoAnswer (camera: string)
)";

inline constexpr const char* varlink_interface = R"(# The interface of each service of Varlink
interface org.varlink.service

method GetInfo() -> (vendor: string, product: string, version: string, url: string,
  interfaces: []string)
method GetInterfaceDescription(interface: string) -> (description: string)

error InterfaceNotFound (interface: string)
error MethodNotFound (method: string)
error MethodNotImplemented (method: string)
error InvalidParameter (parameter: string)
)";

}  // namespace versavis::daemon
