//! Every motion of a library, corrected: a folder from which the library is built again.

use super::{Args, Corrected, STEADIER, falls, on, ratios};
use crate::files::{self, Output, file_name};
use crate::inputs::{Library, Source};
use crate::output::{self, Table};
use crate::planning::{Planned, plan_motions};
use crate::{Exit, interrupt};
use miette::{IntoDiagnostic, miette};
use rollwalk_planner::plan::Status;
use toml_edit::{DocumentMut, Item, value};

/// Names in the folder.
const LIBRARY: &str = "library.toml";
const ROBOT: &str = "robot.toml";

/// Plans and corrects the motions, and writes the folder.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let library = Source::Disk.library(&args.input)?;
    let (robot, robot_text) = match &args.robot {
        Some(path) => Source::Disk.robot_and_text(path)?,
        None => (library.robot.clone(), library.robot_text.clone()),
    };
    files::make_folder(&args.output)?;
    // Not after minutes of work.
    for name in [ROBOT, LIBRARY] {
        Output::at(&args.output.join(name))?;
    }
    let feed_forward = library.file.torques && !args.no_feed_forward;
    let Some(planned) = plan_motions(&library, false) else { return Ok(Exit::Interrupted) };
    if let Some(failed) = planned.iter().find(|of| of.plan.solve.status != Status::Converged) {
        let (name, status) = (&failed.plan.motion.name, failed.plan.solve.status);
        return Err(miette!(
            help = "`rollwalk plan` writes its plan, and `rollwalk report` shows where it fails",
            "the plan of `{name}` does not hold: {status}"
        ));
    }
    let mut all = Vec::new();
    for Planned { plan, .. } in planned {
        let plan = on(plan, robot.clone(), robot_text.path.as_ref())?;
        let Some(corrected) = Corrected::find(&plan, args, feed_forward)? else {
            return Ok(Exit::Interrupted);
        };
        if corrected.found.is_none() {
            output::say(format_args!("{}: {}; {STEADIER}", plan.motion.name, falls(&plan)));
        }
        all.push((plan, corrected));
    }
    for (plan, corrected) in &all {
        let plan = corrected.found.as_ref().map_or(plan, |found| &found.plan);
        files::write(&args.output.join(plan_file(&plan.motion.name)), plan.to_json().as_bytes())?;
    }
    files::write(&args.output.join(ROBOT), robot_text.text.as_bytes())?;
    let rewritten = rewritten(&library, feed_forward)?;
    files::write(&args.output.join(LIBRARY), rewritten.as_bytes())?;
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    if args.json {
        let documents: Vec<_> =
            all.iter().map(|(plan, corrected)| corrected.document(plan)).collect();
        output::print_json(&documents)?;
    } else {
        let mut rows = vec![["motion", "before", "after", "moved by"].map(str::to_owned).to_vec()];
        for (plan, corrected) in &all {
            let moved = corrected.found.as_ref().map_or_else(
                || "as planned".to_owned(),
                |found| format!("{:.3} rad", found.largest_rad),
            );
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

/// The library file with plans in place of motion files, everything else as it was written.
fn rewritten(library: &Library, torques: bool) -> miette::Result<String> {
    let text = &library.text;
    let mut document: DocumentMut = text.text.parse().into_diagnostic()?;
    document["robot"] = value(ROBOT);
    if !torques {
        document["torques"] = value(false);
    }
    let tables = document.get_mut("motion").and_then(Item::as_array_of_tables_mut);
    let tables = tables.ok_or_else(|| miette!("{}: write motions as [[motion]]", text.path))?;
    for (table, motion) in tables.iter_mut().zip(&library.file.motions) {
        table.remove("file");
        table["plan"] = value(plan_file(&motion.name));
    }
    Ok(document.to_string())
}
