//! Changes given on the command line: `thigh=0.13`, `thigh+=0.01`, `xm540=MX-64AT`.

use super::outcome::ServoChange;
use miette::{Report, miette};
use rollwalk_design::catalog::Catalog;
use rollwalk_design::designed::Designed;
use rollwalk_design::sweep::speed_of;
use rollwalk_terminal::output;

/// Parameter with its new value, or with the difference to its present value.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSetting {
    name: String,
    value: f64,
    is_change: bool,
}

/// Parses `NAME=VALUE`, `NAME+=VALUE` or `NAME-=VALUE`.
///
/// # Errors
/// Returns an error if the text has none of these forms.
pub fn parse(text: &str) -> Result<ParameterSetting, String> {
    let (name, value) = text
        .split_once('=')
        .ok_or_else(|| format!("`{text}` has no `=`: give NAME=VALUE or NAME+=CHANGE"))?;
    let number = value.trim();
    let value: f64 =
        number.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
            format!(
                "`{number}` is not a number: give a value in the unit of the parameter, m or rad"
            )
        })?;
    let (name, sign) = match name.strip_suffix(['+', '-']) {
        Some(shorter) if name.ends_with('-') => (shorter, Some(-1.0)),
        Some(shorter) => (shorter, Some(1.0)),
        None => (name, None),
    };
    Ok(ParameterSetting {
        name: name.trim().to_owned(),
        value: value * sign.unwrap_or(1.0),
        is_change: sign.is_some(),
    })
}

/// Returns the indices and new values of the given parameters.
///
/// # Errors
/// Returns an error if the design lacks a parameter, if one is given twice, or if a value is outside its bounds.
pub fn values(
    designed: &Designed,
    given: &[ParameterSetting],
) -> miette::Result<Vec<(usize, f64)>> {
    let parameters = &designed.file.parameters;
    let mut values: Vec<(usize, f64)> = Vec::new();
    for ParameterSetting { name, value, is_change } in given {
        let Some(index) = parameters.iter().position(|of| of.name == *name) else {
            let known: Vec<&str> = parameters.iter().map(|of| of.name.as_str()).collect();
            let servo = match designed.model_of(name) {
                Some(_) => format!("; to change the servo, give --servo {name}=MODEL"),
                None => String::new(),
            };
            return Err(miette!(
                help = format!("give one of {}{servo}", known.join(", ")),
                "design `{}` has no parameter `{name}`",
                designed.file.name
            ));
        };
        let of = &parameters[index];
        let unit = of.place.kind.unit().0;
        let value = if *is_change { designed.original()[index] + value } else { *value };
        if !(of.min..=of.max).contains(&value) {
            return Err(miette!(
                help = "give a value within the bounds, or change the bounds in the design file",
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

/// Parses `ACTUATOR=SERVO`.
///
/// # Errors
/// Returns an error if the text has another form.
pub fn parse_servo(text: &str) -> Result<[String; 2], String> {
    let both =
        text.split_once('=').map(|(of, servo)| [of, servo].map(|word| word.trim().to_owned()));
    let both = both.filter(|both| both.iter().all(|word| !word.is_empty()));
    both.ok_or_else(|| format!("`{text}`: give ACTUATOR=SERVO, such as xm540=MX-64AT"))
}

/// Returns the design with other servos, and the list of replacements. Prints a warning if the mass of a servo is unknown.
///
/// # Errors
/// Returns an error if the robot file lacks an actuator, if the catalogue lacks a servo, if an actuator is given twice, or if
/// the changed robot file breaks a rule.
pub fn with_servos(
    designed: &Designed,
    given: &[[String; 2]],
    catalog: &Catalog,
) -> miette::Result<(Designed, Vec<ServoChange>)> {
    let (mut changed, mut swapped) = (designed.clone(), Vec::<ServoChange>::new());
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
                help = format!("give one of {}", all.join(", ")),
                "the catalogue has no servo `{name}`"
            ));
        };
        if swapped.iter().any(|of| of.actuator == *actuator) {
            return Err(miette!("actuator `{actuator}` is given twice"));
        }
        if let Some(warning) = designed.mass_unknown(actuator) {
            output::print_line(warning);
        }
        changed = changed.with_servo(actuator, servo).map_err(|error| {
            Report::new(error)
                .wrap_err(format!("with {name} as `{actuator}` the robot file breaks a rule"))
        })?;
        swapped.push(ServoChange {
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
        let given =
            |name: &str, value, is_change| ParameterSetting { name: name.into(), value, is_change };
        assert_eq!(parse("thigh=0.13"), Ok(given("thigh", 0.13, false)));
        assert_eq!(parse("knee = -0.13"), Ok(given("knee", -0.13, false)));
        assert_eq!(parse("thigh+=0.01"), Ok(given("thigh", 0.01, true)));
        assert_eq!(parse("thigh-=0.01"), Ok(given("thigh", -0.01, true)));
        for wrong in ["thigh", "thigh=", "thigh=1cm", "thigh=nan", "thigh+=inf"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
