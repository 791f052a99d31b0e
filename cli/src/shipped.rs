//! The robots, motions and mappings of gamepads that ship with rollwalk, carried in the binary, so that `rollwalk demo`
//! runs in any folder.

use crate::inputs::Source;
use rollwalk_robot::Robot;
use std::path::Path;

/// Declares the files, by their path in the checkout.
macro_rules! shipped {
    ($($path:literal),* $(,)?) => {
        const FILES: &[(&str, &str)] =
            &[$(($path, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../", $path)))),*];
    };
}

shipped!(
    "gamepads/xbox.toml",
    "gamepads/playstation.toml",
    "designs/agilebot_legs.toml",
    "designs/car_tilted.toml",
    "motions/agilebot_library.toml",
    "motions/agilebot_skills_library.toml",
    "motions/anymal_drive.toml",
    "motions/anymal_duck.toml",
    "motions/anymal_library.toml",
    "motions/anymal_stand.toml",
    "motions/anymal_turn.toml",
    "motions/car_drive.toml",
    "motions/drive_1m.toml",
    "motions/duck.toml",
    "motions/flying_trot.toml",
    "motions/legbot_walk.toml",
    "motions/pace.toml",
    "motions/pronk.toml",
    "motions/pup_drive.toml",
    "motions/pup_library.toml",
    "motions/pup_stand.toml",
    "motions/pup_walk.toml",
    "motions/roll.toml",
    "motions/skate.toml",
    "motions/skaterbot_library.toml",
    "motions/skaterbot_stand.toml",
    "motions/slalom.toml",
    "motions/stand.toml",
    "motions/step_and_drive.toml",
    "motions/swizzlebot2_forward.toml",
    "motions/swizzlebot3_forward.toml",
    "motions/swizzlebot4_forward.toml",
    "motions/swizzlebot5_forward.toml",
    "motions/swizzlebot_forward.toml",
    "motions/swizzlebot_library.toml",
    "motions/swizzlebot_stand.toml",
    "motions/swizzlebot_turn.toml",
    "motions/table_2_1/agilebot_side_step_and_roll.toml",
    "motions/table_2_1/agilebot_start_stop.toml",
    "motions/table_2_1/agilebot_turn.toml",
    "motions/table_2_1/brainbot_forward.toml",
    "motions/table_2_1/brainbot_turn.toml",
    "motions/table_2_1/creature3_fast_walk.toml",
    "motions/table_2_1/creature3_turn.toml",
    "motions/table_2_1/creature3_walk.toml",
    "motions/table_2_1/dinobot_skating.toml",
    "motions/table_2_1/skatebot_skating.toml",
    "motions/table_2_1/swizzlebot_forward.toml",
    "motions/table_2_1/swizzlebot_turn.toml",
    "motions/test_leg_library.toml",
    "motions/test_leg_roll.toml",
    "motions/test_leg_stand.toml",
    "motions/trot.toml",
    "motions/turn_in_place.toml",
    "motions/walk.toml",
    "motions/walk_and_roll.toml",
    "motions/walk_held.toml",
    "robots/agilebot.toml",
    "robots/agilebot_sprint.toml",
    "robots/anymal_wheels.toml",
    "robots/brainbot.toml",
    "robots/car.toml",
    "robots/car_tilted.toml",
    "robots/creature3.toml",
    "robots/dinobot.toml",
    "robots/legbot.toml",
    "robots/pup.toml",
    "robots/skatebot.toml",
    "robots/skaterbot.toml",
    "robots/swizzlebot.toml",
    "robots/swizzlebot2.toml",
    "robots/swizzlebot4.toml",
    "robots/swizzlebot5.toml",
    "robots/test_leg.toml",
);

/// The library file that the demo plays.
pub const DEMO_LIBRARY: &str = "motions/agilebot_library.toml";

/// The text of a shipped file.
pub fn text(path: &Path) -> Option<&'static str> {
    FILES.iter().find(|(shipped, _)| Path::new(shipped) == path).map(|(_, text)| *text)
}

/// The shipped robot files.
pub fn robots() -> impl Iterator<Item = &'static Path> {
    FILES.iter().map(|(path, _)| Path::new(path)).filter(|path| path.starts_with("robots"))
}

/// The shipped robot with this hash of its configuration.
pub fn robot_of(config_hash: u32) -> Option<Robot> {
    let mut robots = robots().filter_map(|file| Source::Shipped.robot(file).ok());
    robots.find(|robot| robot.controller_config().is_ok_and(|config| config.hash() == config_hash))
}

/// The shipped mappings of gamepads, with their texts; the first that fits a device counts.
pub fn gamepads() -> impl Iterator<Item = (&'static Path, &'static str)> {
    let files = FILES.iter().map(|(path, text)| (Path::new(path), *text));
    files.filter(|(path, _)| path.starts_with("gamepads"))
}

#[cfg(test)]
mod tests {
    use crate::inputs::Source;
    use std::path::Path;

    #[test]
    fn the_demo_finds_everything_it_names_in_the_binary() {
        let library = Source::Shipped.library(Path::new(super::DEMO_LIBRARY)).unwrap();
        assert_eq!(library.motions.len(), library.file.motions.len());
        assert!(super::robots().count() >= 3);
    }
}
