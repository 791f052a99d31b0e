//! Changes on the command line: `thigh=0.13`, `thigh+=0.01`, `xm540=MX-64AT`.

use super::outcome::Swapped;
use miette::{Report, miette};
use rollwalk_design::catalog::Catalog;
use rollwalk_design::designed::Designed;
use rollwalk_design::sweep::speed_of;
use rollwalk_terminal::output;

/// A parameter with the value that it is given, or by which it is changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    name: String,
    value: f64,
    is_change: bool,
}

/// Reads `NAME=VALUE`, `NAME+=VALUE` or `NAME-=VALUE`.
///
/// # Errors
/// It is none of them.
pub fn parse(text: &str) -> Result<Given, String> {
    let (name, value) = text
        .split_once('=')
        .ok_or_else(|| format!("`{text}` has no `=`: give NAME=VALUE or NAME+=CHANGE"))?;
    let number = value.trim();
    let value: f64 =
        number.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
            format!("`{number}` is not a number: give it in the parameter's unit, m or rad")
        })?;
    let (name, sign) = match name.strip_suffix(['+', '-']) {
        Some(shorter) if name.ends_with('-') => (shorter, Some(-1.0)),
        Some(shorter) => (shorter, Some(1.0)),
        None => (name, None),
    };
    Ok(Given {
        name: name.trim().to_owned(),
        value: value * sign.unwrap_or(1.0),
        is_change: sign.is_some(),
    })
}

/// Indices and values of the parameters that are given.
///
/// # Errors
/// A parameter that the design has not, one given twice, or a value outside its bounds.
pub fn values(designed: &Designed, given: &[Given]) -> miette::Result<Vec<(usize, f64)>> {
    let parameters = &designed.file.parameters;
    let mut values: Vec<(usize, f64)> = Vec::new();
    for Given { name, value, is_change } in given {
        let Some(index) = parameters.iter().position(|of| of.name == *name) else {
            let known: Vec<&str> = parameters.iter().map(|of| of.name.as_str()).collect();
            let servo = match designed.model_of(name) {
                Some(_) => format!("; another servo for an actuator: --servo {name}=MODEL"),
                None => String::new(),
            };
            return Err(miette!(
                help = format!("it has {}{servo}", known.join(", ")),
                "design `{}` has no parameter `{name}`",
                designed.file.name
            ));
        };
        let of = &parameters[index];
        let unit = of.place.kind.unit().0;
        let value = if *is_change { designed.original()[index] + value } else { *value };
        if !(of.min..=of.max).contains(&value) {
            return Err(miette!(
                help = "change the bounds in the design file if it can be made",
                "{name} = {value} {unit} is outside its bounds, {} to {} {unit}",
                of.min,
                of.max
            ));
        }
        if values.iter().any(|(other, _)| *other == index) {
            return Err(miette!("parameter `{name}` is given twice"));
        }
        values.push((index, value));
    }
    Ok(values)
}

/// Reads `ACTUATOR=SERVO`.
///
/// # Errors
/// It is no such thing.
pub fn parse_servo(text: &str) -> Result<[String; 2], String> {
    let both =
        text.split_once('=').map(|(of, servo)| [of, servo].map(|word| word.trim().to_owned()));
    let both = both.filter(|both| both.iter().all(|word| !word.is_empty()));
    both.ok_or_else(|| format!("`{text}`: give ACTUATOR=SERVO, such as xm540=MX-64AT"))
}

/// The design with other servos, and what they replace. Says where a servo's mass is not known.
///
/// # Errors
/// An actuator that the robot file has not, a servo that the catalogue has not, or a robot file that breaks a rule with it.
pub fn with_servos(
    designed: &Designed,
    given: &[[String; 2]],
    catalog: &Catalog,
) -> miette::Result<(Designed, Vec<Swapped>)> {
    let (mut changed, mut swapped) = (designed.clone(), Vec::<Swapped>::new());
    for [actuator, name] in given {
        let Some(model) = designed.model_of(actuator) else {
            let nothing = designed.value_of(&speed_of(actuator)).err();
            return Err(miette!(
                help = nothing.map_or_else(String::new, |nothing| nothing.help),
                "the robot file has no actuator `{actuator}`"
            ));
        };
        let Some(servo) = catalog.get(name) else {
            let all: Vec<&str> = catalog.servos().iter().map(|of| of.name.as_str()).collect();
            return Err(miette!(
                help = format!("it has {}", all.join(", ")),
                "the catalogue has no servo `{name}`"
            ));
        };
        if swapped.iter().any(|of| of.actuator == *actuator) {
            return Err(miette!("actuator `{actuator}` is given twice"));
        }
        if let Some(warning) = designed.mass_unknown(actuator) {
            output::say(warning);
        }
        changed = changed.with_servo(actuator, servo).map_err(|error| {
            Report::new(error)
                .wrap_err(format!("with {name} as `{actuator}` the robot file breaks a rule"))
        })?;
        swapped.push(Swapped {
            actuator: actuator.clone(),
            before: model.to_owned(),
            after: name.clone(),
        });
    }
    Ok((changed, swapped))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_values_or_changes() {
        let given = |name: &str, value, is_change| Given { name: name.into(), value, is_change };
        assert_eq!(parse("thigh=0.13"), Ok(given("thigh", 0.13, false)));
        assert_eq!(parse("knee = -0.13"), Ok(given("knee", -0.13, false)));
        assert_eq!(parse("thigh+=0.01"), Ok(given("thigh", 0.01, true)));
        assert_eq!(parse("thigh-=0.01"), Ok(given("thigh", -0.01, true)));
        for wrong in ["thigh", "thigh=", "thigh=1cm", "thigh=nan", "thigh+=inf"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
