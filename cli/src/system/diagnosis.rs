//! Findings about a computer: obstacles to operating robots, each with the command that removes it.

use crate::gamepad::device;
use crate::picture::Tool;
use rollwalk_bus::can::{DEFAULT_BITRATE, Interface, create_virtual};
use rollwalk_bus::open::OpenError;
use rollwalk_bus::serial::{self, join};
use rollwalk_bus::tty::Latency;
use rollwalk_host::doctor::{Finding, Gravity};
use std::path::PathBuf;

/// Name of the interface in the advice for a computer without CAN interfaces.
const VIRTUAL: &str = "vcan0";

/// Facts about a computer that affect robots.
#[derive(Clone, Debug)]
pub struct System {
    /// Reason why SocketCAN cannot be used.
    pub no_can: Option<OpenError>,
    /// True if the kernel has virtual CAN interfaces, loaded or available; `None` if its modules are not visible.
    pub has_vcan: Option<bool>,
    pub interfaces: Vec<Interface>,
    /// Serial adapters and serial boards.
    pub serial: Vec<SerialDevice>,
    pub user: User,
    /// Finding about refused real-time priority.
    pub no_priority: Option<Finding>,
    /// Maximum real-time priority of this login; `None` without a limit.
    pub priority_limit: Option<u32>,
    /// Names of gamepads that can be read.
    pub gamepads: Vec<String>,
    /// Gamepad without read permission.
    pub unreadable_gamepad: Option<PathBuf>,
    /// Optional programs that are not installed.
    pub missing_tools: Vec<Tool>,
}

/// Serial adapter or serial board.
#[derive(Clone, Debug)]
pub struct SerialDevice {
    /// Path such as `/dev/ttyUSB0`.
    pub path: String,
    /// True if this user may read and write the device.
    pub is_accessible: bool,
    /// Name of the group with access, or its number if it has no name.
    pub group: String,
    /// FTDI latency timer; `None` for other devices.
    pub latency: Option<Latency>,
}

#[derive(Clone, Debug, Default)]
pub struct User {
    /// True if the user is root, who has all permissions.
    pub is_root: bool,
    /// Groups of this login.
    pub groups: Vec<String>,
    /// Groups to which the user was added, perhaps after this login.
    pub joined: Vec<String>,
}

impl User {
    /// Advice for getting access to the devices of a group.
    fn enter(&self, group: &str) -> String {
        let has = |groups: &[String]| groups.iter().any(|one| one == group);
        if has(&self.joined) && !has(&self.groups) {
            format!("log in again, because you joined the group `{group}` after you had logged in")
        } else {
            join(group)
        }
    }
}

/// Findings in the order in which they should be resolved.
pub fn diagnose(system: &System) -> Vec<Finding> {
    let parts =
        [can(system), serial_devices(system), priority(system), gamepads(system), tools(system)];
    parts.into_iter().flatten().collect()
}

fn finding(gravity: Gravity, what: impl Into<String>, help: impl Into<String>) -> Finding {
    Finding { gravity, what: what.into(), help: help.into() }
}

fn fine(what: impl Into<String>) -> Finding {
    finding(Gravity::Fine, what, "")
}

fn can(system: &System) -> Vec<Finding> {
    // A robot on a serial line needs no CAN tools.
    if let Some(OpenError { what, help }) = &system.no_can {
        return vec![finding(Gravity::Note, what, help)];
    }
    let mut found = vec![fine("the kernel has SocketCAN")];
    found.extend(system.interfaces.iter().map(interface));
    if system.interfaces.is_empty() {
        let what = "there is no CAN interface";
        found.push(match system.has_vcan {
            Some(false) => finding(
                Gravity::Note,
                format!("{what}, and this kernel lacks virtual interfaces (vcan)"),
                "plug in an adapter, or use `--bus sim` for a robot on this computer",
            ),
            _ => finding(
                Gravity::Note,
                what,
                format!(
                    "plug in an adapter, or make a virtual interface: {}",
                    create_virtual(VIRTUAL)
                ),
            ),
        });
    }
    found
}

fn interface(interface: &Interface) -> Finding {
    let Interface { name, is_up, is_virtual, bitrate, is_bus_off } = interface;
    let set_up = interface.set_up(bitrate.unwrap_or(DEFAULT_BITRATE));
    if *is_bus_off {
        let what = format!("the CAN interface {name} is bus-off: too many of its frames failed");
        let help = format!(
            "check wiring, termination and bitrate, then type sudo ip link set {name} down; \
             {set_up}"
        );
        return finding(Gravity::Wrong, what, help);
    }
    match (is_up, bitrate) {
        (true, Some(bitrate)) => fine(format!("the CAN interface {name} is up at {bitrate} bit/s")),
        (true, None) => fine(format!("the CAN interface {name} is up")),
        (false, _) => {
            let gravity = if *is_virtual { Gravity::Note } else { Gravity::Wrong };
            finding(gravity, format!("the CAN interface {name} is down"), set_up)
        }
    }
}

fn serial_devices(system: &System) -> Vec<Finding> {
    let (user, group) = (&system.user, serial::GROUP);
    let mut found: Vec<_> =
        system.serial.iter().flat_map(|device| serial_device(device, user)).collect();
    if system.serial.is_empty() {
        let has_access = user.is_root || user.groups.iter().any(|one| one == group);
        let what = "no serial adapter and no board is plugged in";
        found.push(if has_access {
            // Nothing to use and nothing to repair, so a note.
            finding(
                Gravity::Note,
                format!("{what}; this user may use devices with the group `{group}`"),
                "",
            )
        } else {
            finding(
                Gravity::Note,
                format!(
                    "{what}; this user is not in the group `{group}`, which may use such devices"
                ),
                user.enter(group),
            )
        });
    }
    found
}

fn serial_device(device: &SerialDevice, user: &User) -> Vec<Finding> {
    let path = &device.path;
    let mut found = vec![if device.is_accessible {
        fine(format!("{path} can be read and written"))
    } else {
        finding(Gravity::Wrong, format!("this user may not use {path}"), user.enter(&device.group))
    }];
    if let Some(latency) = device.latency.as_ref().filter(|latency| latency.is_long()) {
        let what = format!(
            "the FTDI latency timer of {path} is {} ms, so poses of servos arrive too late",
            latency.ms
        );
        found.push(finding(Gravity::Note, what, latency.shorten()));
    }
    found
}

fn priority(system: &System) -> Vec<Finding> {
    let limit = match system.priority_limit {
        Some(limit) => format!("the limit of this login is {limit}"),
        None => "this login has no limit".into(),
    };
    vec![match &system.no_priority {
        None => fine("rollwalk can use real-time priority"),
        Some(Finding { gravity, what, help }) => {
            finding(*gravity, format!("{what} ({limit})"), help)
        }
    }]
}

fn gamepads(system: &System) -> Vec<Finding> {
    let mut found = Vec::new();
    if let Some(path) = &system.unreadable_gamepad {
        let what = format!("this user may not read the gamepad {}", path.display());
        found.push(finding(Gravity::Wrong, what, system.user.enter(device::GROUP)));
    }
    found.extend(system.gamepads.iter().map(|name| fine(format!("gamepad: {name}"))));
    if found.is_empty() {
        found.push(finding(Gravity::Note, "no gamepad is plugged in; gamepads are optional", ""));
    }
    found
}

fn tools(system: &System) -> Vec<Finding> {
    let missing = system.missing_tools.iter().map(|tool| {
        let what = format!("{} is not installed: {}", tool.program, tool.lack());
        finding(Gravity::Note, what, tool.install())
    });
    missing.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture;
    use std::path::Path;

    fn can0() -> Interface {
        Interface {
            name: "can0".into(),
            is_up: true,
            is_virtual: false,
            bitrate: Some(500_000),
            is_bus_off: false,
        }
    }

    fn adapter() -> SerialDevice {
        SerialDevice {
            path: "/dev/ttyUSB0".into(),
            is_accessible: true,
            group: "dialout".into(),
            latency: Some(Latency { setting: "/sys/latency_timer".into(), ms: 1 }),
        }
    }

    /// Returns a computer without problems.
    fn ready() -> System {
        System {
            no_can: None,
            has_vcan: Some(true),
            interfaces: vec![can0()],
            serial: vec![adapter()],
            user: User {
                is_root: false,
                groups: vec!["dialout".into()],
                joined: vec!["dialout".into()],
            },
            no_priority: None,
            priority_limit: Some(1),
            gamepads: vec!["Xbox Wireless Controller".into()],
            unreadable_gamepad: None,
            missing_tools: Vec::new(),
        }
    }

    /// Returns the only problem after a change to a computer without problems.
    fn after(change: impl FnOnce(&mut System)) -> Finding {
        let mut system = ready();
        change(&mut system);
        let mut found = diagnose(&system);
        found.retain(|finding| finding.gravity != Gravity::Fine);
        assert_eq!(found.len(), 1, "{found:#?}");
        found.remove(0)
    }

    fn assert_is(finding: &Finding, gravity: Gravity, what: &str, help: &str) {
        assert_eq!(finding.gravity, gravity, "{finding:?}");
        assert!(finding.what.contains(what), "{finding:?}");
        assert!(finding.help.contains(help), "{finding:?}");
    }

    #[test]
    fn a_ready_computer_has_nothing_to_mend() {
        let found = diagnose(&ready());
        assert!(found.iter().all(|one| one.gravity == Gravity::Fine && one.help.is_empty()));
        let said: Vec<_> = found.iter().map(|one| one.what.as_str()).collect();
        assert_eq!(
            said,
            [
                "the kernel has SocketCAN",
                "the CAN interface can0 is up at 500000 bit/s",
                "/dev/ttyUSB0 can be read and written",
                "rollwalk can use real-time priority",
                "gamepad: Xbox Wireless Controller",
            ]
        );
    }

    #[test]
    fn a_kernel_without_can_is_named_once() {
        let (what, help) = ("no SocketCAN".to_owned(), "sudo modprobe can_raw".to_owned());
        let finding = after(|system| {
            system.no_can = Some(OpenError { what, help });
            system.interfaces.clear();
        });
        assert_is(&finding, Gravity::Note, "no SocketCAN", "modprobe can_raw");
    }

    #[test]
    fn without_an_interface_a_virtual_one_is_proposed_where_the_kernel_has_them() {
        let vcan = |has_vcan| {
            after(move |system| {
                system.interfaces.clear();
                system.has_vcan = has_vcan;
            })
        };
        let command =
            "sudo modprobe vcan; sudo ip link add vcan0 type vcan; sudo ip link set vcan0 up";
        assert_is(&vcan(Some(true)), Gravity::Note, "no CAN interface", command);
        assert_is(&vcan(None), Gravity::Note, "no CAN interface", command);
        let finding = vcan(Some(false));
        assert_is(&finding, Gravity::Note, "lacks virtual interfaces", "--bus sim");
        assert!(!finding.help.contains("modprobe"), "{finding:?}");
    }

    #[test]
    fn an_interface_that_is_down_or_off_the_bus_is_wrong() {
        let finding = after(|system| system.interfaces[0].is_up = false);
        let set_up = "sudo ip link set can0 up type can bitrate 500000";
        assert_is(&finding, Gravity::Wrong, "can0 is down", set_up);
        let finding = after(|system| {
            let bitrate = None;
            system.interfaces[0] = Interface { is_up: false, bitrate, ..can0() };
        });
        assert_is(&finding, Gravity::Wrong, "can0 is down", "bitrate 1000000");
        let finding = after(|system| system.interfaces[0].is_bus_off = true);
        assert_is(&finding, Gravity::Wrong, "can0 is bus-off", "sudo ip link set can0 down; sudo");
        let finding = after(|system| {
            system.interfaces[0] = Interface { is_up: false, is_virtual: true, ..can0() };
        });
        assert_is(&finding, Gravity::Note, "can0 is down", "sudo ip link set can0 up");
    }

    #[test]
    fn who_may_not_use_a_device_joins_its_group_or_logs_in_again() {
        let refused = |group: &str, joined: &[&str]| {
            after(|system| {
                system.serial[0].is_accessible = false;
                system.serial[0].group = group.into();
                system.user.groups = vec!["users".into()];
                system.user.joined = joined.iter().map(|&group| group.into()).collect();
            })
        };
        let what = "this user may not use /dev/ttyUSB0";
        assert_is(&refused("dialout", &[]), Gravity::Wrong, what, "sudo usermod -aG dialout $USER");
        assert_is(
            &refused("uucp", &["dialout"]),
            Gravity::Wrong,
            what,
            "sudo usermod -aG uucp $USER",
        );
        let finding = refused("dialout", &["dialout"]);
        assert_is(
            &finding,
            Gravity::Wrong,
            what,
            "log in again, because you joined the group `dialout`",
        );
    }

    #[test]
    fn a_user_without_the_group_is_told_before_a_device_is_plugged_in() {
        let finding = after(|system| {
            system.serial.clear();
            system.user = User::default();
        });
        assert_is(
            &finding,
            Gravity::Note,
            "not in the group `dialout`",
            "sudo usermod -aG dialout",
        );
        let mut root = ready();
        root.serial.clear();
        root.user = User { is_root: true, ..User::default() };
        let found = diagnose(&root);
        let none = found.iter().find(|one| one.what.contains("no serial adapter")).unwrap();
        assert_eq!((none.gravity, none.help.as_str()), (Gravity::Note, ""), "no tick for nothing");
    }

    #[test]
    fn an_adapter_that_keeps_answers_back_is_named_with_the_command() {
        let finding = after(|system| {
            let setting = Path::new("/sys/bus/usb-serial/devices/ttyUSB0/latency_timer").into();
            system.serial[0].latency = Some(Latency { setting, ms: 16 });
        });
        let command = "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer";
        assert_is(&finding, Gravity::Note, "ttyUSB0 is 16 ms", command);
    }

    #[test]
    fn refused_priority_comes_with_the_limit_of_the_login() {
        let note = |limit| {
            after(|system| {
                system.no_priority = Some(finding(Gravity::Note, "no priority", "limits.conf"));
                system.priority_limit = limit;
            })
        };
        assert_is(
            &note(Some(0)),
            Gravity::Note,
            "no priority (the limit of this login is 0)",
            "limits",
        );
        assert_is(&note(None), Gravity::Note, "no priority (this login has no limit)", "limits");
    }

    #[test]
    fn a_gamepad_that_may_not_be_read_is_wrong_and_none_is_a_note() {
        let path = Path::new("/dev/input/event7");
        let finding = after(|system| {
            system.gamepads.clear();
            system.unreadable_gamepad = Some(path.into());
        });
        assert_is(&finding, Gravity::Wrong, "/dev/input/event7", "sudo usermod -aG input $USER");
        let mut none = ready();
        none.gamepads.clear();
        let found = diagnose(&none);
        let none = found.iter().find(|one| one.what.contains("gamepad")).unwrap();
        assert_eq!(none.gravity, Gravity::Note, "no tick for nothing");
    }

    #[test]
    fn a_missing_program_comes_with_its_package() {
        let finding = after(|system| system.missing_tools = vec![picture::TOOLS[0]]);
        assert_is(&finding, Gravity::Note, "rsvg-convert", "sudo apt install librsvg2-bin");
    }
}
