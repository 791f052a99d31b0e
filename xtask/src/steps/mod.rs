//! Commands that are lists of steps: `cargo xtask test` ([`mod@test`]) and `cargo xtask nightly` ([`nightly`]).
//!
//! [`Run`] prints each step's seconds and a table at the end. A step that keeps one core busy can run in a process of
//! its own beside the steps that follow it.

pub mod nightly;
mod run;
pub mod test;

use crate::changes;
use crate::extent::Extent;
use clap::ValueEnum;
pub use run::Run;

/// A step of a command; its name is what `--only` takes.
pub trait Step: ValueEnum + 'static {
    /// Subcommand of `cargo xtask` that has these steps.
    const COMMAND: &'static str;
    /// Name that `--only` takes.
    fn name(&self) -> String {
        self.to_possible_value().expect("no step is hidden").get_name().to_owned()
    }

    /// Description in a few words.
    fn title(&self) -> &'static str;

    /// Step without whose success this one cannot run.
    fn needs(&self) -> Option<Self> {
        None
    }

    /// Folders and files that the step checks ([`changes::concern`]), if it has a brief form.
    fn checks(&self) -> &'static [&'static str] {
        &[]
    }

    /// Checks that the brief form leaves to `cargo xtask nightly`.
    fn left_out(&self) -> &'static str {
        ""
    }

    /// Runs the step.
    ///
    /// # Errors
    /// The first failure, with what mends it where that is known.
    fn check(&self, extent: Extent) -> Result<(), String>;

    /// True if the step runs in parallel with those that follow it.
    fn is_beside(&self) -> bool {
        false
    }

    /// True if no other step may run at the same time, because the step has deadlines in real time.
    fn is_alone(&self) -> bool {
        false
    }
}

/// Runs every step of a command, or `only` one, in full or `brief`. A failed step keeps those that need it from running, and no
/// others.
///
/// # Errors
/// The failed steps, with the commands that run them alone.
pub fn run<S: Step>(only: Option<S>, brief: bool) -> Result<(), String> {
    let alone = only.is_some();
    // Without git all is checked.
    let changed = changes::files(None).ok();
    let extent = |step: &S| {
        let is_same = changed.as_ref().is_some_and(|files| !changes::concern(files, step.checks()));
        let has_brief = !step.checks().is_empty();
        if has_brief && (brief || !alone && is_same) { Extent::Brief } else { Extent::Short }
    };
    let steps = only.map_or_else(|| S::value_variants().to_vec(), |step| vec![step]);
    let mut run = Run::new(S::COMMAND, steps.len());
    for step in &steps {
        let name = step.name();
        let extent = extent(step);
        if extent == Extent::Brief && !alone {
            run.leave(&name, step.left_out());
        }
        run.collect();
        if step.is_alone() {
            run.join();
        }
        let needed = step.needs().map(|needed| needed.name());
        if let Some(needed) = needed.filter(|needed| run.has_failed(needed)) {
            run.skip(&name, step.title(), &needed);
        } else if step.is_beside() && !alone {
            run.beside(&name, step.title(), extent == Extent::Brief);
        } else {
            run.step(&name, step.title(), || step.check(extent));
        }
    }
    run.finish()
}
