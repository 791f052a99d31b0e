//! Catalogue of families in every plan, so that a check in another language needs no copy of the table.

use super::{AGREEMENT, CLEARANCE_M, Family, FamilySet, Kind, Level, ROLLING_SIGN_WIDTH_M_S};
use rollwalk_robot::GRAVITY_M_S2;
use rollwalk_robot::document::alternatives;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

/// Constants and families of the formulation, which are the same in every plan of this program. A plan with other constants or
/// levels is refused, because a report would apply different ones. Wording of equations, order, and families added since the
/// plan was made are ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Formulation {
    /// True if the families of terrain are listed.
    pub on_terrain: bool,
    /// True if the families of joints without a motor are listed.
    pub has_passive_joints: bool,
    /// True if the families of motions at rest are listed.
    pub is_at_rest: bool,
}

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
    fn new(families: impl Iterator<Item = Family>) -> Self {
        Self {
            gravity_m_s2: GRAVITY_M_S2,
            clearance_m: CLEARANCE_M,
            rolling_sign_width_m_s: ROLLING_SIGN_WIDTH_M_S,
            families: families.map(FamilyRecord::new).collect(),
        }
    }
}

impl Serialize for Formulation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let all = Family::ALL.iter().copied();
        let listed = all.filter(|family| {
            (self.on_terrain || !FamilySet::TERRAIN.contains(*family))
                && (self.has_passive_joints || !FamilySet::PASSIVE.contains(*family))
                && (self.is_at_rest || !FamilySet::AT_REST.contains(*family))
        });
        Record::new(listed).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Formulation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let found = Value::deserialize(deserializer)?;
        let all = Record::new(Family::ALL.iter().copied());
        let known = serde_json::to_value(all).map_err(D::Error::custom)?;
        agree(&found, &known).map_err(D::Error::custom)?;
        let lists = |family: Family| {
            let names = found["families"].as_array().into_iter().flatten();
            names.filter_map(|of| of["name"].as_str()).any(|name| name == family.name())
        };
        Ok(Self {
            on_terrain: lists(Family::Foothold),
            has_passive_joints: lists(Family::PassiveJoint),
            is_at_rest: lists(Family::EndLean),
        })
    }
}

/// Compares the catalogue in a file with that of this program.
fn agree(found: &Value, known: &Value) -> Result<(), String> {
    for constant in ["gravity_m_s2", "clearance_m", "rolling_sign_width_m_s"] {
        compare("", found, known, constant)?;
    }
    let families = &found["families"];
    let families =
        families.as_array().ok_or_else(|| format!("families is {families}; expected a list"))?;
    for (index, found) in families.iter().enumerate() {
        let path = format!("families[{index}]");
        let name = &found["name"];
        let family = name.as_str().and_then(Family::by_name).ok_or_else(|| {
            format!(
                "{path}.name is {name}; expected a residual family of this version of rollwalk: \
                 plan the motion again, or use the version that wrote the plan"
            )
        })?;
        let known = &known["families"][family as usize];
        for key in ["kind", "unit", "level", "level_of"] {
            compare(&format!("{path}."), found, known, key)?;
        }
        no_others(&format!("{path}: "), found, known)?;
    }
    no_others("", found, known)
}

/// Refuses fields that the catalogue of this program lacks.
fn no_others(start: &str, found: &Value, known: &Value) -> Result<(), String> {
    let (Value::Object(found), Value::Object(known)) = (found, known) else { return Ok(()) };
    match found.keys().find(|key| !known.contains_key(*key)) {
        Some(key) => {
            let known = alternatives(key, known.keys().map(String::as_str));
            Err(format!("{start}unknown field `{key}`; {known}"))
        }
        None => Ok(()),
    }
}

/// Compares one field; numbers may differ by a relative [`AGREEMENT`].
fn compare(path: &str, found: &Value, known: &Value, key: &str) -> Result<(), String> {
    let (found, known) = (&found[key], &known[key]);
    let near = |(found, known): (f64, f64)| (found - known).abs() <= AGREEMENT * known.abs();
    if found == known || found.as_f64().zip(known.as_f64()).is_some_and(near) {
        return Ok(());
    }
    Err(format!("{path}{key} is {found}; expected {known}, the value in this version of rollwalk"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn catalogue() -> Value {
        serde_json::to_value(Formulation::default()).unwrap()
    }

    fn read(catalogue: &Value) -> Result<Formulation, serde_json::Error> {
        serde_json::from_str(&catalogue.to_string())
    }

    #[test]
    fn catalogues_that_mean_the_same_are_read() {
        let changes: [fn(&mut Value); 5] = [
            |_| (),
            |catalogue| catalogue["families"][5]["equation"] = "Eq. 2.8, in other words".into(),
            |catalogue| catalogue["gravity_m_s2"] = 9.806_650_001.into(),
            |catalogue| catalogue["families"][0]["level"] = (0.1 + 0.2).into(),
            // A plan by a program that lacks a family, and whose families have another order.
            |catalogue| {
                let families = catalogue["families"].as_array_mut().unwrap();
                families.remove(7);
                families.reverse();
            },
        ];
        for (index, change) in changes.into_iter().enumerate() {
            let mut changed = catalogue();
            change(&mut changed);
            assert_eq!(read(&changed).ok(), Some(Formulation::default()), "change {index}");
        }
    }

    #[test]
    fn catalogues_that_mean_something_else_are_refused_by_their_field() {
        let families = catalogue()["families"].as_array().unwrap().clone();
        let cost = families.iter().position(|family| family["kind"] == "cost").unwrap();
        let level_of_cost = format!("/families/{cost}/level");
        let expected_of_cost = format!("families[{cost}].level is 1.0; expected null,");
        let cases: [(&str, Value, &str); 11] = [
            ("/gravity_m_s2", 9.8.into(), "gravity_m_s2 is 9.8; expected 9.80665, the value"),
            ("/clearance_m", Value::Null, "clearance_m is null; expected 0.02,"),
            ("/families", 3.into(), "families is 3; expected a list"),
            ("/families/0", 3.into(), "families[0].name is null; expected a residual family"),
            ("/families/5/name", "slide".into(), "families[5].name is \"slide\"; expected a resid"),
            ("/families/5/unit", "mm/s".into(), "families[5].unit is \"mm/s\"; expected \"m/s\","),
            (
                "/families/5/kind",
                "cost".into(),
                "families[5].kind is \"cost\"; expected \"build\",",
            ),
            ("/families/0/level", 9.0.into(), "families[0].level is 9.0; expected 0.3,"),
            ("/families/0/level", Value::Null, "families[0].level is null; expected 0.3,"),
            (&level_of_cost, 1.0.into(), &expected_of_cost),
            (
                "/families/0/level_of",
                "limit".into(),
                "level_of is \"limit\"; expected \"residual\",",
            ),
        ];
        for (pointer, value, expected) in cases {
            let mut changed = catalogue();
            *changed.pointer_mut(pointer).unwrap() = value;
            let message = read(&changed).expect_err("another catalogue").to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
