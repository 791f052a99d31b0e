//! Real-time priority of the threads that carry frames.
//!
//! On a busy computer, these threads run before ordinary programs if the system permits it. A robot whose heartbeats are late
//! returns to SAFE.

/// Gives the calling thread the lowest real-time priority, which is above all ordinary threads.
///
/// Returns true if the system permits this. Without this priority, heartbeats may be late on a busy computer.
#[cfg(target_os = "linux")]
pub fn raise() -> bool {
    use thread_priority::unix::{
        RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy,
        thread_native_id,
    };
    use thread_priority::{ThreadPriority, ThreadPriorityValue};
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::RoundRobin);
    ThreadPriorityValue::try_from(1).is_ok_and(|lowest| {
        let lowest = ThreadPriority::Crossplatform(lowest);
        set_thread_priority_and_policy(thread_native_id(), lowest, policy).is_ok()
    })
}

/// Returns false: priorities are implemented only for Linux.
#[cfg(not(target_os = "linux"))]
pub fn raise() -> bool {
    false
}
