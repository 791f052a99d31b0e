//! The catalogue as every plan carries it, so that a check in another language needs no table of its own.

use super::{CLEARANCE_M, Family, Kind, Level, ROLLING_SIGN_WIDTH_M_S};
use rollwalk_robot::GRAVITY_M_S2;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

/// Constants and families of the formulation. The value is the same in every plan of this program: a plan
/// with other ones is refused, because its levels are not those that a report applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Formulation;

#[derive(Serialize)]
struct Record {
    gravity_m_s2: f64,
    clearance_m: f64,
    rolling_sign_width_m_s: f64,
    families: Vec<FamilyRecord>,
}

#[derive(Serialize)]
struct FamilyRecord {
    name: Family,
    equation: &'static str,
    kind: Kind,
    unit: &'static str,
    level: Option<f64>,
    level_of: &'static str,
}

impl FamilyRecord {
    fn new(family: Family) -> Self {
        let (level, level_of) = match family.level() {
            Level::Residual(level) => (Some(level), "residual"),
            Level::OfLimit(fraction) => (Some(fraction), "limit"),
            Level::None => (None, "none"),
        };
        Self {
            name: family,
            equation: family.equation(),
            kind: family.kind(),
            unit: family.unit().symbol(),
            level,
            level_of,
        }
    }
}

impl Record {
    fn new() -> Self {
        Self {
            gravity_m_s2: GRAVITY_M_S2,
            clearance_m: CLEARANCE_M,
            rolling_sign_width_m_s: ROLLING_SIGN_WIDTH_M_S,
            families: Family::ALL.iter().copied().map(FamilyRecord::new).collect(),
        }
    }
}

impl Serialize for Formulation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Record::new().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Formulation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let found = Value::deserialize(deserializer)?;
        let expected = serde_json::to_value(Record::new()).map_err(D::Error::custom)?;
        match first_difference(&found, &expected) {
            None => Ok(Self),
            Some((path, found, expected)) => Err(D::Error::custom(format!(
                "{path} is {found}; expected {expected}, as this program plans and reports"
            ))),
        }
    }
}

/// Path of the first value that differs, with the found and the expected value.
fn first_difference(found: &Value, expected: &Value) -> Option<(String, Value, Value)> {
    let within = |key: String, found: Option<&Value>, expected: &Value| {
        let found = found.unwrap_or(&Value::Null);
        first_difference(found, expected).map(|(rest, found, expected)| {
            let dot = if rest.is_empty() || rest.starts_with('[') { "" } else { "." };
            (format!("{key}{dot}{rest}"), found, expected)
        })
    };
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) if found.len() == expected.len() => {
            expected
                .iter()
                .find_map(|(key, expected)| within(key.clone(), found.get(key), expected))
        }
        (Value::Array(found), Value::Array(expected)) if found.len() == expected.len() => expected
            .iter()
            .enumerate()
            .find_map(|(index, expected)| within(format!("[{index}]"), found.get(index), expected)),
        _ => (found != expected).then(|| (String::new(), found.clone(), expected.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catalogue_reads_back_and_another_one_is_refused_by_its_field() {
        let text = serde_json::to_string(&Formulation).unwrap();
        assert_eq!(serde_json::from_str::<Formulation>(&text).unwrap(), Formulation);
        for (from, to, expected) in [
            ("\"level\":0.3", "\"level\":9.0", "families[0].level is 9.0; expected 0.3,"),
            ("9.80665", "9.8", "gravity_m_s2 is 9.8; expected 9.80665,"),
            ("\"slip\"", "\"slide\"", "families[5].name is \"slide\"; expected \"slip\","),
        ] {
            let error = serde_json::from_str::<Formulation>(&text.replacen(from, to, 1));
            let message = error.expect_err("another catalogue").to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
