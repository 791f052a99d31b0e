//! Readiness of this computer for robots: CAN, serial devices, real-time priority, gamepads, and programs of others.
//!
//! | module | is |
//! |---|---|
//! | [`diagnosis`] | what facts mean and what mends them: a pure function |
//! | `facts` | reads the facts from the kernel and the files of this computer |

#[cfg(target_os = "linux")]
mod diagnosis;
#[cfg(target_os = "linux")]
mod facts;

use rollwalk_bus::priority;
use rollwalk_host::doctor::{Finding, Gravity};

/// Findings in the order in which they should be mended.
#[cfg(target_os = "linux")]
pub fn findings() -> Vec<Finding> {
    diagnosis::diagnose(&facts::gather())
}

/// Other systems have no SocketCAN, no groups of serial devices, and real-time priorities of their own.
#[cfg(not(target_os = "linux"))]
pub fn findings() -> Vec<Finding> {
    let what =
        "CAN interfaces, access to devices and real-time priority can be looked at on Linux only";
    let help = "serial: and slcan: buses, and sim, are here as well";
    vec![Finding { gravity: Gravity::Note, what: what.into(), help: help.into() }]
}

/// Note of a computer that does not run us before others when it is busy.
pub fn priority_note() -> Option<Finding> {
    (cfg!(target_os = "linux") && !priority::raise()).then(|| Finding {
        gravity: Gravity::Note,
        what: "this computer gives rollwalk no real-time priority: when it is busy, heartbeats may come late, and the \
               robot returns to SAFE"
            .into(),
        help: "the line `YOUR_NAME - rtprio 1` in /etc/security/limits.conf, and a new login".into(),
    })
}
