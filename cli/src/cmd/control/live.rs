//! The loop around a [`Conductor`]: a bus, a clock and Ctrl-C.

use super::conductor::{Conductor, Phase, Tally};
use rollwalk_bus::port::Live;
use rollwalk_host::operator::{Intent, Leaving, Operator};
use rollwalk_pilot::END_US;
use rollwalk_terminal::link::LinkArgs;
use rollwalk_terminal::link::operated::{Operated, farewell, say_new};
use rollwalk_terminal::{Exit, interrupt, output};
use std::time::Instant;

/// Time without contact after which the program ends, µs.
const SILENT_US: u64 = 5_000_000;

/// Plays the sequence of a conductor on a bus, and says how it went.
pub fn run(link: &LinkArgs, bus: Live, operator: Operator, conductor: &mut Conductor<'_>) -> Exit {
    interrupt::listen();
    let mut operated = Operated::new(link, bus, operator);
    let (mut said, mut heard_us, mut over_us) = (None, 0, None);
    let (mut took_ms, mut interrupts) = (Vec::new(), 0);
    loop {
        let now_us = operated.now_us();
        if interrupt::requested() && interrupts == 0 {
            interrupts = 1;
            conductor.stop(now_us, &mut operated.operator);
        }
        conductor.look(now_us, &mut operated.operator);
        let (begun, answered) = (Instant::now(), conductor.tally().answered);
        conductor.answer(now_us, &mut operated.operator);
        if conductor.tally().answered > answered {
            took_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        }
        operated.send();
        let view = operated.operator.view(now_us);
        say_new(&mut said, &view.messages);
        if view.link.contact {
            heard_us = now_us;
        }
        if matches!(conductor.phase(), Phase::Homeward | Phase::Over) {
            over_us.get_or_insert(now_us);
        }
        let overtime_us = over_us.map_or(0, |over_us| now_us - over_us);
        if overtime_us > END_US && operated.operator.leaving() == Leaving::No {
            operated.operator.want(now_us, Intent::Quit);
        }
        let is_lost = now_us.saturating_sub(heard_us) > SILENT_US || overtime_us > 2 * END_US;
        if operated.operator.leaving() == Leaving::Now || is_lost {
            let ended = farewell(&view);
            output::say(summary(conductor.tally(), &mut took_ms));
            return match ended {
                Exit::Ok if interrupts > 0 => Exit::Interrupted,
                Exit::Ok if !conductor.tally().complete => Exit::NotDone,
                ended => ended,
            };
        }
        operated.hear();
    }
}

/// How the samples went, in words.
fn summary(tally: &Tally, took_ms: &mut [f64]) -> String {
    let Tally { answered, untracked, late, stale, lost, complete } = tally;
    took_ms.sort_by(f64::total_cmp);
    let at = |part: f64| {
        let index = (part * took_ms.len() as f64) as usize;
        took_ms.get(index.min(took_ms.len().saturating_sub(1))).copied().unwrap_or(0.0)
    };
    let late: Vec<String> = late
        .iter()
        .enumerate()
        .filter(|(_, count)| **count > 0)
        .map(|(late, count)| format!("{count} by {late}"))
        .collect();
    format!(
        "{}; {answered} samples answered ({untracked} with the plan alone, {lost} lost, {stale} measurements of a channel missing), a tick in {:.2} ms \
         (99 %: {:.2}, most {:.2}); answers late in samples: {}",
        if *complete { "all was played" } else { "not all was played" },
        at(0.5),
        at(0.99),
        at(1.0),
        if late.is_empty() { "none came".to_owned() } else { late.join(", ") }
    )
}
