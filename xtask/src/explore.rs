//! A large sweep over designs, split in every way: `tests/sweeps/split.sh`.

use crate::{debian, shell, workspace};

/// Explores the sweep whole, interrupted, by GNU parallel and by a Slurm of two nodes on the loopback interface.
///
/// # Errors
/// Tables that differ, or the command that installs what is missing.
pub fn check() -> Result<(), String> {
    debian::need(&["parallel", "slurm-wlm", "munge"]).map_err(|install| {
        format!("the check needs GNU parallel and Slurm. On Debian:\n\n    {install}")
    })?;
    let programs = workspace::optimised_programs()?;
    let rollwalk = workspace::find(&programs, "tests", "rollwalk-under-test", false)?;
    let out = shell::target_folder().join("sweeps");
    let mut split = shell::command("tests/sweeps/split.sh", &[&rollwalk.path]);
    shell::run(split.arg("tests/sweeps/sweep.toml").arg(out))
}
