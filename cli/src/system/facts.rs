//! Facts about this computer, from the kernel's files and calls, and from the files of users and groups. Devices that may
//! belong to a robot are not opened.

use super::diagnosis::{SerialDevice, System, User};
use super::priority_note;
use crate::gamepad::device;
use crate::picture::TOOLS;
use rollwalk_bus::can::{self, Interface};
use rollwalk_bus::serial;
use rollwalk_bus::tty::Latency;
use rustix::fs::Access;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

pub fn gather() -> System {
    let groups = Groups::read();
    let (gamepads, unreadable_gamepad) = device::gamepads();
    System {
        no_can: can::check_support().err(),
        has_vcan: has_vcan(),
        interfaces: can::list().iter().map(|name| Interface::describe(name)).collect(),
        serial: serial::list().into_iter().map(|path| serial_device(path, &groups)).collect(),
        user: user(&groups),
        no_priority: priority_note(),
        priority_limit: priority_limit(&text("/proc/self/limits")),
        gamepads: gamepads.into_iter().map(|found| found.name).collect(),
        unreadable_gamepad,
        missing_tools: TOOLS.into_iter().filter(|tool| !tool.is_installed()).collect(),
    }
}

/// Reads a text file; empty if it cannot be read.
fn text(path: impl AsRef<Path>) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// True if the kernel has virtual CAN interfaces, built in, loaded or available; `None` if its modules are not visible.
fn has_vcan() -> Option<bool> {
    if Path::new("/sys/module/vcan").exists() {
        return Some(true);
    }
    let modules = Path::new("/lib/modules").join(text("/proc/sys/kernel/osrelease").trim());
    let lists =
        ["modules.dep", "modules.builtin"].map(|list| fs::read_to_string(modules.join(list)));
    if lists.iter().all(Result::is_err) {
        return None;
    }
    Some(lists.into_iter().flatten().any(|list| lists_vcan(&list)))
}

fn lists_vcan(modules: &str) -> bool {
    modules.lines().any(|line| {
        let path = line.split(':').next().unwrap_or_default();
        path.rsplit('/').next().is_some_and(|file| file.starts_with("vcan.ko"))
    })
}

fn serial_device(path: String, groups: &Groups) -> SerialDevice {
    // `access` also considers access lists, which the mode of a file does not show.
    let access = rustix::fs::access(path.as_str(), Access::READ_OK | Access::WRITE_OK);
    let gid = fs::metadata(&path).map_or(0, |device| device.gid());
    let latency = Path::new(&path).file_name().and_then(|name| Latency::of(name.to_str()?));
    SerialDevice { is_accessible: access.is_ok(), group: groups.name(gid), latency, path }
}

fn user(groups: &Groups) -> User {
    let status = text("/proc/self/status");
    let uid = numbers(&status, "Uid:").first().copied();
    let gids = [numbers(&status, "Gid:"), numbers(&status, "Groups:")].concat();
    let name = uid.and_then(|uid| user_name(&text("/etc/passwd"), uid));
    User {
        is_root: uid == Some(0),
        groups: gids.into_iter().map(|gid| groups.name(gid)).collect(),
        joined: name.map_or_else(Vec::new, |name| groups.of(&name)),
    }
}

/// Numbers in a line of `/proc/self/status`.
fn numbers(status: &str, key: &str) -> Vec<u32> {
    let line = status.lines().find_map(|line| line.strip_prefix(key)).unwrap_or_default();
    line.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}

/// Name of a user in `/etc/passwd`.
fn user_name(passwd: &str, uid: u32) -> Option<String> {
    let mut users = passwd.lines().map(|line| line.split(':').collect::<Vec<_>>());
    let user = users.find(|fields| fields.get(2).is_some_and(|id| id.parse() == Ok(uid)))?;
    Some(user[0].to_owned())
}

/// Maximum real-time priority in `/proc/self/limits`; `None` without a limit.
fn priority_limit(limits: &str) -> Option<u32> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max realtime priority"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Content of `/etc/group`.
struct Groups(String);

impl Groups {
    fn read() -> Self {
        Self(text("/etc/group"))
    }

    /// Name, number and members of each group.
    fn all(&self) -> impl Iterator<Item = (&str, u32, &str)> {
        self.0.lines().filter_map(|line| {
            let mut fields = line.split(':');
            let (name, _password) = (fields.next()?, fields.next()?);
            Some((name, fields.next()?.parse().ok()?, fields.next()?))
        })
    }

    /// Name of a group, or its number if it has no name.
    fn name(&self, gid: u32) -> String {
        let found = self.all().find(|&(_, number, _)| number == gid);
        found.map_or_else(|| gid.to_string(), |(name, ..)| name.to_owned())
    }

    /// Groups of which a user is a member.
    fn of(&self, user: &str) -> Vec<String> {
        let is_member = |members: &str| members.split(',').any(|member| member == user);
        let all = self.all().filter(|(.., members)| is_member(members));
        all.map(|(name, ..)| name.to_owned()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn users_and_groups_are_read() {
        let groups = Groups("root:x:0:\ndialout:x:20:ann,bob\nann:x:1000:\nbroken\n".into());
        assert_eq!(groups.name(20), "dialout");
        assert_eq!(groups.name(7), "7");
        assert_eq!(groups.of("ann"), ["dialout"]);
        assert_eq!(groups.of("an"), [""; 0]);
        let passwd = "root:x:0:0::/:/bin/sh\nann:x:1000:1000::/srv/ann:/bin/sh\nbroken\n";
        assert_eq!(user_name(passwd, 1000).as_deref(), Some("ann"));
        assert_eq!(user_name(passwd, 100), None);
        let status = "Name:\tx\nUid:\t1000\t1000\t1000\t1000\nGroups:\t20 1000 \n";
        assert_eq!(numbers(status, "Uid:"), [1000; 4]);
        assert_eq!(numbers(status, "Groups:"), [20, 1000]);
        assert_eq!(numbers(status, "Gid:"), [0; 0]);
    }

    #[test]
    fn the_limit_of_priorities_is_read() {
        let limits = |value| {
            format!(
                "Limit  Soft Limit  Hard Limit  Units\nMax realtime priority     {value}   99  \n"
            )
        };
        assert_eq!(priority_limit(&limits("0")), Some(0));
        assert_eq!(priority_limit(&limits("unlimited")), None);
    }

    #[test]
    fn the_module_of_virtual_interfaces_is_told_from_others() {
        assert!(lists_vcan(
            "kernel/drivers/net/can/vcan.ko.xz: kernel/drivers/net/can/dev/can-dev.ko.xz\n"
        ));
        assert!(lists_vcan("kernel/drivers/net/can/vcan.ko\n"));
        assert!(!lists_vcan("kernel/drivers/net/can/vxcan.ko: kernel/drivers/net/can/vcan.ko\n"));
        assert!(!lists_vcan(""));
    }

    #[test]
    fn this_computer_can_be_looked_at() {
        let system = gather();
        assert!(!system.user.groups.is_empty(), "every process has a group");
        assert!(!super::super::diagnosis::diagnose(&system).is_empty());
    }
}
