//! Words for "did you mean": the nearest of some known names, and their list.

/// Words that people use for a word of robot, motion and library files.
const MEANINGS: [(&str, &str); 14] = [
    ("driven", "actuated"),
    ("powered", "actuated"),
    ("motorised", "actuated"),
    ("motorized", "actuated"),
    ("active", "actuated"),
    ("free", "passive"),
    ("caster", "passive_wheel"),
    ("castor", "passive_wheel"),
    ("undriven", "passive"),
    ("unpowered", "passive"),
    ("fixed", "welded"),
    ("rigid", "welded"),
    ("locked", "welded"),
    ("blade", "skate"),
];

/// The known name most like `given`, if one is near enough to be meant: in its meaning, in its letters, or as the only
/// one that has a word of it.
fn closest<'a>(given: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> Option<&'a str> {
    let words: Vec<_> = given.split(['_', '-', ' ']).collect();
    let means =
        |word: &&str| MEANINGS.iter().find(|(said, _)| said == word).map(|(_, meant)| *meant);
    let meant: Vec<_> = words.iter().map(|word| means(word).unwrap_or(word)).collect();
    let meant = meant.join("_");
    if let Some(name) = known.clone().into_iter().find(|name| *name == meant) {
        return Some(name);
    }
    let similarity = |name: &str| strsim::normalized_damerau_levenshtein(given, name);
    let typed = known
        .clone()
        .into_iter()
        .map(|name| (similarity(name), name))
        // One slip in three letters is still a slip; more is another word.
        .filter(|(score, _)| *score >= 0.6)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let mut sharing =
        known.into_iter().filter(|name| name.split('_').any(|word| words.contains(&word)));
    typed.map(|(_, name)| name).or_else(|| sharing.next().filter(|_| sharing.next().is_none()))
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
        assert_eq!(closest("friction", known), Some("friction_coefficient"));
    }

    #[test]
    fn other_words_for_a_contact_find_its_kind() {
        let kinds = ["point_foot", "welded_wheel", "actuated_wheel", "passive_wheel", "skate"];
        for (given, kind) in [
            ("driven_wheel", "actuated_wheel"),
            ("powered-wheel", "actuated_wheel"),
            ("free_wheel", "passive_wheel"),
            ("caster", "passive_wheel"),
            ("fixed_wheel", "welded_wheel"),
            ("ice_skate", "skate"),
            ("blade", "skate"),
            ("foot", "point_foot"),
            ("actuatd_wheel", "actuated_wheel"),
        ] {
            assert_eq!(closest(given, kinds), Some(kind), "{given}");
        }
        // Any of three.
        assert_eq!(closest("wheel", kinds), None);
        assert_eq!(alternatives("x", []), "known are: none");
    }
}
