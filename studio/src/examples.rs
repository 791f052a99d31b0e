//! Gallery entries of the shipped files.

use crate::messages::{ShippedFile, ShippedKind};
use toml_edit::Document;

/// Returns all shipped robots, motions, libraries and designs.
pub fn listed() -> Vec<ShippedFile> {
    rollwalk_shipped::FILES.iter().filter_map(|&(path, text)| entry(path, text)).collect()
}

fn entry(path: &'static str, text: &str) -> Option<ShippedFile> {
    let of = match path.split('/').next()? {
        "robots" => ShippedKind::Robot,
        "motions" if path.ends_with("_library.toml") => ShippedKind::Library,
        "motions" => ShippedKind::Motion,
        // Sweeps are only for the command line.
        "designs" if path.ends_with("_sweep.toml") => return None,
        "designs" => ShippedKind::Design,
        _ => return None,
    };
    let document = Document::parse(text).ok()?;
    let string = |key: &str| Some(document.get(key)?.as_str()?.to_owned());
    let stem = path.rsplit('/').next()?.trim_end_matches(".toml");
    let name = string("name").unwrap_or_else(|| stem.to_owned());
    Some(ShippedFile { path, of, name, title: title(text), robot: string("robot") })
}

/// First comment of a file, without its notes on format and sources.
fn title(text: &str) -> String {
    let lines = text.lines().map_while(|line| line.strip_prefix('#')).map(str::trim);
    let lines: Vec<_> = lines.take_while(|line| !line.is_empty()).collect();
    let words = lines.join(" ");
    let end = words.find("Format:").unwrap_or(words.len());
    words[..end].trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_robot_and_motion_has_a_name_and_a_title() {
        let listed = listed();
        for example in &listed {
            assert!(!example.title.is_empty(), "{} has no title", example.path);
            assert_eq!(
                example.robot.is_none(),
                example.of == ShippedKind::Robot,
                "{}",
                example.path
            );
        }
        let walk = listed.iter().find(|example| example.path == "motions/walk.toml").unwrap();
        let title = "AgileBot walks: one foot after the other, with at least three on the ground.";
        assert_eq!((&*walk.name, &*walk.title), ("walk", title));
        assert_eq!(walk.robot.as_deref(), Some("../robots/agilebot.toml"));
    }
}
