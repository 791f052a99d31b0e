//! Choice of the machine that runs a command: this one if its kernel has vcan, otherwise a virtual one.

use super::INTERFACES;
use crate::shell;
use std::fs;

/// Machine that runs a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    Here,
    Guest,
}

/// Chooses the machine, and creates the interfaces on this one if its kernel supports them and the user may create them.
///
/// # Errors
/// Returns an error if another kind of interface has the name of a CAN interface.
pub fn decide() -> Result<Target, String> {
    for name in INTERFACES {
        if !ready(name)? && !make(name) {
            return Ok(Target::Guest);
        }
    }
    Ok(Target::Here)
}

/// Returns true if the interface exists and is up.
fn ready(name: &str) -> Result<bool, String> {
    let read = |file: &str| fs::read_to_string(format!("/sys/class/net/{name}/{file}"));
    let (Ok(kind), Ok(flags)) = (read("type"), read("flags")) else { return Ok(false) };
    if kind.trim() != ARPHRD_CAN {
        return Err(format!("{name} is an interface of this machine, but not a CAN interface"));
    }
    Ok(is_up(&flags))
}

/// `ARPHRD_CAN` of `linux/if_arp.h`.
const ARPHRD_CAN: &str = "280";

/// True if the flags of an interface, as the kernel prints them, contain `IFF_UP`.
fn is_up(flags: &str) -> bool {
    let digits = flags.trim().trim_start_matches("0x");
    u32::from_str_radix(digits, 16).is_ok_and(|flags| flags & 1 != 0)
}

fn make(name: &str) -> bool {
    let ip = |args: &[&str]| shell::succeeds(&mut shell::system("ip", args));
    // The interface may exist, and only be down.
    ip(&["link", "add", "dev", name, "type", "vcan"]);
    ip(&["link", "set", name, "up"])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_flag_says_whether_an_interface_is_up() {
        assert!(is_up("0x49\n"));
        assert!(is_up("0x1"));
        assert!(!is_up("0x80\n"));
        assert!(!is_up(""));
    }

    #[test]
    fn no_interface_is_not_ready_and_the_loopback_is_no_can_interface() {
        assert_eq!(ready("no such interface"), Ok(false));
        assert!(ready("lo").unwrap_err().contains("not a CAN interface"));
    }
}
