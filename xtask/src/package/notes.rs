//! Release notes: the newest section of the changelog as a separate document.

/// Returns the newest section: its title, and its parts one level higher. Returns `None` without a section.
pub fn newest(changelog: &str) -> Option<String> {
    let (_, rest) = changelog.split_once("\n## ")?;
    let section = rest.split("\n## ").next()?;
    let lines = section.trim_end().lines().enumerate().map(|(number, line)| match number {
        0 => format!("# Rollwalk: {line}\n"),
        _ => match line.strip_prefix("###") {
            Some(title) => format!("##{title}\n"),
            None => format!("{line}\n"),
        },
    });
    Some(lines.collect())
}

#[cfg(test)]
mod tests {
    use super::newest;

    #[test]
    fn notes_are_the_newest_section_alone() {
        let changelog = "# Changelog\n\nIntro.\n\n## 0.2.0\n\nCompatibility: plan 3.\n\n### Robot\n\n- A.\n  B ## c.\n\n\
                         ## 0.1.0\n\n### Robot\n\n- Old.\n";
        let expected =
            "# Rollwalk: 0.2.0\n\nCompatibility: plan 3.\n\n## Robot\n\n- A.\n  B ## c.\n";
        assert_eq!(newest(changelog).as_deref(), Some(expected));
        assert_eq!(newest("# Changelog\n\nNothing yet.\n"), None);
    }
}
