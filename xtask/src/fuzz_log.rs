//! Parser of libFuzzer's log: coverage and findings.

/// Number of inputs, coverage and corpus of a run without findings; `None` if the target did not run.
pub fn summary(target: &str, log: &str) -> Option<String> {
    // #5789  DONE   cov: 674 ft: 2779 corp: 285/45Kb lim: 787 exec/s: 275 rss: 29Mb
    let done = log.lines().rev().find(|line| line.starts_with('#') && line.contains("DONE"))?;
    let field = |name: &str| {
        let mut words = done.split_whitespace();
        words.find(|&word| word == name)?;
        words.next()
    };
    let (edges, features, corpus) = (field("cov:")?, field("ft:")?, field("corp:")?);
    let kept = corpus.split('/').next()?;
    let inputs = inputs(log);
    Some(format!("{target}: {inputs}, {edges} edges, {features} features, {kept} inputs kept"))
}

/// Number of inputs that were run.
pub fn inputs(log: &str) -> String {
    let count = log.lines().find_map(|line| line.strip_prefix("stat::number_of_executed_units:"));
    format!("{} inputs", count.map_or("no", str::trim))
}

/// Path of the input that made the target fail; `None` if there is none.
pub fn artifact(log: &str) -> Option<&str> {
    log.lines().find_map(|line| line.split_once("Test unit written to ").map(|(_, path)| path))
}

/// Description of a finding: panic, input, and the command that repeats it.
pub fn finding(target: &str, log: &str) -> String {
    let mut lines = log.lines();
    let panic = lines.by_ref().find(|line| line.contains("panicked at"));
    let message: Vec<&str> =
        lines.take_while(|line| !line.starts_with("stack backtrace")).collect();
    let what = match panic {
        Some(panic) => format!("{panic}\n{}", message.join("\n")),
        // Out of memory, timeout, or not started.
        None => {
            let tail: Vec<&str> = log.lines().rev().take(30).collect();
            tail.into_iter().rev().collect::<Vec<_>>().join("\n")
        }
    };
    let bytes = log.lines().find(|line| line.starts_with("Base64: ")).unwrap_or("");
    let again = match artifact(log) {
        Some(path) => format!(
            "{bytes}\nThe input is {path}; run it again with\n\n    \
             cargo xtask fuzz {target} --input {path}"
        ),
        None => "libFuzzer kept no input".into(),
    };
    format!("fuzz target {target} failed:\n{what}\n{again}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET: &str = "\
#2\tINITED cov: 88 ft: 172 corp: 5/384b exec/s: 0 rss: 27Mb
#113075\tDONE   cov: 128 ft: 633 corp: 194/19Kb lim: 322 exec/s: 5384 rss: 27Mb
Done 113075 runs in 21 second(s)
stat::number_of_executed_units: 113075
";
    const LOUD: &str = "\
#2\tINITED cov: 8 ft: 9 corp: 1/12b exec/s: 0 rss: 27Mb
thread '<unnamed>' (7) panicked at src/planted.rs:15:40:
range end index 114 out of range for slice of length 5
stack backtrace:
   0: rust_begin_unwind
artifact_prefix='a/'; Test unit written to a/crash-8eae
Base64: c2thdGVzawBhcw==
stat::number_of_executed_units: 12342
";

    #[test]
    fn a_quiet_run_is_summed_up() {
        let summary = summary("deframer", QUIET).unwrap();
        assert_eq!(summary, "deframer: 113075 inputs, 128 edges, 633 features, 194 inputs kept");
        assert_eq!(artifact(QUIET), None);
        assert_eq!(super::summary("deframer", "error while loading\n"), None);
    }

    #[test]
    fn a_finding_names_input_and_command() {
        assert_eq!(artifact(LOUD), Some("a/crash-8eae"));
        let finding = finding("planted", LOUD);
        for part in [
            "range end index 114",
            "Base64: c2thdGVzawBhcw==",
            "cargo xtask fuzz planted --input a/crash-8eae",
        ] {
            assert!(finding.contains(part), "{finding}");
        }
        assert!(!finding.contains("rust_begin_unwind"));
        assert!(super::finding("x", "cannot open shared object").contains("shared object"));
    }
}
