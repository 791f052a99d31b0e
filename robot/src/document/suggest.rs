//! Suggestions in messages: the known name nearest to a given one, lists of known names, and values in another unit.

use rollwalk_protocol::text::Number;
use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

/// Common synonyms of words in robot, motion and library files.
const MEANINGS: [(&str, &str); 17] = [
    ("driven", "actuated"),
    ("drive", "actuated"),
    ("motor", "actuated"),
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
    ("feet", "foot"),
];

/// Units that keys may end with by mistake: the unit, that of the format, and its factor. Longer units first.
const KEY_UNITS: [(&str, &str, f64); 23] = [
    ("nm_s_deg", "nm_s_rad", 180.0 / PI),
    ("nm_deg", "nm_rad", 180.0 / PI),
    ("kg_mm2", "kg_m2", 1e-6),
    ("kg_cm2", "kg_m2", 1e-4),
    ("g_cm2", "kg_m2", 1e-7),
    ("g_mm2", "kg_m2", 1e-9),
    ("g_m2", "kg_m2", 1e-3),
    ("deg_s", "rad_s", PI / 180.0),
    ("rev_min", "rad_s", TAU / 60.0),
    ("rpm", "rad_s", TAU / 60.0),
    ("kg_cm", "nm", NM_PER_KG_CM),
    ("kgcm", "nm", NM_PER_KG_CM),
    ("nmm", "nm", 1e-3),
    ("mm_s", "m_s", 1e-3),
    ("degrees", "rad", PI / 180.0),
    ("deg", "rad", PI / 180.0),
    ("cm", "m", 1e-2),
    ("mm", "m", 1e-3),
    ("min", "s", 60.0),
    ("ms", "s", 1e-3),
    ("us", "s", 1e-6),
    ("g", "kg", 1e-3),
    ("s", "ms", 1e3),
];

/// Torque of 1 kg·cm, N·m.
const NM_PER_KG_CM: f64 = 0.098_066_5;

/// Known key that a given key means in another unit, with the unit of the given key and the factor of its value.
pub(super) fn in_unit_of<'a>(
    given: &str,
    known: impl IntoIterator<Item = &'a str> + Clone,
) -> Option<(&'a str, &'static str, f64)> {
    KEY_UNITS.iter().find_map(|(unit, right, factor)| {
        let stem = given.strip_suffix(unit)?.strip_suffix('_')?;
        let is_meant = |name: &&str| {
            name.strip_suffix(right).and_then(|name| name.strip_suffix('_')) == Some(stem)
        };
        Some((known.clone().into_iter().find(is_meant)?, *unit, *factor))
    })
}

/// Smallest similarity of a misspelled word to the correct one. One wrong letter in three is still accepted.
const SLIP: f64 = 0.6;
/// Suffixes of servo variants that share one name in the protocol.
const VARIANTS: [&str; 2] = ["-T", "-R"];
/// Minimum length of a significant word in a name, letters. Shorter words are units.
const WORD_MIN: usize = 3;

/// Hint that a value out of range would be in range in another common unit; empty if it would not. `unit` starts with the unit
/// of the range. For a fraction, `unit` is empty or starts with `(fraction`.
pub fn in_other_unit(value: f64, range: &RangeInclusive<f64>, unit: &str) -> String {
    let is_share = *range.start() >= 0.0 && *range.end() <= 1.0;
    let (other, right, times) = match unit.split(' ').next().unwrap_or_default() {
        "m" => ("mm", " m", 1e-3),
        "kg" => ("g", " kg", 1e-3),
        "s" => ("ms", " s", 1e-3),
        "rad" => ("degrees", " rad", 1f64.to_radians()),
        "" | "(fraction" if is_share => ("%", "", 1e-2),
        _ => return String::new(),
    };
    let meant = value * times;
    if range.contains(&value) || !range.contains(&meant) {
        return String::new();
    }
    let meant = (meant * 1e4).round() * 1e-4;
    format!("; {value} {other} would be {}{right}", Number(meant))
}

/// Known name that a given name probably means: by synonyms, by spelling, or as the only name that shares the largest number of
/// words. `None` if no name is similar enough.
pub(super) fn closest<'a>(
    given: &str,
    known: impl IntoIterator<Item = &'a str> + Clone,
) -> Option<&'a str> {
    let words = words_of(given);
    let means =
        |word: &&str| MEANINGS.iter().find(|(said, _)| said == word).map(|(_, meant)| *meant);
    let meant: Vec<_> = words.iter().map(|word| means(word).unwrap_or(word)).collect();
    let meant = meant.join("_");
    let meant = sorted(words_of(&meant));
    if let Some(name) = known.clone().into_iter().find(|name| sorted(words_of(name)) == meant) {
        return Some(name);
    }
    let alike = known.clone().into_iter().filter_map(|name| Some((similarity(given, name)?, name)));
    let mut typed: Vec<_> = alike.collect();
    typed.sort_by(|a, b| b.0.total_cmp(&a.0));
    match typed[..] {
        [] => sharing(&words, known),
        // `x` is equally near to `+x` and `-x`.
        [(best, _), (second, _), ..] if best == second => None,
        [(_, name), ..] => Some(name),
    }
}

/// Similarity of two names, up to 1; `None` if one is not a misspelling of the other. Common words do not compensate for a
/// different rest: `driving_wheel` and `passive_wheel` share only `_wheel`.
fn similarity(given: &str, name: &str) -> Option<f64> {
    let similarity = strsim::normalized_damerau_levenshtein;
    let letters = |name: &str| {
        let plain = name.chars().filter(char::is_ascii_alphanumeric);
        plain.map(|c| c.to_ascii_lowercase()).collect::<String>()
    };
    let digits = |name: &str| name.chars().filter(char::is_ascii_digit).collect::<String>();
    if letters(given) == letters(name) {
        return Some(1.0);
    }
    // Mark of a variant: `-T` is a servo with another connector.
    let variant = given.strip_prefix(name).or(name.strip_prefix(given));
    if is_model(name) && variant.is_some_and(|of| VARIANTS.contains(&of)) {
        return Some(1.0);
    }
    if is_model(name) || digits(given) != digits(name) {
        return None;
    }
    let (one, two) = (words_of(given), words_of(name));
    let rest = |of: &[&str], other: &[&str]| {
        of.iter().filter(|word| !other.contains(word)).copied().collect::<Vec<_>>().join("_")
    };
    let (rest_one, rest_two) = (rest(&one, &two), rest(&two, &one));
    let whole = similarity(given, name);
    let apart = !rest_one.is_empty() && !rest_two.is_empty();
    let least = if apart { whole.min(similarity(&rest_one, &rest_two)) } else { whole };
    (least >= SLIP).then_some(whole)
}

/// Returns true for a product name. Similar product names denote different products.
fn is_model(name: &str) -> bool {
    let has = |kind: fn(&char) -> bool| name.chars().any(|c| kind(&c));
    has(char::is_ascii_digit) && has(char::is_ascii_uppercase)
}

/// Known name that has more words in common with the given name than any other known name.
fn sharing<'a>(words: &[&str], known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let shared = |name: &str| {
        let same = |word: &&str| word.len() >= WORD_MIN && words.contains(word);
        words_of(name).into_iter().filter(|word| same(word)).count()
    };
    let known = known.into_iter().filter(|name| !is_model(name));
    let mut scores: Vec<_> = known.map(|name| (shared(name), name)).collect();
    scores.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    match scores[..] {
        [(best, name), ..]
            if best > 0 && scores.iter().filter(|(s, _)| *s == best).count() == 1 =>
        {
            Some(name)
        }
        _ => None,
    }
}

fn words_of(name: &str) -> Vec<&str> {
    name.split(['_', '-', ' ']).collect()
}

fn sorted(mut words: Vec<&str>) -> Vec<&str> {
    words.sort_unstable();
    words
}

/// Help text "did you mean `x`? valid names: `x`, `y`".
pub fn alternatives<'a>(given: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    let listed: Vec<_> = known.clone().into_iter().map(|name| format!("`{name}`")).collect();
    let list = if listed.is_empty() { "none".to_owned() } else { listed.join(", ") };
    match closest(given, known) {
        Some(name) => format!("did you mean `{name}`? valid names: {list}"),
        None => format!("valid names: {list}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_another_unit_are_said_in_the_right_one() {
        for (value, range, unit, expected) in [
            (
                80.0,
                0.3..=0.95,
                "(fraction of the cycle in which a foot is in stance)",
                "; 80 % would be 0.8",
            ),
            (30.0, 0.0..=1.0, "m", "; 30 mm would be 0.03 m"),
            (1500.0, 1e-6..=1000.0, "kg", "; 1500 g would be 1.5 kg"),
            (3000.0, 0.1..=60.0, "s", "; 3000 ms would be 3 s"),
            (-60.0, -2.2..=-0.2, "rad", "; -60 degrees would be -1.0472 rad"),
            // In range, or out of range in every unit.
            (0.5, 0.0..=1.0, "m", ""),
            (3e6, 0.0..=1.0, "m", ""),
            (60.0, -2.2..=-0.2, "rad", ""),
            (80.0, 0.0..=2.0, "", ""),
            (80.0, 0.0..=1.0, "N·m", ""),
        ] {
            assert_eq!(in_other_unit(value, &range, unit), expected, "{value} {unit}");
        }
    }

    #[test]
    fn keys_in_another_unit_find_theirs() {
        let known = [
            "position_min_rad",
            "radius_m",
            "origin_in_parent_m",
            "kp_nm_rad",
            "torque_max_nm",
            "watchdog_ms",
            "speed_max_rad_s",
            "mass_kg",
            "duration_s",
        ];
        for (given, key, unit, factor) in [
            ("position_min_deg", "position_min_rad", "deg", 0.017_453_292_519_943_295),
            ("radius_mm", "radius_m", "mm", 1e-3),
            ("origin_in_parent_cm", "origin_in_parent_m", "cm", 1e-2),
            ("kp_nm_deg", "kp_nm_rad", "nm_deg", 57.295_779_513_082_32),
            ("torque_max_kg_cm", "torque_max_nm", "kg_cm", 0.098_066_5),
            ("watchdog_s", "watchdog_ms", "s", 1e3),
            ("speed_max_rpm", "speed_max_rad_s", "rpm", TAU / 60.0),
            ("mass_g", "mass_kg", "g", 1e-3),
            ("duration_ms", "duration_s", "ms", 1e-3),
        ] {
            assert_eq!(in_unit_of(given, known), Some((key, unit, factor)), "{given}");
        }
        for other in ["height_mm", "radius", "mm", "position_min_rad"] {
            assert_eq!(in_unit_of(other, known), None, "{other}");
        }
    }

    #[test]
    fn variants_of_a_servo_are_meant() {
        let known = ["XM430-W210", "XL330-M288", "XM430-W350"];
        assert_eq!(closest("XL330-M288-T", known), Some("XL330-M288"));
        assert_eq!(closest("XM430-W350-R", known), Some("XM430-W350"));
        assert_eq!(closest("XM430-W210-X", known), None);
    }

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
    fn the_nearest_is_meant_and_of_two_as_near_neither() {
        let hips = ["fl_hip", "fr_hip", "rl_hip", "rr_hip"];
        for given in ["fl_hp", "fl_hippp"] {
            assert_eq!(closest(given, hips), Some("fl_hip"), "{given}");
        }
        assert_eq!(closest("x", ["+x", "-x", "+y", "-y"]), None);
    }

    #[test]
    fn neighbours_in_a_series_are_not_meant() {
        let servos = ["XM430-W210", "XM430-W350", "XM540-W270", "XH430-V350"];
        for given in ["XL430-W250", "XL430-W210", "XM430-W250", "XM430"] {
            assert_eq!(closest(given, servos), None, "{given}");
        }
        assert_eq!(closest("xm430w210", servos), Some("XM430-W210"));
        assert_eq!(closest("leg_2", ["leg_1", "leg_3"]), None);
        assert_eq!(
            closest("inertia_in_lnk_kg_m2", ["inertia_in_link_kg_m2"]),
            Some("inertia_in_link_kg_m2")
        );
    }

    #[test]
    fn units_are_slips_and_ends_of_ranges_are_not() {
        let known = ["position_min_rad", "position_max_rad", "radius_m", "origin_in_parent_m"];
        assert_eq!(closest("position_min_deg", known), Some("position_min_rad"));
        assert_eq!(closest("positon_min_rad", known), Some("position_min_rad"));
        assert_eq!(closest("radius_mm", known), Some("radius_m"));
        assert_eq!(closest("radiusm", known), Some("radius_m"));
        assert_eq!(closest("colour_m", known), None);
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
        // One of three, or none.
        for given in ["wheel", "driving_wheel", "steered_wheel", "omni_wheel", "mecanum_wheel"] {
            assert_eq!(closest(given, kinds), None, "{given}");
        }
        assert_eq!(closest("wheel_driven", kinds), Some("actuated_wheel"));
        assert_eq!(alternatives("x", []), "valid names: none");
    }
}
