//! Commands that are lists of steps: `cargo xtask test` ([`mod@test`]) and `cargo xtask nightly` ([`nightly`]).
//!
//! [`Run`] prints each step's seconds and a table at the end. A step that keeps one core busy can run in a process of
//! its own beside the steps that follow it.

pub mod nightly;
mod run;
pub mod test;

use clap::ValueEnum;
pub use run::Run;

/// A step of a command; its name is what `--only` takes.
pub trait Step: ValueEnum + 'static {
    /// Subcommand of `cargo xtask` that has these steps.
    const COMMAND: &'static str;
    /// Whether the steps after a failed one run as well.
    const CONTINUES: bool;

    /// Description in a few words.
    fn title(&self) -> &'static str;

    /// Runs the step.
    ///
    /// # Errors
    /// The first failure, with what mends it where that is known.
    fn check(&self) -> Result<(), String>;

    /// Whether the step runs beside those that follow it.
    fn is_beside(&self) -> bool {
        false
    }

    /// Whether no step may run beside it, because it has deadlines in real time.
    fn is_alone(&self) -> bool {
        false
    }
}

/// Runs every step of a command, or `only` one.
///
/// # Errors
/// The failed steps, with the commands that run them alone.
pub fn run<S: Step>(only: Option<S>) -> Result<(), String> {
    let alone = only.is_some();
    let steps = only.map_or_else(|| S::value_variants().to_vec(), |step| vec![step]);
    let mut run = Run::new(S::COMMAND, steps.len());
    for step in &steps {
        let value = step.to_possible_value().expect("no step is hidden");
        let name = value.get_name();
        if !run.collect() && !S::CONTINUES {
            break;
        }
        if step.is_alone() && !run.join() && !S::CONTINUES {
            break;
        }
        if step.is_beside() && !alone {
            run.beside(name, step.title());
        } else {
            run.step(name, step.title(), || step.check());
        }
    }
    if !S::CONTINUES && !run.collect() {
        run.stop();
    }
    run.finish()
}
