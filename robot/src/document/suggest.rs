//! Words for "did you mean": the nearest of some known names, and their list.

/// The known name most like `given`, if one is near enough to be meant.
fn closest<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let similarity = |name: &str| strsim::normalized_damerau_levenshtein(given, name);
    known
        .into_iter()
        .map(|name| (similarity(name), name))
        // One slip in three letters is still a slip; more is another word.
        .filter(|(score, _)| *score >= 0.6)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

/// "did you mean `x`? known are: `x`, `y`" for a help line.
pub fn alternatives<'a>(given: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    let listed: Vec<_> = known.clone().into_iter().map(|name| format!("`{name}`")).collect();
    let list = if listed.is_empty() { "none".to_owned() } else { listed.join(", ") };
    match closest(given, known) {
        Some(name) => format!("did you mean `{name}`? known are: {list}"),
        None => format!("known are: {list}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typos_find_their_word_and_strangers_do_not() {
        let known = ["mass_kg", "radius_m", "friction_coefficient"];
        assert_eq!(closest("mas_kg", known), Some("mass_kg"));
        assert_eq!(closest("frictoin_coefficient", known), Some("friction_coefficient"));
        assert_eq!(closest("amr", ["body", "arm"]), Some("arm"));
        assert_eq!(closest("colour", known), None);
        assert_eq!(alternatives("x", []), "known are: none");
    }
}
