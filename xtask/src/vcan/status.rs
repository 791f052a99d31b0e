//! Exit statuses of commands; a missing status counts as a failure.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

/// Offset of the exit code of a command that was ended by a signal, as in shells.
const SIGNALLED: i32 = 128;

/// Parses the status in the file that the guest writes at its end.
///
/// # Errors
/// Returns an error if the file is missing or incomplete.
pub fn of_guest(file: Option<&str>) -> Result<u8, String> {
    let text = file.ok_or("the virtual machine ended before the command did")?;
    let number = text.strip_suffix('\n').and_then(|number| number.parse().ok());
    number.ok_or_else(|| format!("the virtual machine wrote {text:?} instead of an exit status"))
}

/// Exit code of a command that ran on this machine, as in shells.
///
/// # Errors
/// Returns an error if the command neither exited nor was ended by a signal.
pub fn of_process(status: ExitStatus) -> Result<u8, String> {
    let code = status.code().or_else(|| status.signal().map(|signal| SIGNALLED + signal));
    code.and_then(|code| u8::try_from(code).ok()).ok_or_else(|| {
        format!(
            "the command ended: \
        {status}"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guest_without_a_whole_status_did_not_succeed() {
        assert_eq!(of_guest(Some("0\n")), Ok(0));
        assert_eq!(of_guest(Some("255\n")), Ok(255));
        for bad in
            [None, Some(""), Some("0"), Some("\n"), Some("256\n"), Some("-1\n"), Some("0\n0\n")]
        {
            assert!(of_guest(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn processes_end_as_shells_count() {
        let exited = |code: i32| ExitStatus::from_raw(code << 8);
        assert_eq!(of_process(exited(0)), Ok(0));
        assert_eq!(of_process(exited(3)), Ok(3));
        assert_eq!(of_process(ExitStatus::from_raw(9)), Ok(137));
    }
}
