//! Priority of the threads that carry frames: on a busy computer they run before ordinary programs, where that is
//! permitted. A robot whose heartbeats come late returns to SAFE.

/// Gives the calling thread real-time priority, the lowest there is, which is above all threads that have none. Returns
/// whether the system permits it; without it everything works, but late on a busy computer.
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

/// Other systems have ways of their own.
#[cfg(not(target_os = "linux"))]
pub fn raise() -> bool {
    false
}
