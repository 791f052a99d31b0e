//! Selection of rows of a benchmark by name.

use miette::miette;
use std::path::Path;

/// Selection of rows.
#[derive(clap::Args)]
pub struct RowFilter {
    /// Name of the row to run; if no row has this name, all rows whose names contain it [default: all rows].
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
}

impl RowFilter {
    /// Returns the option `--only` as command-line arguments.
    pub fn words(&self) -> Vec<String> {
        self.only.iter().flat_map(|only| ["--only".to_owned(), only.clone()]).collect()
    }

    /// Returns the rows to run. `file` returns the motion file of a row, whose stem is the name of the row.
    ///
    /// # Errors
    /// Returns an error with the names of all rows if no name matches.
    pub fn choose<'a, T>(&self, rows: &'a [T], file: fn(&T) -> &str) -> miette::Result<Vec<&'a T>> {
        let Some(only) = &self.only else { return Ok(rows.iter().collect()) };
        let with = |fits: &dyn Fn(&str) -> bool| -> Vec<&'a T> {
            rows.iter().filter(|row| fits(name(file(row)))).collect()
        };
        let mut chosen = with(&|name| name == only);
        if chosen.is_empty() {
            chosen = with(&|name| name.contains(only.as_str()));
        }
        if chosen.is_empty() {
            let names: Vec<_> = rows.iter().map(|row| name(file(row))).collect();
            return Err(miette!(
                help = format!("give one of {}", names.join(", ")),
                "there is no row `{only}`"
            ));
        }
        Ok(chosen)
    }
}

/// Name of the row of a motion file.
fn name(file: &str) -> &str {
    Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or(file)
}

#[cfg(test)]
mod tests {
    use super::RowFilter;

    const FILES: [&str; 3] =
        ["motions/roll.toml", "motions/x/walk_and_roll.toml", "motions/walk.toml"];

    fn choose(only: Option<&str>) -> miette::Result<Vec<&'static &'static str>> {
        RowFilter { only: only.map(str::to_owned) }.choose(&FILES, |file| file)
    }

    #[test]
    fn a_whole_name_goes_before_a_part_of_one() {
        assert_eq!(choose(None).unwrap().len(), 3);
        assert_eq!(choose(Some("roll")).unwrap(), [&FILES[0]]);
        assert_eq!(choose(Some("wal")).unwrap(), [&FILES[1], &FILES[2]]);
    }

    #[test]
    fn a_wrong_name_is_told_the_right_ones() {
        // A name does not contain folders.
        let error = choose(Some("motions")).unwrap_err();
        assert!(error.to_string().contains("`motions`"), "{error}");
        assert_eq!(error.help().unwrap().to_string(), "give one of roll, walk_and_roll, walk");
    }
}
