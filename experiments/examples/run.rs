//! Runs experiments by name, all without one, and prints what they find.

use cpu_time::ProcessTime;
use rollwalk_experiments::{ALL, Watch};

struct Terminal;

impl Watch for Terminal {
    fn say(&self, line: &str) {
        eprintln!("  {line}");
    }

    fn interrupted(&self) -> bool {
        false
    }
}

fn main() {
    let names: Vec<String> = std::env::args().skip(1).collect();
    for experiment in ALL {
        if !names.is_empty() && names.iter().all(|name| name != experiment.name) {
            continue;
        }
        let begin = ProcessTime::now();
        let Some(outcome) = (experiment.run)(&Terminal) else { continue };
        let cpu_s = begin.elapsed().as_secs_f64();
        println!("{} ({}): {cpu_s:.2} s\n  {}", experiment.name, experiment.source, outcome.setup);
        for check in outcome.checks {
            let holds = match check.holds {
                Some(true) => "ok",
                Some(false) => "NO",
                None => "",
            };
            println!(
                "  {:2} {}: {}, asked {}, reference {}",
                holds, check.what, check.found, check.asked, check.reference
            );
        }
    }
}
