//! Readiness of this computer for robots: CAN, serial devices, real-time priority, gamepads, and optional programs.
//!
//! | module | content |
//! |---|---|
//! | [`diagnosis`] | converts facts to findings with remedies: a pure function |
//! | `facts` | reads the facts from the kernel and the files of this computer |

#[cfg(target_os = "linux")]
mod diagnosis;
#[cfg(target_os = "linux")]
mod facts;

use rollwalk_bus::priority;
use rollwalk_host::doctor::{Finding, Gravity};

/// Findings in the order in which they should be resolved.
#[cfg(target_os = "linux")]
pub fn findings() -> Vec<Finding> {
    diagnosis::diagnose(&facts::gather())
}

/// Returns a note that only Linux is examined. Other systems have no SocketCAN and no groups of serial devices, and set
/// real-time priorities differently.
#[cfg(not(target_os = "linux"))]
pub fn findings() -> Vec<Finding> {
    let what = "CAN interfaces, access to devices and real-time priority are checked on Linux only";
    let help = "use a serial: or slcan: bus, or sim";
    vec![Finding { gravity: Gravity::Note, what: what.into(), help: help.into() }]
}

/// Returns a note if this computer refuses real-time priority.
pub fn priority_note() -> Option<Finding> {
    (cfg!(target_os = "linux") && !priority::raise()).then(|| Finding {
        gravity: Gravity::Note,
        what: "rollwalk has no real-time priority, so heartbeats may be late while this computer \
               is busy, and the robot then returns to SAFE"
            .into(),
        help: "add the line `YOUR_NAME - rtprio 1` to /etc/security/limits.conf, then log in again"
            .into(),
    })
}
