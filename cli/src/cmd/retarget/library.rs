//! Corrects all motions of a library, and writes a folder from which the library can be built again.

use super::{Args, CorrectedPlan, STEADIER, falls, on};
use crate::played::ratios;
use miette::{IntoDiagnostic, miette};
use rollwalk_planner::plan::Status;
use rollwalk_terminal::files::{self, Output, file_name};
use rollwalk_terminal::inputs::{Library, Source};
use rollwalk_terminal::output::{self, Table};
use rollwalk_terminal::planning::{TimedPlan, plan_motions};
use rollwalk_terminal::{Exit, interrupt};
use toml_edit::{DocumentMut, Item, Value, value};

/// Name of the library file in the folder.
const LIBRARY: &str = "library.toml";
/// Name of the robot file in the folder.
const ROBOT: &str = "robot.toml";

/// Plans and corrects the motions, and writes the folder.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let library = Source::Disk.library(&args.input)?;
    let (robot, robot_text) = match &args.robot {
        Some(path) => Source::Disk.robot_and_text(path)?,
        None => (library.robot.clone(), library.robot_text.clone()),
    };
    files::make_folder(&args.output)?;
    let feed_forward = library.file.torques && !args.no_feed_forward;
    // These errors are reported before minutes of work.
    let rewritten = rewritten(&library, feed_forward)?;
    let plans = plan_files(&library)?;
    for name in plans.iter().map(String::as_str).chain([ROBOT, LIBRARY]) {
        Output::at(&args.output.join(name))?;
    }
    let Some(planned) = plan_motions(&library, false) else { return Ok(Exit::Interrupted) };
    if let Some(failed) = planned.iter().find(|of| of.plan.solve.status != Status::Converged) {
        let (name, status) = (&failed.plan.motion.name, failed.plan.solve.status);
        return Err(miette!(
            help = "write the plan with `rollwalk plan`, and find where it fails with `rollwalk \
                report`",
            "the plan of `{name}` fails its checks: {status}"
        ));
    }
    let mut all = Vec::new();
    for TimedPlan { plan, .. } in planned {
        let plan = on(plan, robot.clone(), robot_text.path.as_ref())?;
        let Some(corrected) = CorrectedPlan::find(&plan, args, feed_forward)? else {
            return Ok(Exit::Interrupted);
        };
        if corrected.found.is_none() {
            output::print_line(format_args!("{}: {}; {STEADIER}", plan.motion.name, falls(&plan)));
        }
        all.push((plan, corrected));
    }
    for ((plan, corrected), file) in all.iter().zip(&plans) {
        files::write(&args.output.join(file), corrected.better(plan).to_json().as_bytes())?;
    }
    files::write(&args.output.join(ROBOT), robot_text.text.as_bytes())?;
    files::write(&args.output.join(LIBRARY), rewritten.as_bytes())?;
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    if args.json {
        let documents: Vec<_> =
            all.iter().map(|(plan, corrected)| corrected.document(plan)).collect();
        output::print_json(&documents)?;
    } else {
        let mut rows =
            vec![["motion", "before", "after", "correction"].map(str::to_owned).to_vec()];
        for (plan, corrected) in &all {
            let moved = match &corrected.found {
                Some(found) if *corrected.better(plan) == found.plan => {
                    format!("{:.3} rad", found.largest_rad)
                }
                _ => "as planned".to_owned(),
            };
            let [before, after] = [&corrected.before, &corrected.after].map(ratios);
            rows.push(vec![plan.motion.name.clone(), before, after, moved]);
        }
        let file = args.output.join(LIBRARY);
        output::print(&format!(
            "{}\nwrote {}; next: rollwalk library build {} -o {}.rwl",
            Table::from(rows).render(),
            args.output.display(),
            file.display(),
            library.file.name
        ))?;
    }
    let holds = all.iter().all(|(_, corrected)| corrected.holds());
    Ok(if holds { Exit::Ok } else { Exit::DoesNotHold })
}

fn plan_file(motion: &str) -> String {
    format!("{}.json", file_name(motion))
}

/// Names of the plan files.
///
/// # Errors
/// Returns an error if two plans would have the same file name.
fn plan_files(library: &Library) -> miette::Result<Vec<String>> {
    let motions = &library.file.motions;
    let files: Vec<_> = motions.iter().map(|motion| plan_file(&motion.name)).collect();
    for (number, file) in files.iter().enumerate() {
        if let Some(earlier) = files[..number].iter().position(|known| known == file) {
            return Err(miette!(
                help = "rename one of the motions: file names contain letters and digits only",
                "{}: the plans of `{}` and `{}` would both be {file}",
                library.text.path,
                motions[earlier].name,
                motions[number].name
            ));
        }
    }
    Ok(files)
}

/// Replaces the value of a key, and keeps its comments.
fn replace(document: &mut DocumentMut, key: &str, new: impl Into<Value>) {
    let mut new = new.into();
    if let Some(old) = document.get(key).and_then(Item::as_value) {
        *new.decor_mut() = old.decor().clone();
    }
    document[key] = Item::Value(new);
}

/// Library file with plans in place of motion files; everything else is kept as written.
fn rewritten(library: &Library, torques: bool) -> miette::Result<String> {
    let text = &library.text;
    let mut document: DocumentMut = text.text.parse().into_diagnostic()?;
    replace(&mut document, "robot", ROBOT);
    if !torques {
        replace(&mut document, "torques", false);
    }
    let tables = document.get_mut("motion").and_then(Item::as_array_of_tables_mut);
    let tables = tables.ok_or_else(|| miette!("{}: write motions as [[motion]]", text.path))?;
    for (table, motion) in tables.iter_mut().zip(&library.file.motions) {
        // A plan replaces the motion file. The comment above the motion file remains.
        let above = table.key("file").map(|key| key.leaf_decor().clone());
        table.remove("file");
        table["plan"] = value(plan_file(&motion.name));
        if let (Some(above), Some(mut key)) = (above, table.key_mut("plan")) {
            *key.leaf_decor_mut() = above;
        }
    }
    Ok(document.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_key_has_is_replaced_and_its_comments_are_not() {
        let text = "# whose\nrobot = \"a.toml\"   # the old one\ntorques = true # strong\nx = 1\n";
        let mut document: DocumentMut = text.parse().unwrap();
        replace(&mut document, "robot", "b.toml");
        replace(&mut document, "torques", false);
        replace(&mut document, "new", 2);
        let expected = "# whose\nrobot = \"b.toml\"   # the old one\ntorques = false # strong\nx = 1\nnew = 2\n";
        assert_eq!(document.to_string(), expected);
    }
}
