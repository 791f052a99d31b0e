//! Loop that runs a [`Conductor`] with a bus, a clock and Ctrl-C.

use super::conductor::{Conductor, LATENCY_MAX_S, Phase, Tally};
use rollwalk_bus::port::LiveLink;
use rollwalk_host::operator::{ExitStage, Intent, Operator};
use rollwalk_pilot::END_US;
use rollwalk_terminal::link::LinkArgs;
use rollwalk_terminal::link::operated_bus::{OperatedBus, print_new_messages, report_exit};
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;
use std::time::Instant;

/// Time without contact after which the program ends, µs.
const SILENT_US: u64 = 5_000_000;

/// Fraction of lost samples above which the verdict names the link as the cause.
const MISSED: f64 = 0.01;

/// Plays the sequence of a conductor on a bus, and prints the results.
///
/// # Errors
/// Returns an error if standard output is closed.
pub fn run(
    link: &LinkArgs,
    bus: LiveLink,
    operator: Operator,
    conductor: &mut Conductor<'_>,
    json: bool,
) -> miette::Result<Exit> {
    interrupt::install_handler();
    let mut operated = OperatedBus::new(link, bus, operator);
    let (mut said, mut heard_us, mut over_us) = (None, 0, None);
    let (mut took_ms, mut interrupts) = (Vec::new(), 0);
    loop {
        let now_us = operated.now_us();
        if interrupt::requested() && interrupts == 0 {
            interrupts = 1;
            conductor.stop(now_us, &mut operated.operator);
        }
        conductor.update(now_us, &mut operated.operator);
        let (begun, answered) = (Instant::now(), conductor.tally().answered);
        conductor.answer(now_us, &mut operated.operator);
        if conductor.tally().answered > answered {
            took_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        }
        operated.send();
        let view = operated.operator.view(now_us);
        print_new_messages(&mut said, &view.messages);
        if view.link.contact {
            heard_us = now_us;
        }
        if matches!(conductor.phase(), Phase::Homeward | Phase::Over) {
            over_us.get_or_insert(now_us);
        }
        let overtime_us = over_us.map_or(0, |over_us| now_us - over_us);
        if overtime_us > END_US && operated.operator.leaving() == ExitStage::No {
            operated.operator.request(now_us, Intent::Quit);
        }
        let is_lost = now_us.saturating_sub(heard_us) > SILENT_US || overtime_us > 2 * END_US;
        if operated.operator.leaving() == ExitStage::Now || is_lost {
            let ended = report_exit(&view);
            let report = ControlOutput::new(conductor, &mut took_ms);
            output::print_line(report.verdict());
            if json {
                output::print_json(&report)?;
            }
            return Ok(match ended {
                Exit::Ok if interrupts > 0 => Exit::Interrupted,
                Exit::Ok if !report.complete => Exit::NotDone,
                ended => ended,
            });
        }
        operated.receive();
    }
}

/// Counters and delays of answers, printed by `--json`.
#[derive(Serialize)]
struct ControlOutput {
    complete: bool,
    rate_hz: u16,
    answered: u64,
    untracked: u64,
    lost: u64,
    missing_measurements: u64,
    /// Median duration of a tick, ms.
    tick_median_ms: f64,
    /// 99th percentile of the duration of a tick, ms.
    tick_99_percent_ms: f64,
    /// Maximum duration of a tick, ms.
    tick_longest_ms: f64,
    /// Number of samples for each lateness of the answer in force, in samples, from 0.
    late_by_samples: Vec<u64>,
}

impl ControlOutput {
    fn new(conductor: &Conductor<'_>, took_ms: &mut [f64]) -> Self {
        let Tally { answered, untracked, late, stale, lost, complete } = conductor.tally().clone();
        took_ms.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let index = (part * took_ms.len() as f64) as usize;
            took_ms.get(index.min(took_ms.len().saturating_sub(1))).copied().unwrap_or(0.0)
        };
        Self {
            complete,
            rate_hz: conductor.rate_hz(),
            answered,
            untracked,
            lost,
            missing_measurements: stale,
            tick_median_ms: at(0.5),
            tick_99_percent_ms: at(0.99),
            tick_longest_ms: at(1.0),
            late_by_samples: late.to_vec(),
        }
    }

    /// Lateness within which 99 % of the answers acted, samples; `None` if there are no answers.
    fn late_samples(&self) -> Option<usize> {
        let all: u64 = self.late_by_samples.iter().sum();
        let mut within = 0;
        self.late_by_samples.iter().position(|count| {
            within += count;
            all > 0 && within as f64 >= 0.99 * all as f64
        })
    }

    /// Verdict as a sentence: whether everything was played, and whether the link and this computer were fast enough.
    fn verdict(&self) -> String {
        let all =
            if self.complete { "all motions were played" } else { "not all motions were played" };
        let Some(late) = self.late_samples() else {
            return format!("{all}; no sample of the robot was answered");
        };
        let late_ms = 1e3 * late as f64 / f64::from(self.rate_hz.max(1));
        let total = self.answered + self.lost;
        let missed = self.lost as f64 / total.max(1) as f64;
        // The last class counts this number of samples and more.
        let is_slow = late_ms >= 1e3 * LATENCY_MAX_S || late + 1 >= self.late_by_samples.len();
        let cause = match (missed > MISSED, is_slow) {
            (true, _) => "the link loses samples: check its load and cable",
            (false, true) => {
                "the link or this computer is too slow: end other programs, or give a lower --rate"
            }
            (false, false) => "the link was fast enough",
        };
        format!(
            "{all}; {cause} ({} of {total} samples answered, 99 % within {late_ms:.0} ms)",
            self.answered
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_says_whether_the_link_was_fast_enough() {
        let report = |late_by_samples: &[u64], lost| ControlOutput {
            complete: true,
            rate_hz: 120,
            answered: late_by_samples.iter().sum(),
            untracked: 0,
            lost,
            missing_measurements: 0,
            tick_median_ms: 0.15,
            tick_99_percent_ms: 0.2,
            tick_longest_ms: 0.24,
            late_by_samples: late_by_samples.to_vec(),
        };
        assert_eq!(
            report(&[0, 14, 967, 102, 0], 5).verdict(),
            "all motions were played; the link was fast enough (1083 of 1088 samples answered, 99 % within 25 ms)"
        );
        let slow = report(&[0, 14, 0, 0, 0, 0, 0, 100], 0).verdict();
        assert!(slow.contains("too slow"), "{slow}");
        let fast = ControlOutput { rate_hz: 960, ..report(&[0, 14, 100], 0) }.verdict();
        assert!(fast.contains("too slow"), "the last count has no end: {fast}");
        let lossy = report(&[0, 900, 0], 100).verdict();
        assert!(lossy.contains("loses samples"), "{lossy}");
        assert!(report(&[0, 0], 0).verdict().contains("no sample"));
    }
}
