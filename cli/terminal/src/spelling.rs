//! Typing errors in names of commands, options and files.

/// Maximum number of wrong letters in a name that is still a typing error.
const SLIPS_MAX: usize = 2;

/// Number of wrong letters in `given` if it is probably a misspelling of `known`. In a short name fewer than half of the letters
/// may be wrong.
pub fn slips(given: &str, known: &str) -> Option<usize> {
    let slips = strsim::damerau_levenshtein(given, known);
    (slips <= SLIPS_MAX && 2 * slips < given.chars().count()).then_some(slips)
}

#[cfg(test)]
mod tests {
    use super::slips;

    #[test]
    fn near_names_are_slips_and_others_are_not() {
        assert_eq!(slips("kti", "kit"), Some(1));
        assert_eq!(slips("plann", "plan"), Some(1));
        assert_eq!(slips("walk", "walk"), Some(0));
        for (given, known) in [("stairs", "gains"), ("license", "console"), ("a", "b"), ("", "b")] {
            assert_eq!(slips(given, known), None, "{given} {known}");
        }
    }
}
