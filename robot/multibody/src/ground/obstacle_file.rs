//! Obstacles in terrain files: tables `[[obstacle]]`, each a box or a capsule.

use super::obstacle::{Obstacle, ObstacleShape};
use super::{Capsule, Cuboid};
use nalgebra::{Isometry3, Vector3};
use rollwalk_robot::document::Table;

/// Key of the tables.
pub(super) const KEY: &str = "obstacle";
/// Maximum number of obstacles.
const OBSTACLES_MAX: usize = 64;
/// Maximum distance of a coordinate from the origin, m.
pub(super) const FAR_M: f64 = 1000.0;
/// Default margin, m.
const MARGIN_M: f64 = 0.02;
/// Minimum length of an edge, and minimum radius, m.
const SIZE_MIN_M: f64 = 0.001;

/// Reads the obstacles of a terrain file, and turns them with its terrain.
pub(super) fn obstacles(root: &Table<'_>, heading_rad: f64) -> Option<Vec<Obstacle>> {
    let tables = root.tables_up_to(KEY, OBSTACLES_MAX);
    let turn = Isometry3::new(Vector3::zeros(), Vector3::z() * heading_rad);
    // Names with the lines on which they are given.
    let mut names = Vec::new();
    let read = tables.into_iter().enumerate();
    let read = read.map(|(index, table)| Some(obstacle(table, index, &mut names)?.moved(&turn)));
    // All tables are read, so that all faults are found.
    let read: Vec<_> = read.collect();
    read.into_iter().collect()
}

fn obstacle(
    mut table: Table<'_>,
    index: usize,
    names: &mut Vec<(String, usize)>,
) -> Option<Obstacle> {
    let name = if table.has("name") { table.name("name") } else { None };
    let name = name.unwrap_or_else(|| format!("obstacle {}", index + 1));
    table.call(format!("obstacle `{name}`"));
    match names.iter().find(|(other, _)| *other == name) {
        Some((_, line)) => {
            let problem = format_args!("is the name of the obstacle at line {line}, too");
            table.fault("name", problem, "again", "give each obstacle its own name");
        }
        None => names.push((name.clone(), table.line_of("name"))),
    }
    let margin_m = match table.has("margin_m") {
        true => table.number_in("margin_m", 0.0..=1.0, "m"),
        false => Some(MARGIN_M),
    };
    let shape = match (table.has("box_m"), table.has("from_m")) {
        (true, true) => {
            let help = "keep `box_m` with `at_m`, or `from_m` with `to_m` and `radius_m`";
            table.fault("from_m", "is a second shape beside `box_m`", "second shape", help);
            return None;
        }
        (false, true) => capsule(&table),
        // A table without a shape lacks `box_m`.
        (_, false) => cuboid(&table),
    };
    table.done();
    Some(Obstacle { name, shape: shape?, margin_m: margin_m? })
}

fn cuboid(table: &Table<'_>) -> Option<ObstacleShape> {
    let size_m = table.numbers::<3>("box_m").filter(|size_m| {
        let fits = size_m.iter().all(|edge_m| (SIZE_MIN_M..=FAR_M).contains(edge_m));
        if !fits {
            let problem = format_args!("is {size_m:?}");
            let help = format!("give edge lengths along x, y and z from {SIZE_MIN_M} to {FAR_M} m");
            table.fault("box_m", problem, "no box", help);
        }
        fits
    });
    let center_m = point(table, "at_m");
    let heading_deg = match table.has("heading_deg") {
        true => table.number_in("heading_deg", -180.0..=180.0, "degrees"),
        false => Some(0.0),
    };
    let (size_m, center_m, heading_deg) = (size_m?, center_m?, heading_deg?);
    let turn = Vector3::z() * heading_deg.to_radians();
    let half_m = Vector3::from(size_m) * 0.5;
    Some(ObstacleShape::Box(Cuboid { world_from_box: Isometry3::new(center_m, turn), half_m }))
}

fn capsule(table: &Table<'_>) -> Option<ObstacleShape> {
    let [from, to] = ["from_m", "to_m"].map(|key| point(table, key));
    let radius_m = table.number_in("radius_m", SIZE_MIN_M..=FAR_M, "m");
    Some(ObstacleShape::Capsule(Capsule { ends: [from?, to?], radius_m: radius_m? }))
}

fn point(table: &Table<'_>, key: &'static str) -> Option<Vector3<f64>> {
    let point = table.numbers::<3>(key)?;
    if let Some(far) = point.iter().find(|value| value.abs() > FAR_M) {
        let help = format!("give x, y and z from -{FAR_M} to {FAR_M} m");
        table.fault(key, format_args!("contains {far}"), "too far away", help);
        return None;
    }
    Some(point.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::file::{Shape, from_toml};

    #[test]
    fn obstacles_are_where_their_file_says() {
        let text = "heading_deg = 90\n[[obstacle]]\nname = \"crate\"\nbox_m = [0.2, 0.4, 0.6]\n\
            at_m = [1, 0, 0.3]\nmargin_m = 0.05\n[[obstacle]]\nfrom_m = [0.5, -1, 0.4]\n\
            to_m = [0.5, 1, 0.4]\nradius_m = 0.02";
        let terrain = from_toml("test.toml", text).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(terrain.shape, Shape::Level);
        let [first, second] = &terrain.obstacles[..] else { panic!("{:?}", terrain.obstacles) };
        assert_eq!([&*first.name, &*second.name], ["crate", "obstacle 2"]);
        assert_eq!([first.margin_m, second.margin_m], [0.05, MARGIN_M]);
        let solid = terrain.solid();
        // The terrain is turned by 90°: the crate's 0.4 m are along x.
        for (point, gap_m) in [
            ([0.0, 0.8, 0.3], 0.1),
            ([0.3, 1.0, 0.3], 0.1),
            ([0.0, 0.5, 0.5], 0.08),
            ([0.0, 3.0, 0.2], 0.2),
        ] {
            let found = solid.at(&point.into()).gap_m;
            assert!((found - gap_m).abs() < 1e-12, "{point:?}: {found}");
        }
    }

    #[test]
    fn a_wrong_obstacle_is_refused_with_what_would_be_right() {
        let faults = [
            ("", "obstacle `obstacle 1`: `box_m` is missing", "3 finite numbers"),
            ("box_m = [0.1, 0, 0.1]\nat_m = [1, 0, 0]", "`box_m` is [0.1, 0.0, 0.1]", "0.001"),
            ("box_m = [0.1, 0.1, 0.1]", "`at_m` is missing", "3 finite numbers"),
            ("box_m = [0.1, 0.1]\nat_m = [0, 0, 0]", "`box_m` must be", "3"),
            ("box_m = [1, 1, 1]\nat_m = [1e4, 0, 0]", "contains 10000", "-1000 to 1000 m"),
            ("from_m = [0, 0, 0]\nto_m = [1, 0, 0]", "`radius_m` is missing", "a number"),
            (
                "box_m = [1, 1, 1]\nat_m = [0, 0, 0]\nfrom_m = [0, 0, 0]",
                "is a second shape beside `box_m`",
                "`radius_m`",
            ),
            ("box_m = [1, 1, 1]\nat_m = [0, 0, 0]\nmargin_m = -1", "`margin_m` is -1", "0 to 1 m"),
            (
                "box_m = [1, 1, 1]\nat_m = [0, 0, 0]\nsize = 2",
                "unknown key `size`",
                "`heading_deg`",
            ),
            (
                "name = \"post\"\nbox_m = [1, 1, 1]\nat_m = [0, 0, 0]\n[[obstacle]]\n\
                 name = \"post\"\nbox_m = [1, 1, 1]\nat_m = [2, 0, 0]",
                "obstacle `post`: `name` is the name of the obstacle at line 2, too",
                "its own name",
            ),
        ];
        for (text, message, help) in faults {
            let error = from_toml("test.toml", &format!("[[obstacle]]\n{text}")).unwrap_err();
            let faults: Vec<_> =
                error.faults().map(|f| (f.message.clone(), f.help.clone())).collect();
            let said = faults.iter().any(|(m, h)| m.contains(message) && h.contains(help));
            assert!(said, "{text}: {faults:?}");
        }
    }
}
