//! Parallel work on all cores.

use std::sync::Mutex;

/// Applies `work` to the items in order, in parallel on all cores; returns the failures.
pub fn each<T: Sync>(all: &[T], work: impl Fn(&T) -> Result<(), String> + Sync) -> Vec<String> {
    let waiting = Mutex::new(all.iter());
    let failures = Mutex::new(Vec::new());
    let next = || waiting.lock().expect("no worker panics").next();
    let worker = || {
        while let Some(piece) = next() {
            if let Err(why) = work(piece) {
                failures.lock().expect("no worker panics").push(why);
            }
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        (0..cores.min(all.len())).for_each(|_| drop(scope.spawn(worker)));
    });
    failures.into_inner().expect("no worker panics")
}

#[cfg(test)]
mod tests {
    #[test]
    fn everything_is_done_once_and_failures_come_back() {
        let all: Vec<u32> = (0..50).collect();
        let sum = std::sync::atomic::AtomicU32::new(0);
        let mut failures = super::each(&all, |&n| {
            sum.fetch_add(n, std::sync::atomic::Ordering::Relaxed);
            if n % 25 == 7 { Err(n.to_string()) } else { Ok(()) }
        });
        failures.sort();
        assert_eq!((sum.into_inner(), failures), (1225, vec!["32".to_owned(), "7".to_owned()]));
        assert!(super::each(&[] as &[u32], |_| Err(String::new())).is_empty());
    }
}
